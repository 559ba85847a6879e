//! Clouds that poses and mounts cover, moved to the map.

use std::sync::Arc;

use lattice_core::cloud::{CloudLimits, RangeLimits, RecordFormat, transform_records};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::Isometry3;

use super::drops::Drop;
use super::state::{EnuOutput, EnuTransformer};
use super::waiting::WaitingCloud;
use crate::convert::cloud;

impl EnuTransformer {
    /// Transforms a cloud that poses and mounts cover.
    pub(super) fn place(&mut self, cloud: &WaitingCloud, out: &mut Vec<EnuOutput>) {
        #[cfg(feature = "bags")]
        if let Some(mut samples) = self.samples.take() {
            match self.sample(cloud, &mut samples) {
                Ok(()) => self.counts.clouds_out += 1,
                Err(reason) => self.drop_cloud(&cloud.topic, &reason),
            }
            self.samples = Some(samples);
            return;
        }
        match self.transform(cloud) {
            Ok(points) => {
                self.counts.clouds_out += 1;
                out.push(EnuOutput::Points(Arc::new(points)));
            }
            Err(reason) => self.drop_cloud(&cloud.topic, &reason),
        }
    }

    fn transform(&mut self, waiting: &WaitingCloud) -> Result<PointCloud2, Drop> {
        let message = &waiting.message;
        let layout = cloud::layout_of(message);
        let limits = CloudLimits {
            max_points: self.options.max_cloud_points,
        };
        let view = layout
            .view(&message.data, &limits)
            .map_err(Drop::Malformed)?;
        let map_from_sensor = |stamp_ns: i64| -> Result<Isometry3<f64>, Drop> {
            if waiting.frame == self.options.map_frame {
                return Ok(Isometry3::identity());
            }
            let map_from_base = self.map_from_base(stamp_ns).map_err(Drop::PoseGap)?;
            let mount = self.mount(&waiting.frame, stamp_ns);
            Ok(map_from_base * mount.map_err(|miss| Drop::no_mount(&waiting.frame, miss))?)
        };
        let range = RangeLimits {
            min_range_m: self.options.min_range_m,
            max_range_m: self.options.max_range_m,
        };
        let format = RecordFormat::new(
            &view,
            &self.options.pass_fields,
            self.options.precision,
            self.options.viewpoints,
        );
        let times = waiting.times.as_deref();
        let moved = transform_records(
            &view,
            waiting.stamp_ns,
            times,
            &range,
            &format,
            map_from_sensor,
        )?;
        let mut header = message.header.clone();
        header.stamp = Time::from_ns(waiting.stamp_ns);
        header.frame_id.clone_from(&self.options.map_frame);
        let (fields, point_step) = format.fields(moved.precision);
        let fields = cloud::message_fields(fields);
        self.counts.points_in += view.len() as u64;
        self.counts.points_out += moved.points as u64;
        self.counts.points_not_finite += moved.not_finite as u64;
        self.counts.points_out_of_range += moved.out_of_range as u64;
        self.counts.points_no_time += moved.no_time as u64;
        let point_step = u32::try_from(point_step).unwrap_or(u32::MAX);
        Ok(cloud::dense_cloud(
            header,
            fields,
            point_step,
            moved.points,
            moved.data,
        ))
    }
}
