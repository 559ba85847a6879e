//! Queue of label images that wait for their pose.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::sensor_msgs::Image;

use crate::camera::LabelSet;

/// Image topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadsetStream {
    /// Label images, whose stamps are those of the clouds.
    Labels,
    /// Confidence images, matched by the stamp of a label image.
    Confidence,
}

impl HeadsetStream {
    /// Counter name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Labels => "labels",
            Self::Confidence => "confidence",
        }
    }
}

/// Bounded queue of images of each topic by stamp.
#[derive(Default)]
pub(super) struct Waiting {
    queues: [BTreeMap<i64, Arrived>; 2],
    arrivals: u64,
}

/// An image with its arrival number.
struct Arrived {
    number: u64,
    set: LabelSet,
}

impl Waiting {
    /// Adds an image; returns the numbers of images of its topic dropped for it: one of its stamp, and the oldest. Age is
    /// by arrival, since stamps may be of a clock that was ahead.
    pub fn push(
        &mut self,
        stream: HeadsetStream,
        image: Arc<Image>,
        queue_size: usize,
    ) -> [u64; 2] {
        self.push_set(stream, LabelSet::new(image), queue_size)
    }

    /// Adds labels with companion images, with the same result.
    pub fn push_labels(&mut self, labels: LabelSet, queue_size: usize) -> [u64; 2] {
        self.push_set(HeadsetStream::Labels, labels, queue_size)
    }

    fn push_set(&mut self, stream: HeadsetStream, set: LabelSet, queue_size: usize) -> [u64; 2] {
        let stamp_ns = set.labels.header.stamp.to_ns();
        self.arrivals += 1;
        let number = self.arrivals;
        let queue = &mut self.queues[stream as usize];
        let repeated = queue.insert(stamp_ns, Arrived { number, set }).is_some();
        let mut gone = 0;
        while queue.len() > queue_size.max(1) {
            let first = queue.iter().min_by_key(|(_, image)| image.number);
            let Some(first_ns) = first.map(|(stamp_ns, _)| *stamp_ns) else {
                break;
            };
            queue.remove(&first_ns);
            gone += 1;
        }
        [u64::from(repeated), gone]
    }

    /// Stamps and camera frames of labels that wait for at most a pose.
    pub fn ready(&self, with_confidence: bool) -> Vec<(i64, String)> {
        let [labels, confidences] = &self.queues;
        let is_whole = |stamp_ns: &i64| !with_confidence || confidences.contains_key(stamp_ns);
        let ready = labels.iter().filter(|(stamp_ns, _)| is_whole(stamp_ns));
        let frame = |image: &Arrived| image.set.labels.header.frame_id.clone();
        ready.map(|(at, image)| (*at, frame(image))).collect()
    }

    /// Removes the images of a stamp.
    pub fn take(&mut self, stamp_ns: i64) -> Option<LabelSet> {
        let [labels, confidences] = &mut self.queues;
        let mut set = labels.remove(&stamp_ns)?.set;
        if let Some(confidence) = confidences.remove(&stamp_ns) {
            set.confidence = Some(confidence.set.labels);
        }
        Some(set)
    }

    /// Drops all images; returns the numbers of labels and confidences.
    pub fn clear(&mut self) -> [u64; 2] {
        std::mem::take(&mut self.queues).map(|queue| queue.len() as u64)
    }

    /// Number of queued images.
    pub fn len(&self) -> usize {
        self.queues.iter().map(BTreeMap::len).sum()
    }
}
