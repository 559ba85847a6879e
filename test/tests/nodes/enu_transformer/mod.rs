//! The transformer's logic: waiting, dropping by reason, deskew, and hostile input.

mod clouds;
mod frames;
mod inertial;
mod ins;
mod transforms;

use std::sync::Arc;

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::transform_stamped;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_test::clouds::{SECOND_NS, cloud, odometry};
use nalgebra::Isometry3;

/// Time of the first pose.
pub const START_NS: i64 = 1_700_000_000 * SECOND_NS;
const STEP_NS: i64 = SECOND_NS / 100;

struct Bench {
    machine: EnuTransformer,
    clouds: Vec<Arc<PointCloud2>>,
    transforms: Vec<TransformStamped>,
}

impl Bench {
    fn new(options: TransformerOptions) -> Self {
        Self {
            machine: EnuTransformer::new(options),
            clouds: Vec::new(),
            transforms: Vec::new(),
        }
    }

    fn odometry() -> Self {
        Self::new(TransformerOptions::new(InsSource::Odometry))
    }

    fn take(&mut self, outputs: Vec<EnuOutput>) {
        for output in outputs {
            match output {
                EnuOutput::Points(points) => self.clouds.push(points),
                EnuOutput::Transform(transform) => self.transforms.push(transform),
                EnuOutput::StaticTransform(_) | EnuOutput::Origin(_) => {}
            }
        }
    }

    /// A pose received at its own time.
    fn pose(&mut self, message: &Odometry) {
        let now_ns = message.header.stamp.to_ns();
        self.ins(InsMessage::Odometry(message), now_ns);
    }

    /// Poses of a machine that drives east at 1 m/s, from `from` steps to `to` steps.
    fn drive(&mut self, from: i64, to: i64) {
        for step in from..to {
            self.pose(&odometry(START_NS + step * STEP_NS, &driven(step)));
        }
    }

    /// Any message of an INS.
    fn ins(&mut self, message: InsMessage, now_ns: i64) {
        let outputs = self.machine.on_ins("ins", message, now_ns);
        self.take(outputs);
    }

    fn tf(&mut self, parent: &str, child: &str, step: i64, pose: &Isometry3<f64>, is_static: bool) {
        let stamp_ns = START_NS + step * STEP_NS;
        let transforms = vec![transform_stamped(parent, child, stamp_ns, pose)];
        let message = TFMessage { transforms };
        let outputs = self.machine.on_tf(&message, is_static, stamp_ns);
        self.take(outputs);
    }

    fn tick(&mut self, now_ns: i64) {
        let outputs = self.machine.tick(now_ns);
        self.take(outputs);
    }

    fn cloud(&mut self, message: PointCloud2, now_ns: i64) {
        let outputs = self.machine.on_cloud("points", Arc::new(message), now_ns);
        self.take(outputs);
    }
}

fn driven(step: i64) -> Isometry3<f64> {
    Isometry3::translation(step as f64 * 0.01, 0.0, 0.0)
}

fn base_cloud(stamp_ns: i64) -> PointCloud2 {
    cloud("base_link", stamp_ns, &[[1.0, 2.0, 3.0]])
}
