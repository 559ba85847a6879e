//! Classes that segmenters confuse.

use std::collections::BTreeMap;

use lattice_core::registration::UNLABELED;

use super::one_of;
use crate::simulate::house::House;
use crate::simulate::random::Stream;

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

/// Classes that others are mistaken for.
pub(super) struct Confusion {
    /// Plausible other classes of each class.
    others: BTreeMap<u16, Vec<u16>>,
    /// The one that each class is always taken for.
    usual: BTreeMap<u16, u16>,
    /// All classes of the house.
    pub(super) known: Vec<u16>,
}

impl Confusion {
    pub(super) fn new(house: &House, stream: &mut Stream) -> Confusion {
        let mut known: Vec<u16> = house.regions().iter().map(|region| region.label).collect();
        known.extend(house.class_names().keys());
        known.sort_unstable();
        known.dedup();
        known.retain(|class| *class != UNLABELED);
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
        let others: BTreeMap<u16, Vec<u16>> = known.iter().map(|c| (*c, plausible(c))).collect();
        let usual = others
            .iter()
            .map(|(class, others)| (*class, one_of(others, *class, stream)));
        Confusion {
            usual: usual.collect(),
            others,
            known,
        }
    }

    /// The class that another is always taken for.
    pub(super) fn usual(&self, class: u16) -> u16 {
        self.usual.get(&class).copied().unwrap_or(class)
    }

    /// A plausible other class.
    pub(super) fn any(&self, class: u16, stream: &mut Stream) -> u16 {
        let others = self.others.get(&class).map(Vec::as_slice);
        one_of(others.unwrap_or_default(), class, stream)
    }
}
