//! Queue of images that wait for those of the same stamp.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::sensor_msgs::Image;

use crate::camera::LabelSet;

/// Backward step of a stream's stamps that counts as a looping log.
const JUMP_BACK_NS: i64 = 1_000_000_000;

/// Image topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Depth images, whose stamps are those of the clouds.
    Depth,
    /// Label images, matched to the nearest depth stamp.
    Labels,
    /// Confidence images, matched by the stamp of a label image.
    Confidence,
    /// Colour images, matched by the stamp of a label image.
    Color,
}

impl Stream {
    /// All topics, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Depth, Self::Labels, Self::Confidence, Self::Color];

    /// Counter name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Labels => "labels",
            Self::Confidence => "confidence",
            Self::Color => "color",
        }
    }
}

/// Matching rules of images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairOptions {
    /// Queue length per topic; the oldest image is dropped.
    pub queue_size: usize,
    /// Largest difference between depth and label stamps; 0: they must be equal.
    pub max_difference_ns: u64,
    /// True if labels come with confidences.
    pub with_confidence: bool,
    /// True if labels come with colours.
    pub with_color: bool,
}

/// Matched images.
#[derive(Debug)]
pub struct Set {
    /// Depth image.
    pub depth: Arc<Image>,
    /// Label image with its companion images.
    pub labels: LabelSet,
}

/// Reason for dropping an image without a match.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Left {
    /// The queue was full.
    NoPartner,
    /// Duplicate stamp.
    Repeated,
    /// Queued when the stamps jumped back.
    TimeJump,
}

/// Images of each topic by stamp, at most `queue_size` each.
///
/// Depth and labels match if each is the nearest to the other. Unless their stamps are equal,
/// this is decided once each topic has reached the stamp of the other. Every image is used once.
#[derive(Debug)]
pub struct Waiting {
    options: PairOptions,
    queues: [BTreeMap<i64, LabelSet>; 4],
    newest_ns: [Option<i64>; 4],
    /// Stamp of the image in the network: the nearest depth image is kept.
    held_ns: Option<i64>,
}

impl Waiting {
    /// Empty queue.
    pub fn new(options: PairOptions) -> Self {
        Self {
            options,
            queues: Default::default(),
            newest_ns: [None; 4],
            held_ns: None,
        }
    }

    /// Notes that labels of a stamp are being computed: the depth image of that stamp is kept regardless of the queue
    /// length, and no earlier labels will arrive.
    pub fn hold(&mut self, stamp_ns: i64) -> Vec<(Stream, Left)> {
        let left = self.come_to(Stream::Labels, stamp_ns);
        self.held_ns = Some(stamp_ns);
        left
    }

    /// Handles the stamp of an image; a large backward step drops all queued images.
    fn come_to(&mut self, stream: Stream, stamp_ns: i64) -> Vec<(Stream, Left)> {
        let mut left = Vec::new();
        let newest_ns = self.newest_ns[stream as usize].unwrap_or(stamp_ns);
        if stamp_ns < newest_ns.saturating_sub(JUMP_BACK_NS) {
            left = self.clear(Left::TimeJump);
            (self.newest_ns, self.held_ns) = ([None; 4], None);
        }
        let newest = &mut self.newest_ns[stream as usize];
        *newest = Some(newest.map_or(stamp_ns, |newest_ns| newest_ns.max(stamp_ns)));
        left
    }

    /// Changes the rules.
    pub fn set_options(&mut self, options: PairOptions) {
        self.options = options;
    }

    /// Adds an image; returns the images dropped for it.
    pub fn push(&mut self, stream: Stream, image: Arc<Image>) -> Vec<(Stream, Left)> {
        self.push_set(stream, LabelSet::new(image))
    }

    /// Adds labels with companion images.
    pub fn push_labels(&mut self, labels: LabelSet) -> Vec<(Stream, Left)> {
        self.push_set(Stream::Labels, labels)
    }

    fn push_set(&mut self, stream: Stream, set: LabelSet) -> Vec<(Stream, Left)> {
        let stamp_ns = set.labels.header.stamp.to_ns();
        let mut left = self.come_to(stream, stamp_ns);
        let queue = &mut self.queues[stream as usize];
        if queue.insert(stamp_ns, set).is_some() {
            left.push((stream, Left::Repeated));
        }
        let held_ns = self.held_ns.filter(|_| stream == Stream::Depth);
        let held_ns = held_ns.and_then(|held_ns| nearest(queue, held_ns));
        while queue.len() > self.options.queue_size.max(1) {
            let oldest = queue.keys().find(|stamp_ns| Some(**stamp_ns) != held_ns);
            let Some(oldest) = oldest.copied() else { break };
            queue.remove(&oldest);
            left.push((stream, Left::NoPartner));
        }
        left
    }

    /// Removes the oldest matched images; at the end of the input (`is_end`) no further ones
    /// are expected.
    pub fn take(&mut self, is_end: bool) -> Option<Set> {
        let depths = self.queues[Stream::Depth as usize].keys();
        let found =
            depths.filter_map(|depth_ns| Some((*depth_ns, self.labels_of(*depth_ns, is_end)?)));
        let (depth_ns, labels_ns) = { found }.next()?;
        let [depths, labels, confidences, colors] = &mut self.queues;
        let mut labels = labels.remove(&labels_ns)?;
        let image = |set: LabelSet| set.labels;
        if let Some(confidence) = confidences.remove(&labels_ns) {
            labels.confidence = Some(image(confidence));
        }
        if let Some(colors) = colors.remove(&labels_ns) {
            labels.colors = Some(image(colors));
        }
        let depth = image(depths.remove(&depth_ns)?);
        Some(Set { depth, labels })
    }

    /// Stamp of the labels matched to a depth image, once decided.
    fn labels_of(&self, depth_ns: i64, is_end: bool) -> Option<i64> {
        let [depths, labels, confidences, colors] = &self.queues;
        let labels_ns = nearest(labels, depth_ns)?;
        let is_near = depth_ns.abs_diff(labels_ns) <= self.options.max_difference_ns;
        let is_whole = (!self.options.with_confidence || confidences.contains_key(&labels_ns))
            && (!self.options.with_color || colors.contains_key(&labels_ns));
        let has_come_to = |stream: Stream, stamp_ns| {
            self.newest_ns[stream as usize].is_some_and(|newest_ns| newest_ns >= stamp_ns)
        };
        let is_sure = is_end
            || depth_ns == labels_ns
            || (has_come_to(Stream::Depth, labels_ns) && has_come_to(Stream::Labels, depth_ns));
        let belong = is_near && is_whole && is_sure && nearest(depths, labels_ns) == Some(depth_ns);
        belong.then_some(labels_ns)
    }

    /// Drops and returns all images.
    pub fn clear(&mut self, reason: Left) -> Vec<(Stream, Left)> {
        let mut left = Vec::new();
        for stream in Stream::ALL {
            let queue = std::mem::take(&mut self.queues[stream as usize]);
            left.extend(queue.iter().map(|_| (stream, reason)));
        }
        left
    }

    /// Number of queued images.
    pub fn len(&self) -> usize {
        self.queues.iter().map(BTreeMap::len).sum()
    }
}

/// Nearest stamp in a queue, the older of two.
fn nearest<T>(queue: &BTreeMap<i64, T>, stamp_ns: i64) -> Option<i64> {
    let before = queue.range(..=stamp_ns).next_back();
    let after = queue.range(stamp_ns..).next();
    let both = before.into_iter().chain(after).map(|(at_ns, _)| *at_ns);
    both.min_by_key(|at_ns| at_ns.abs_diff(stamp_ns))
}
