//! Images that wait for those of the same time.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::sensor_msgs::Image;

use crate::camera::LabelSet;

/// A step back of a stream's stamps by more than this is a log that loops.
const JUMP_BACK_NS: i64 = 1_000_000_000;

/// A topic of images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Depth images, whose stamps the clouds have.
    Depth,
    /// Label images, of the stamp nearest to a depth image's.
    Labels,
    /// Confidences, of exactly the stamp of a label image.
    Confidence,
    /// Images of colours, of exactly the stamp of a label image.
    Color,
}

impl Stream {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Depth, Self::Labels, Self::Confidence, Self::Color];

    /// Name under which it is counted.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Labels => "labels",
            Self::Confidence => "confidence",
            Self::Color => "color",
        }
    }
}

/// Rules by which images belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairOptions {
    /// Most images of a topic that wait; the oldest goes.
    pub queue_size: usize,
    /// Largest difference between the stamps of depth and labels; 0: they must be equal.
    pub max_difference_ns: u64,
    /// True if labels come with confidences.
    pub with_confidence: bool,
    /// True if labels come with colours.
    pub with_color: bool,
}

/// Images of one time.
#[derive(Debug)]
pub struct Set {
    /// Depth image.
    pub depth: Arc<Image>,
    /// Label image with what is asked for beside it.
    pub labels: LabelSet,
}

/// Reason for which an image left without its partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Left {
    /// Others of its topic needed its place.
    NoPartner,
    /// There was one of its stamp.
    Repeated,
    /// It waited when the stamps jumped back.
    TimeJump,
}

/// Images of each topic by stamp, at most `queue_size` of each.
///
/// Depth and labels belong together if each is the nearest to the other; unless their stamps are equal
/// this is known once each topic has come to the stamp of the other. Every image is used once.
#[derive(Debug)]
pub struct Waiting {
    options: PairOptions,
    queues: [BTreeMap<i64, LabelSet>; 4],
    newest_ns: [Option<i64>; 4],
    /// Stamp of the image that a network labels: the depth image that is nearest does not go.
    held_ns: Option<i64>,
}

impl Waiting {
    /// No images.
    pub fn new(options: PairOptions) -> Self {
        Self {
            options,
            queues: Default::default(),
            newest_ns: [None; 4],
            held_ns: None,
        }
    }

    /// Hears that labels of a stamp are being made: the depth image of that time waits for them, however many
    /// come meanwhile, and no labels of earlier stamps will come.
    pub fn hold(&mut self, stamp_ns: i64) -> Vec<(Stream, Left)> {
        let left = self.come_to(Stream::Labels, stamp_ns);
        self.held_ns = Some(stamp_ns);
        left
    }

    /// Notes the stamp of what comes; where it lies far behind, all that waits leaves.
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

    /// Goes on by other rules.
    pub fn set_options(&mut self, options: PairOptions) {
        self.options = options;
    }

    /// Adds an image, and tells of those that leave for it.
    pub fn push(&mut self, stream: Stream, image: Arc<Image>) -> Vec<(Stream, Left)> {
        self.push_set(stream, LabelSet::new(image))
    }

    /// Adds labels with what came with them.
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

    /// Takes the oldest images that belong together; at the end of the input (`is_end`) no others are
    /// waited for.
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

    /// Stamp of the labels that belong to a depth image, once that is sure.
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

    /// Forgets all images, and tells of them.
    pub fn clear(&mut self, reason: Left) -> Vec<(Stream, Left)> {
        let mut left = Vec::new();
        for stream in Stream::ALL {
            let queue = std::mem::take(&mut self.queues[stream as usize]);
            left.extend(queue.iter().map(|_| (stream, reason)));
        }
        left
    }

    /// Images that wait.
    pub fn len(&self) -> usize {
        self.queues.iter().map(BTreeMap::len).sum()
    }
}

/// The stamp in a queue that is nearest, of two the older.
fn nearest<T>(queue: &BTreeMap<i64, T>, stamp_ns: i64) -> Option<i64> {
    let before = queue.range(..=stamp_ns).next_back();
    let after = queue.range(stamp_ns..).next();
    let both = before.into_iter().chain(after).map(|(at_ns, _)| *at_ns);
    both.min_by_key(|at_ns| at_ns.abs_diff(stamp_ns))
}
