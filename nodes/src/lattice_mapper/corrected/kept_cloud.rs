//! Clouds in an odometry frame, thinned to be kept in memory.

use std::convert::Infallible;

use lattice_core::cloud::{
    CloudError, CloudLayout, CloudLimits, CloudView, PointField, RangeLimits, RecordFormat,
    transform_records,
};
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::{Isometry3, Point3, Vector3};
use rustc_hash::FxHashSet;

use crate::convert::{cloud, geometry};

/// Points of a cloud in the odometry frame.
pub(super) struct KeptCloud {
    pub stamp_ns: i64,
    layout: CloudLayout,
    data: Vec<u8>,
    /// Pose of the odometry frame at which the map has the points; `None` if it has none of them.
    pub placed: Option<Isometry3<f64>>,
}

/// Thinned cloud with the numbers of its dropped points.
pub(super) struct Thinned {
    /// Points in cells without a point so far; `None` if there are none.
    pub kept: Option<KeptCloud>,
    /// Number of points in cells that already have one.
    pub thinned: u64,
    /// Number of NaN or infinite points.
    pub not_finite: u64,
}

/// Occupied cubic cells in the odometry frame.
pub(super) struct SeenCells {
    side_m: f64,
    cells: FxHashSet<[i32; 3]>,
}

impl SeenCells {
    /// Creates an empty set. `side_m`: edge of the cells.
    pub fn new(side_m: f64) -> Self {
        Self {
            side_m,
            cells: FxHashSet::default(),
        }
    }

    /// Removes all cells.
    pub fn clear(&mut self) {
        self.cells.clear();
    }

    /// True for the first point of a cell.
    fn is_first(&mut self, point_m: &Vector3<f64>) -> bool {
        // Saturates far out, where voxels end.
        let cell = point_m.map(|v| (v / self.side_m).floor() as i32);
        self.cells.insert(cell.into())
    }
}

impl KeptCloud {
    /// Reads a cloud and keeps the first point of each cell, with its other fields if `with_fields`.
    pub fn thin(
        message: &PointCloud2,
        limits: &CloudLimits,
        with_fields: bool,
        seen: &mut SeenCells,
    ) -> Result<Thinned, CloudError> {
        let layout = cloud::layout_of(message);
        let view = layout.view(&message.data, limits)?;
        let stamp_ns = message.header.stamp.to_ns();
        let moved = Moved::of(&view, with_fields, &Isometry3::identity());
        let step = moved.layout.point_step as usize;
        let (mut data, mut thinned) = (Vec::new(), 0);
        let records = moved.layout.view(&moved.data, limits)?;
        for (number, record) in moved.data.chunks_exact(step.max(1)).enumerate() {
            match seen.is_first(&records.xyz(number)) {
                true => data.extend_from_slice(record),
                false => thinned += 1,
            }
        }
        let kept = (!data.is_empty()).then(|| KeptCloud {
            stamp_ns,
            layout: of_points(&moved.layout, data.len()),
            data,
            placed: None,
        });
        Ok(Thinned {
            kept,
            thinned,
            not_finite: moved.not_finite,
        })
    }

    /// Size in memory, bytes.
    pub fn bytes(&self) -> usize {
        let fields = self.layout.fields.iter();
        let names: usize = fields
            .map(|field| size_of_val(field) + field.name.len())
            .sum();
        size_of_val(self) + names + self.data.len()
    }

    fn view(&self) -> Option<CloudView<'_>> {
        let max_points = usize::MAX;
        self.layout
            .view(&self.data, &CloudLimits { max_points })
            .ok()
    }

    /// Message of the points in the map frame.
    pub fn message(&self, map_frame: &str, map_from_odom: &Isometry3<f64>) -> PointCloud2 {
        let header = geometry::header(map_frame, self.stamp_ns);
        let moved = self
            .view()
            .map(|view| Moved::of(&view, true, map_from_odom));
        let Some(Moved { layout, data, .. }) = moved else {
            return PointCloud2::default();
        };
        let (step, points) = (layout.point_step, layout.width as usize);
        cloud::dense_cloud(
            header,
            cloud::message_fields(layout.fields),
            step,
            points,
            data,
        )
    }

    /// Largest displacement between two poses, m: that of the first, the middle and the last point.
    pub fn moved_m(&self, from: &Isometry3<f64>, to: &Isometry3<f64>) -> f64 {
        let Some(view) = self.view() else {
            return 0.0;
        };
        let ends = [0, view.len() / 2, view.len().saturating_sub(1)];
        let moved = ends.map(|i| {
            let point = Point3::from(view.xyz(i));
            (from * point - to * point).norm()
        });
        moved.into_iter().fold(0.0, f64::max)
    }

    /// Keeps the points that `is_kept` selects by their position in the map; all of them if they are not mapped.
    pub fn retain(&mut self, is_kept: impl Fn(&Vector3<f64>) -> bool) {
        let (Some(placed), Some(view)) = (self.placed, self.view()) else {
            return;
        };
        let mut data = Vec::new();
        let step = self.layout.point_step.max(1) as usize;
        for (number, record) in self.data.chunks_exact(step).enumerate() {
            if is_kept(&(placed * Point3::from(view.xyz(number))).coords) {
                data.extend_from_slice(record);
            }
        }
        self.layout = of_points(&self.layout, data.len());
        self.data = data;
    }
}

/// Layout of `bytes` of records in one row.
fn of_points(layout: &CloudLayout, bytes: usize) -> CloudLayout {
    let points = bytes / layout.point_step.max(1) as usize;
    let width = u32::try_from(points).unwrap_or(u32::MAX);
    CloudLayout {
        width,
        row_step: width.saturating_mul(layout.point_step),
        ..layout.clone()
    }
}

/// Records of transformed points.
struct Moved {
    layout: CloudLayout,
    data: Vec<u8>,
    not_finite: u64,
}

impl Moved {
    fn of(view: &CloudView<'_>, with_fields: bool, pose: &Isometry3<f64>) -> Self {
        let names: Vec<String> = match with_fields {
            true => view.fields().iter().map(|f| f.name.clone()).collect(),
            false => Vec::new(),
        };
        let is_coordinate = |name: &String| ["x", "y", "z"].contains(&name.as_str());
        let names: Vec<String> = names
            .into_iter()
            .filter(|name| !is_coordinate(name))
            .collect();
        let format = RecordFormat::new(view, &names, None, false);
        let place = |_| Ok::<_, Infallible>(*pose);
        let Ok(moved) = transform_records(view, 0, None, &RangeLimits::default(), &format, place);
        let (fields, step): (Vec<PointField>, usize) = format.fields(moved.precision);
        let of_step = CloudLayout {
            width: 0,
            height: 1,
            point_step: u32::try_from(step).unwrap_or(u32::MAX),
            row_step: 0,
            is_bigendian: false,
            fields,
        };
        Self {
            layout: of_points(&of_step, moved.data.len()),
            data: moved.data,
            not_finite: moved.not_finite as u64,
        }
    }
}
