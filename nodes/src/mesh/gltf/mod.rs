//! Meshes from glTF 2.0 files: the triangles of one scene, transformed by their nodes.

mod accessor;
mod buffers;
mod container;
mod document;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::Path;

use lattice_core::pose::Axes;
use lattice_core::registration::UNLABELED;
use nalgebra::{Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use self::buffers::Buffers;
use self::document::{Document, Extras, Node, Primitive};
use super::labelled::Parts;
use super::{LabelledMesh, MeshError};

/// Limit of file size, bytes.
const MAX_BYTES: u64 = 1 << 30;
/// Primitive modes in the order of their codes; only triangles are supported.
const MODES: [&str; 7] = [
    "POINTS",
    "LINES",
    "LINE_LOOP",
    "LINE_STRIP",
    "TRIANGLES",
    "TRIANGLE_STRIP",
    "TRIANGLE_FAN",
];
const TRIANGLES: u32 = 4;
/// Extension for integer vertices.
const QUANTIZATION: &str = "KHR_mesh_quantization";
/// Prefixes of supported required extensions, which do not affect triangle positions.
const HARMLESS: [&str; 4] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
];

/// Reads a file. Its axes (y up, right-handed) are converted by [`in_axes`].
pub(super) fn read(
    reader: impl BufRead,
    folder: Option<&Path>,
    axes: Axes,
    max_triangles: usize,
) -> Result<LabelledMesh, MeshError> {
    let mut bytes = Vec::new();
    let read = reader.take(MAX_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|error| fault(error.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        let problem = format!("more than {MAX_BYTES} bytes");
        return Err(fault(problem));
    }
    from_bytes(&bytes, folder, axes, max_triangles)
}

/// Reads the bytes of a file. External buffers are read from the folder, if given.
///
/// Class and instance of all triangles of a node, a mesh or a primitive are given in its `extras` as
/// `label` and `instance`; the innermost applies. By default triangles are unlabelled and each node with a mesh
/// is an instance.
pub fn from_bytes(
    bytes: &[u8],
    folder: Option<&Path>,
    axes: Axes,
    max_triangles: usize,
) -> Result<LabelledMesh, MeshError> {
    let container = container::open(bytes).map_err(fault)?;
    let document: Document = serde_json::from_slice(container.text)
        .map_err(|error| fault(format!("its JSON cannot be read: {error}")))?;
    let is_quantized = check(&document).map_err(fault)?;
    let mut reading = Reading {
        document: &document,
        buffers: Buffers::new(&document, container.binary, folder),
        axes,
        is_quantized,
        max_triangles,
        parts: Parts::default(),
        nodes: 0,
    };
    reading.scene()?;
    let mesh = reading.parts.mesh();
    mesh.map_err(|error| MeshError::NoMesh(Box::new(error)))
}

fn fault(reason: String) -> MeshError {
    MeshError::Gltf(reason)
}

/// Checks version and extensions; true if vertices may be integers.
fn check(document: &Document) -> Result<bool, String> {
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        let version: String = version.chars().take(16).collect();
        return Err(format!("version '{version}' of the format, not 2"));
    }
    let required = &document.extensions_required.0;
    let harmless = |name: &&String| {
        *name == QUANTIZATION || HARMLESS.iter().any(|start| name.starts_with(start))
    };
    if let Some(name) = required.iter().find(|name| !harmless(name)) {
        let name: String = name.chars().take(80).collect();
        return Err(format!(
            "the required extension {name} is not supported: export without it"
        ));
    }
    Ok(required.iter().any(|name| name == QUANTIZATION))
}

/// Converts a glTF point (left, up, forward, by its specification) to these axes, metres.
///
/// The axes of ROS are (x, -z, y), z up, as in Blender and most converters, so that a scene written
/// as PLY and as glTF agrees. Unity's importers negate x; WinRT, OpenXR and ARKit use the file axes.
fn in_axes(axes: Axes, p: Point3<f64>) -> [f32; 3] {
    let [x, y, z] = p.coords.into();
    let turned = match axes {
        Axes::RosFlu => [x, -z, y],
        Axes::UnityRuf => [-x, y, z],
        Axes::WinrtRub => [x, y, z],
        Axes::Optical => [x, -y, -z],
    };
    turned.map(|c| c as f32)
}

/// State of reading a document.
struct Reading<'a> {
    document: &'a Document,
    buffers: Buffers<'a>,
    axes: Axes,
    is_quantized: bool,
    max_triangles: usize,
    parts: Parts,
    /// Number of nodes with a mesh so far.
    nodes: usize,
}

/// Node with a mesh: its transform, label and instance.
struct Placed {
    scene_from_node: Matrix4<f64>,
    label: u16,
    instance: u16,
    /// Index of the first vertex of each position accessor.
    first: BTreeMap<usize, u32>,
}

impl<'a> Reading<'a> {
    /// Reads the nodes of the scene, each once: nodes form trees.
    fn scene(&mut self) -> Result<(), MeshError> {
        let document = self.document;
        let mut seen = vec![false; document.nodes.0.len()];
        let mut open: Vec<(&Node, usize, Matrix4<f64>)> = Vec::new();
        let mut next = self.roots()?;
        let mut scene_from_parent = Matrix4::identity();
        loop {
            // In reverse order: the first child is read next.
            for &number in next.iter().rev() {
                let (Some(node), Some(seen)) = (document.nodes.0.get(number), seen.get_mut(number))
                else {
                    return Err(fault(format!("there is no node {number}")));
                };
                if std::mem::replace(seen, true) {
                    let problem = format!("node {number} has two parents, or is below itself");
                    return Err(fault(problem));
                }
                open.push((node, number, scene_from_parent));
            }
            let Some((node, number, scene_from_parent_of_it)) = open.pop() else {
                break;
            };
            let scene_from_node = scene_from_parent_of_it * parent_from_node(node);
            if let Some(mesh) = node.mesh {
                let of_node = |reason| fault(format!("node {number}, mesh {mesh}: {reason}"));
                if node.skin.is_some() {
                    return Err(of_node("skinned meshes are not supported".to_owned()));
                }
                self.mesh(node, mesh, scene_from_node)
                    .map_err(|error| match error {
                        MeshError::Gltf(reason) => of_node(reason),
                        other => other,
                    })?;
            }
            next = Cow::Borrowed(&node.children.0);
            scene_from_parent = scene_from_node;
        }
        match self.parts.triangles.is_empty() {
            true => Err(fault("its scene has no triangles".to_owned())),
            false => Ok(()),
        }
    }

    /// Root nodes of the default scene; without scenes all nodes without a parent.
    fn roots(&self) -> Result<Cow<'a, [usize]>, MeshError> {
        let Document {
            scene,
            scenes,
            nodes,
            ..
        } = self.document;
        let number = scene.unwrap_or(0);
        if let Some(scene) = scenes.0.get(number) {
            return Ok(Cow::Borrowed(&scene.nodes.0));
        }
        if scene.is_some() {
            return Err(fault(format!("there is no scene {number}")));
        }
        let mut is_root = vec![true; nodes.0.len()];
        for child in nodes.0.iter().flat_map(|node| &node.children.0) {
            if let Some(is_root) = is_root.get_mut(*child) {
                *is_root = false;
            }
        }
        let roots = is_root.iter().enumerate().filter(|(_, is_root)| **is_root);
        Ok(roots.map(|(number, _)| number).collect::<Vec<_>>().into())
    }

    fn mesh(
        &mut self,
        node: &Node,
        number: usize,
        scene_from_node: Matrix4<f64>,
    ) -> Result<(), MeshError> {
        let mesh = self.document.meshes.0.get(number);
        let mesh = mesh.ok_or_else(|| fault("there is no such mesh".to_owned()))?;
        let instance = self.nodes.min(usize::from(u16::MAX)) as u16;
        self.nodes += 1;
        let mut placed = Placed {
            scene_from_node,
            label: UNLABELED,
            instance,
            first: BTreeMap::new(),
        };
        placed.say(&node.extras).map_err(fault)?;
        placed.say(&mesh.extras).map_err(fault)?;
        for primitive in &mesh.primitives.0 {
            self.primitive(primitive, &mut placed)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, placed: &mut Placed) -> Result<(), MeshError> {
        let document = self.document;
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        if mode != TRIANGLES {
            let name = MODES.get(mode as usize).copied().unwrap_or("unknown");
            return Err(fault(format!(
                "primitives of mode {mode} ({name}) are not supported, only TRIANGLES"
            )));
        }
        let position = primitive.attributes.position;
        let position = position.ok_or_else(|| fault("a primitive has no POSITION".to_owned()))?;
        let vertices = accessor::count(document, position).map_err(fault)?;
        let corners = match primitive.indices {
            Some(indices) => accessor::count(document, indices).map_err(fault)?,
            None => vertices,
        };
        if !corners.is_multiple_of(3) {
            return Err(fault(format!("{corners} indices are not a multiple of 3")));
        }
        // Checked before allocation: a few bytes may refer to one accessor many times.
        let triangles = (corners / 3).saturating_add(self.parts.triangles.len() as u64);
        let max = self.max_triangles;
        if triangles > max as u64 {
            return Err(MeshError::FileTooLarge { triangles, max });
        }
        let first = self.vertices(position, vertices, placed)?;
        let corners = match primitive.indices {
            Some(indices) => {
                accessor::corners(document, &mut self.buffers, indices).map_err(fault)?
            }
            None => (0..u32::try_from(vertices).unwrap_or(u32::MAX)).collect(),
        };
        let of_primitive = (placed.label, placed.instance);
        placed.say(&primitive.extras).map_err(fault)?;
        let added = self.triangles(&corners, first, vertices, placed);
        (placed.label, placed.instance) = of_primitive;
        added
    }

    /// Adds the vertices of an accessor once per node; returns the index of the first.
    fn vertices(
        &mut self,
        position: usize,
        count: u64,
        placed: &mut Placed,
    ) -> Result<u32, MeshError> {
        if let Some(first) = placed.first.get(&position) {
            return Ok(*first);
        }
        let first = self.parts.vertices_m.len();
        let max = self.max_triangles.saturating_mul(3);
        let found = (first as u64).saturating_add(count);
        if found > max as u64 {
            let found = usize::try_from(found).unwrap_or(usize::MAX);
            let what = "vertices or more";
            return Err(MeshError::TooMany { what, found, max });
        }
        let is_quantized = self.is_quantized;
        let all = accessor::positions(self.document, &mut self.buffers, position, is_quantized);
        let (at, axes) = (&placed.scene_from_node, self.axes);
        let in_scene = |p: [f64; 3]| in_axes(axes, at.transform_point(&Point3::from(p)));
        let all = all.map_err(fault)?;
        self.parts.vertices_m.extend(all.into_iter().map(in_scene));
        let first = u32::try_from(first).unwrap_or(u32::MAX);
        placed.first.insert(position, first);
        Ok(first)
    }

    fn triangles(
        &mut self,
        corners: &[u32],
        first: u32,
        vertices: u64,
        placed: &Placed,
    ) -> Result<(), MeshError> {
        // By the specification a mirrored node reverses its triangles.
        let linear = placed.scene_from_node.fixed_view::<3, 3>(0, 0);
        let is_mirrored = linear.determinant() < 0.0;
        let turned = is_mirrored != (self.axes.matrix().determinant() < 0.0);
        let parts = &mut self.parts;
        for &[a, b, c] in corners.as_chunks().0 {
            if let Some(corner) = [a, b, c].iter().find(|v| u64::from(**v) >= vertices) {
                let problem =
                    format!("a triangle refers to vertex {corner}, outside 0..{vertices}");
                return Err(fault(problem));
            }
            let triangle = if turned { [a, c, b] } else { [a, b, c] };
            let triangle = triangle.map(|v| v.saturating_add(first));
            parts.triangles.push(triangle);
            parts.labels.push(placed.label);
            parts.instances.push(placed.instance);
        }
        Ok(())
    }
}

impl Placed {
    /// Applies the label and instance of a part, which override those of the whole.
    fn say(&mut self, extras: &Extras) -> Result<(), String> {
        for (what, given, known) in [
            ("label", extras.label, &mut self.label),
            ("instance", extras.instance, &mut self.instance),
        ] {
            let Some(number) = given else { continue };
            if number.fract() != 0.0 || !(0.0..=f64::from(u16::MAX)).contains(&number) {
                return Err(format!("{what} {number} is not an integer in 0..=65535"));
            }
            *known = number as u16;
        }
        Ok(())
    }
}

/// The transform of a node: a matrix, or translation, rotation and scale.
fn parent_from_node(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = &node.matrix {
        let mut parent_from_node = Matrix4::from_column_slice(&matrix[..]);
        // Its last row is 0, 0, 0, 1.
        parent_from_node.set_row(3, &nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0));
        return parent_from_node;
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let scale = Vector3::from(node.scale.unwrap_or([1.0; 3]));
    let translation = Translation3::from(node.translation.unwrap_or_default());
    translation.to_homogeneous()
        * rotation.to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&scale)
}
