//! Classes that segmenters confuse.

use crate::simulate::house::House;
use crate::simulate::random::Stream;
use lattice_core::registration::UNLABELED;
use std::collections::{BTreeMap, BTreeSet};

/// Classes that segmenters take for each other, the most usual first.
const CONFUSIONS: [(&str, &[&str]); 18] = [
    ("wall", &["door", "window", "cabinet", "curtain"]),
    ("floor", &["other", "table", "bed"]),
    ("ceiling", &["wall", "other"]),
    ("tv", &["picture", "window", "cabinet"]),
    ("cabinet", &["bookshelf", "counter", "desk", "fridge"]),
    ("desk", &["table", "counter", "cabinet"]),
    ("table", &["desk", "counter", "cabinet"]),
    ("chair", &["sofa", "table", "other"]),
    ("sofa", &["bed", "chair", "cabinet"]),
    ("bookshelf", &["cabinet", "door", "wall", "fridge"]),
    ("counter", &["cabinet", "table", "desk"]),
    ("fridge", &["cabinet", "door", "bookshelf"]),
    ("bed", &["sofa", "table", "other"]),
    ("door", &["wall", "cabinet", "curtain"]),
    ("window", &["picture", "tv", "curtain", "door"]),
    ("curtain", &["window", "wall", "door"]),
    ("picture", &["window", "tv", "wall"]),
    ("other", &["chair", "table", "cabinet", "picture"]),
];

/// Plausible other classes of each class of a house.
pub(super) struct Confusion(BTreeMap<u16, Vec<u16>>);

impl Confusion {
    pub(super) fn new(house: &House) -> Confusion {
        let mut known: BTreeSet<u16> = house.regions().iter().map(|r| r.label).collect();
        known.extend(house.class_names().keys());
        known.remove(&UNLABELED);
        let plausible = |class: &u16| {
            let name = house.class_names().get(class);
            let row = name.and_then(|name| CONFUSIONS.iter().find(|(of, _)| of == name));
            let others = row.map(|(_, others)| others.iter().filter_map(|n| house.class(n)));
            let others: Vec<u16> = others.map(Iterator::collect).unwrap_or_default();
            match others.is_empty() {
                true => known
                    .iter()
                    .copied()
                    .filter(|other| other != class)
                    .collect(),
                false => others,
            }
        };
        Confusion(known.iter().map(|c| (*c, plausible(c))).collect())
    }

    /// Number of classes.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// A plausible other class, or the class itself if there is none.
    pub(super) fn any(&self, class: u16, stream: &mut Stream) -> u16 {
        let others = self.0.get(&class).map_or(&[][..], Vec::as_slice);
        let choice = (stream.uniform() * others.len() as f64) as usize;
        others.get(choice).copied().unwrap_or(class)
    }
}
