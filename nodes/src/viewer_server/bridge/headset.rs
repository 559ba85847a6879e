//! Headset topics that clients may publish on: a fixed table.

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image, PointCloud2};
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_msgs::visualization_msgs::Marker;
use lattice_msgs::{RosMessage, cdr, std_msgs};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, PublishError, Publisher, RuntimeError};

use super::mesh_chunks::in_chunks;
use crate::viewer_server::session::{Input, InputRefusal, OpenTopic};

/// Decodes and publishes a message.
type Pass = Box<dyn Fn(&Input) -> Result<(), InputRefusal> + Send>;

/// Publishers of the headset topics.
#[derive(Default)]
pub struct HeadsetTopics {
    /// Index of the first one in the offer.
    first: usize,
    passes: Vec<Pass>,
}

impl HeadsetTopics {
    /// Adds the topics with a limit of message size to the open topics.
    pub fn new(
        node: &Node,
        max_bytes: usize,
        open: &mut Vec<OpenTopic>,
    ) -> Result<Self, RuntimeError> {
        let first = open.len();
        let mut table = Table {
            node,
            max_bytes,
            open,
            passes: Vec::new(),
        };
        let mesh = node.publisher::<HeadsetMesh>("headset/mesh", Qos::reliable(1000))?;
        table.pass::<HeadsetMesh>("headset/mesh", move |message| {
            in_chunks(message)?
                .into_iter()
                .try_for_each(|chunk| sent(mesh.publish(chunk)))
        })?;
        table.add::<Marker>("headset/mesh_marker", Qos::reliable(1000))?;
        table.add::<Image>("headset/image", Qos::SENSOR)?;
        table.add::<CompressedImage>("headset/image/compressed", Qos::SENSOR)?;
        table.add::<Image>("headset/labels/image", Qos::SENSOR)?;
        table.add::<Image>("headset/labels/confidence", Qos::SENSOR)?;
        table.add::<LabelInfo>("headset/labels/label_info", Qos::LATCHED)?;
        table.add::<CameraInfo>("headset/camera_info", Qos::SENSOR)?;
        table.add::<PoseStamped>("headset/pose", Qos::INS)?;
        table.add::<PointCloud2>("headset/points", Qos::SCANS)?;
        table.add::<LabelInfo>("headset/label_info", Qos::LATCHED)?;
        table.add::<std_msgs::String>("headset/session", Qos::LATCHED)?;
        let passes = table.passes;
        Ok(Self { first, passes })
    }

    /// Decodes a message and publishes it on its topic.
    pub fn publish(&self, input: &Input) -> Result<(), InputRefusal> {
        let pass = input.topic.checked_sub(self.first);
        let pass = pass.and_then(|number| self.passes.get(number));
        pass.map_or(Err(InputRefusal::Malformed), |pass| pass(input))
    }
}

/// Table under construction.
struct Table<'a> {
    node: &'a Node,
    max_bytes: usize,
    open: &'a mut Vec<OpenTopic>,
    passes: Vec<Pass>,
}

impl Table<'_> {
    fn add<M: RosMessage>(&mut self, topic: &str, qos: Qos) -> Result<(), RuntimeError> {
        let publisher: Publisher<M> = self.node.publisher(topic, qos)?;
        self.pass::<M>(topic, move |message| sent(publisher.publish(message)))
    }

    fn pass<M: RosMessage>(
        &mut self,
        topic: &str,
        publish: impl Fn(M) -> Result<(), InputRefusal> + Send + 'static,
    ) -> Result<(), RuntimeError> {
        self.open.push(OpenTopic {
            name: self.node.resolve(topic)?,
            type_name: M::TYPE,
            stream_bytes: Some(self.max_bytes),
        });
        self.passes.push(Box::new(move |input| {
            let message = match input.is_json {
                true => serde_json::from_slice(&input.bytes).ok(),
                false => cdr::from_slice(&input.bytes).ok(),
            };
            publish(message.ok_or(InputRefusal::Malformed)?)
        }));
        Ok(())
    }
}

fn sent(published: Result<(), PublishError>) -> Result<(), InputRefusal> {
    published.map_err(|error| {
        log::debug!("headset message not published: {error}");
        InputRefusal::NotSent
    })
}
