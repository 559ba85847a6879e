//! Input of the mapper: clouds, their labels and rays.

use lattice_core::cloud::{Cloud, CloudLimits};
use lattice_core::voxels::{PointColumns, VoxelStore};
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::Vector3;

use super::refusal::CloudRefusal;
use super::state::LatticeMapper;
use crate::convert::{cloud, point_colors, semantic, viewpoint};

impl LatticeMapper {
    /// Quantizes a cloud of the map frame into the list.
    pub fn on_cloud(&mut self, message: &PointCloud2) -> Result<(), CloudRefusal> {
        self.counts.clouds_in += 1;
        let frame = message.header.frame_id.trim_start_matches('/');
        if frame != self.options.map_frame {
            self.counts.clouds_wrong_frame += 1;
            return Err(CloudRefusal::Frame {
                found: frame.chars().take(64).collect(),
                expected: self.options.map_frame.clone(),
            });
        }
        let limits = CloudLimits {
            max_points: self.options.max_cloud_points,
        };
        let cloud = cloud::cloud_from_message(message, &limits, &self.list.datum_m())
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.choose_datum(&cloud);
        // Everything that can be rejected is read before any voxel changes.
        let labels = self.labels_of(message)?;
        let colors = self.colors_of(message, &limits)?;
        let viewpoints = self.viewpoints_of(message, &limits)?;
        // The first stamp has no reference: nothing expires by it.
        let ages = (self.stamps.as_ref()).is_some_and(|stamps| !stamps.is_new());
        let stamp_ns = cloud.stamp_ns;
        if (self.stamps.as_mut()).is_some_and(|stamps| !stamps.passes(stamp_ns)) {
            self.counts.clouds_stamp_jump += 1;
            return Err(CloudRefusal::Stamp {
                stamp_ns,
                step_ns: stamp_ns.saturating_sub(self.last_stamp_ns),
            });
        }
        if (self.free_space.as_ref()).is_some_and(|free| free.is_complete(cloud.stamp_ns)) {
            self.clear_rays();
        }
        let report = match &mut self.occupancy {
            Some(occupancy) => occupancy.insert(&cloud),
            None => {
                let columns = PointColumns {
                    stamp_ns,
                    labels: &labels.unwrap_or_default(),
                    colors: &colors.unwrap_or_default(),
                    ..PointColumns::default()
                };
                (self.list).insert_points(cloud.datum_m, &cloud.offsets_m, columns)
            }
        };
        self.counts.add(&report);
        self.last_stamp_ns = cloud.stamp_ns;
        if ages {
            self.forget_old();
        }
        if let Some(viewpoints) = viewpoints {
            self.add_rays(&cloud, &viewpoints);
        }
        Ok(())
    }

    /// Labels of the points, empty for a cloud without them; `None` if labels are not kept.
    fn labels_of(&mut self, message: &PointCloud2) -> Result<Option<Vec<u16>>, CloudRefusal> {
        let (Some(options), None) = (&self.options.labels, &self.occupancy) else {
            return Ok(None);
        };
        let most = self.options.max_cloud_points;
        let labels = semantic::labels_from_message(message, most, options)
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.counts.clouds_unlabelled += u64::from(labels.is_none());
        Ok(Some(labels.unwrap_or_default()))
    }

    /// Colours of the points; `None` if they are not kept or the cloud has none.
    fn colors_of(
        &mut self,
        message: &PointCloud2,
        limits: &CloudLimits,
    ) -> Result<Option<Vec<Option<[u8; 3]>>>, CloudRefusal> {
        if !self.list.payload().color {
            return Ok(None);
        }
        let colors = point_colors::colors_from_message(message, limits)
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.counts.clouds_uncolored += u64::from(colors.is_none());
        Ok(colors)
    }

    /// Viewpoint of each point; `None` if free space is off or the cloud has none.
    fn viewpoints_of(
        &mut self,
        message: &PointCloud2,
        limits: &CloudLimits,
    ) -> Result<Option<Vec<Vector3<f64>>>, CloudRefusal> {
        if self.free_space.is_none() {
            return Ok(None);
        }
        let viewpoints = viewpoint::viewpoints_from_message(message, limits)
            .inspect_err(|_| self.counts.clouds_malformed += 1)?;
        self.counts.clouds_no_viewpoint += u64::from(viewpoints.is_none());
        Ok(viewpoints)
    }

    /// Clears along the rays of the sweep.
    fn clear_rays(&mut self) {
        if let Some(free_space) = &mut self.free_space {
            let report = match &mut self.occupancy {
                Some(occupancy) => free_space.clear(occupancy),
                None => free_space.clear(&mut self.list),
            };
            self.counts.add_rays(&report);
        }
    }

    fn add_rays(&mut self, cloud: &Cloud, viewpoints: &[Vector3<f64>]) {
        let Some(free_space) = &mut self.free_space else {
            return;
        };
        match &self.occupancy {
            Some(occupancy) => free_space.add(occupancy, cloud, viewpoints),
            None => free_space.add(&self.list, cloud, viewpoints),
        }
        if free_space.is_cloud_by_cloud() {
            self.clear_rays();
        }
    }

    /// Removes expired voxels, each time a sixteenth of their age limit has passed.
    fn forget_old(&mut self) {
        let (age, now) = (self.options.forget_after_ns, self.last_stamp_ns);
        // Time goes back when a log is replayed.
        if age == 0 || now.abs_diff(self.forgot_at_ns) < age.unsigned_abs() / 16 {
            return;
        }
        self.forgot_at_ns = now;
        let forgotten = self.list.forget_before(now.saturating_sub(age));
        self.counts.voxels_forgotten += forgotten.unwrap_or(0) as u64;
    }
}
