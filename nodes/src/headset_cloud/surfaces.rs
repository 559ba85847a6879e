//! Mesh of a headset: surfaces by name, in its origin and the axes of ROS.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_core::pose::Axes;
use lattice_core::registration::UNLABELED;
use lattice_msgs::lattice::HeadsetMesh;
use nalgebra::{Isometry3, Point3, Vector3};

use super::chunks::{Chunks, StateTime};
use super::refusal::{MeshRefusal, shown};
use crate::convert::geometry::isometry_from_pose;
use crate::mesh::{LabelledMesh, MeshError};

/// Longest name of a surface or a session, bytes.
const MAX_NAME: usize = 256;
/// Limit of chunks per surface.
const MAX_CHUNKS: u32 = 1 << 16;

/// Bounds of the mesh of a headset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshOptions {
    /// Required frame of surfaces.
    pub headset_frame: String,
    /// Axis convention of that frame.
    pub axes: Axes,
    /// Limit of triangles of all surfaces, and of vertices.
    pub max_triangles: usize,
    /// Limit of surfaces.
    pub max_surfaces: usize,
}

/// A surface with vertices in the headset's origin and the axes of ROS; counterclockwise triangles face the
/// viewer.
struct Surface {
    time: StateTime,
    mesh: LabelledMesh,
}

/// Effect of a message on the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Change {
    /// Surfaces that are new or replaced.
    pub replaced: u64,
    /// Removed surfaces.
    pub removed: u64,
    /// Rejected triangles without area.
    pub degenerate: u64,
    /// Surfaces dropped before their chunks were complete.
    pub incomplete: u64,
}

/// Surfaces of one session, each replaced as a whole.
pub(super) struct Surfaces {
    options: MeshOptions,
    surfaces: BTreeMap<String, Surface>,
    chunks: Chunks,
}

impl Surfaces {
    pub fn new(options: MeshOptions) -> Self {
        Self {
            options,
            surfaces: BTreeMap::new(),
            chunks: Chunks::default(),
        }
    }

    /// Changes the bounds.
    pub fn set_options(&mut self, options: MeshOptions) {
        self.options = options;
    }

    /// Applies a validated surface, a chunk of it, or its removal.
    pub fn on_mesh(
        &mut self,
        message: &Arc<HeadsetMesh>,
        arrival_ns: i64,
    ) -> Result<Change, MeshRefusal> {
        let time = StateTime {
            stamp_ns: message.header.stamp.to_ns(),
            arrival_ns,
        };
        let there = self.surfaces.get(&message.surface);
        if there.is_some_and(|there| time.is_late(there.time)) {
            let surface = shown(&message.surface);
            return Err(MeshRefusal::Stale { surface });
        }
        let mut change = Change::default();
        if message.removed {
            self.chunks.remove(&message.surface);
            change.removed = u64::from(self.surfaces.remove(&message.surface).is_some());
            return Ok(change);
        }
        if let Some(chunks) = self.chunks.push(Arc::clone(message), time)? {
            let (mesh, degenerate) = self.joined(&chunks)?;
            change.degenerate = degenerate;
            change.replaced = 1;
            self.insert(&message.surface, time, mesh)?;
        }
        let max_numbers = self.options.max_triangles.saturating_mul(7);
        change.incomplete = self.chunks.bound(self.options.max_surfaces, max_numbers);
        Ok(change)
    }

    /// Adds a mesh in the headset's origin and axes as a surface.
    pub fn on_file(&mut self, name: &str, mesh: &LabelledMesh) -> Result<Change, MeshRefusal> {
        let triangles = mesh.triangles().iter().copied();
        let at = Isometry3::identity();
        let vertices_m = mesh.vertices_m().iter().copied();
        let classes = mesh.labels().to_vec();
        let surface = || shown(name);
        let (mesh, degenerate) = self
            .in_ros(&at, vertices_m, triangles.collect(), classes)
            .map_err(|error| MeshRefusal::Mesh {
                surface: surface(),
                error,
            })?;
        let time = StateTime {
            stamp_ns: 0,
            arrival_ns: 0,
        };
        self.insert(name, time, mesh)?;
        Ok(Change {
            replaced: 1,
            degenerate,
            ..Change::default()
        })
    }

    /// Removes the surfaces with a name prefix; returns their number.
    pub fn remove_all(&mut self, prefix: &str) -> u64 {
        let before = self.surfaces.len();
        self.surfaces.retain(|name, _| !name.starts_with(prefix));
        (before - self.surfaces.len()) as u64
    }

    /// Removes everything.
    pub fn clear(&mut self) {
        self.surfaces.clear();
        self.chunks.clear();
    }

    /// Number of surfaces.
    pub fn len(&self) -> usize {
        self.surfaces.len()
    }

    /// Number of incomplete surfaces.
    pub fn waiting(&self) -> usize {
        self.chunks.len()
    }

    /// Number of triangles of all surfaces.
    pub fn triangles(&self) -> usize {
        self.surfaces.values().map(|s| s.mesh.len()).sum()
    }

    /// All surfaces as one mesh.
    pub fn merged(&self) -> Result<LabelledMesh, MeshError> {
        let (mut vertices_m, mut triangles, mut classes) = (Vec::new(), Vec::new(), Vec::new());
        for surface in self.surfaces.values() {
            let first = vertices_m.len() as u32;
            vertices_m.extend_from_slice(surface.mesh.vertices_m());
            let shifted = surface.mesh.triangles().iter();
            triangles.extend(shifted.map(|corners| corners.map(|v| v.saturating_add(first))));
            classes.extend_from_slice(surface.mesh.labels());
        }
        let instances = vec![0; triangles.len()];
        LabelledMesh::new(vertices_m, triangles, classes, instances)
    }

    /// Validates the scalar fields of a message.
    pub fn check(&self, message: &HeadsetMesh) -> Result<(), MeshRefusal> {
        let found = message.header.frame_id.trim_start_matches('/');
        if found != self.options.headset_frame {
            return Err(MeshRefusal::Frame {
                found: shown(found),
                expected: self.options.headset_frame.clone(),
            });
        }
        let problem = if message.surface.len() > MAX_NAME {
            "its name is too long"
        } else if message.removed {
            return Ok(());
        } else if message.chunks == 0 || message.chunks > MAX_CHUNKS {
            "`chunks` is outside 1..=65536"
        } else if message.chunk >= message.chunks {
            "`chunk` is not below `chunks`"
        } else {
            return Ok(());
        };
        let surface = shown(&message.surface);
        Err(MeshRefusal::Malformed { surface, problem })
    }

    /// Mesh of all chunks, and the number of rejected triangles.
    fn joined(&self, chunks: &[Arc<HeadsetMesh>]) -> Result<(LabelledMesh, u64), MeshRefusal> {
        let surface = || shown(chunks.first().map_or("", |chunk| &chunk.surface));
        let malformed = |problem| MeshRefusal::Malformed {
            surface: surface(),
            problem,
        };
        let pose = chunks.first().map(|chunk| chunk.pose).unwrap_or_default();
        let origin_from_surface = isometry_from_pose(&pose)
            .ok_or_else(|| malformed("its pose is not finite or its rotation is zero"))?;
        let numbers: Vec<f32> = chunks.iter().flat_map(|c| &c.vertices).copied().collect();
        let corners: Vec<u32> = chunks.iter().flat_map(|c| &c.triangles).copied().collect();
        let mut classes: Vec<u16> = chunks.iter().flat_map(|c| &c.classes).copied().collect();
        let (vertices_m, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(malformed(
                "the number of coordinates is not a multiple of 3",
            ));
        }
        let (triangles, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(malformed("the number of indices is not a multiple of 3"));
        }
        if classes.is_empty() {
            classes = vec![UNLABELED; triangles.len()];
        }
        let vertices_m = vertices_m.iter().copied();
        self.in_ros(
            &origin_from_surface,
            vertices_m,
            triangles.to_vec(),
            classes,
        )
        .map_err(|error| MeshRefusal::Mesh {
            surface: surface(),
            error,
        })
    }

    /// Mesh in the axes of ROS. Triangles of left-handed headset axes are reversed, and those without area
    /// rejected.
    fn in_ros(
        &self,
        origin_from_surface: &Isometry3<f64>,
        vertices_m: impl Iterator<Item = [f32; 3]>,
        triangles: Vec<[u32; 3]>,
        classes: Vec<u16>,
    ) -> Result<(LabelledMesh, u64), MeshError> {
        let axes = self.options.axes;
        let in_ros = |v: [f32; 3]| -> [f32; 3] {
            let at = origin_from_surface * Point3::from(v.map(f64::from));
            axes.to_ros(at.coords).map(|c| c as f32).into()
        };
        let turned = axes.matrix().determinant() < 0.0;
        let triangles = triangles.into_iter();
        let triangles = triangles.map(|[a, b, c]| if turned { [a, c, b] } else { [a, b, c] });
        let instances = vec![0; classes.len()];
        let vertices_m = vertices_m.map(in_ros).collect();
        let mesh = LabelledMesh::new(vertices_m, triangles.collect(), classes, instances)?;
        let has_area = mesh.corners_m().map(|corners| {
            let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
            (b - a).cross(&(c - a)).norm_squared() > 0.0
        });
        let has_area: Vec<bool> = has_area.collect();
        let degenerate = has_area.iter().filter(|has| !**has).count();
        if degenerate == 0 {
            return Ok((mesh, 0));
        }
        let kept = |i: &usize| has_area.get(*i) == Some(&true);
        let of = |all: &[u16]| {
            let all = all.iter().enumerate().filter(|(i, _)| kept(i));
            all.map(|(_, v)| *v).collect::<Vec<u16>>()
        };
        let triangles = mesh.triangles().iter().enumerate();
        let triangles = triangles.filter(|(i, _)| kept(i)).map(|(_, t)| *t);
        let (triangles, classes) = (triangles.collect(), of(mesh.labels()));
        let instances = of(mesh.instances());
        let mesh = LabelledMesh::new(mesh.vertices_m().to_vec(), triangles, classes, instances)?;
        Ok((mesh, degenerate as u64))
    }

    /// Inserts or replaces a surface within the bounds.
    fn insert(
        &mut self,
        name: &str,
        time: StateTime,
        mesh: LabelledMesh,
    ) -> Result<(), MeshRefusal> {
        let others = || self.surfaces.iter().filter(|(other, _)| *other != name);
        let surface = || shown(name);
        if others().count() >= self.options.max_surfaces {
            let (surface, max) = (surface(), self.options.max_surfaces);
            return Err(MeshRefusal::TooManySurfaces { surface, max });
        }
        let size = |mesh: &LabelledMesh| mesh.len().max(mesh.vertices_m().len() / 3);
        let triangles = others().map(|(_, s)| size(&s.mesh)).sum::<usize>() + size(&mesh);
        if triangles > self.options.max_triangles {
            return Err(MeshRefusal::TooManyTriangles {
                surface: surface(),
                triangles,
                max: self.options.max_triangles,
            });
        }
        if mesh.is_empty() {
            self.surfaces.remove(name);
        } else {
            let surface = Surface { time, mesh };
            self.surfaces.insert(name.to_owned(), surface);
        }
        Ok(())
    }
}
