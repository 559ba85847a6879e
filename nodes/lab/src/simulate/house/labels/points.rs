//! Labels of single points, from those of their regions.

use lattice_core::registration::{LabelDistribution, SemanticCloud, UNLABELED};
use nalgebra::Point3;

use super::one_of;
use crate::simulate::house::House;
use crate::simulate::house::regions::NO_REGION;
use crate::simulate::random::{Purpose, Stream};

/// The labels of one device, region by region.
#[derive(Clone, PartialEq, Debug)]
pub struct RegionLabels {
    pub(super) classes: Vec<u16>,
    /// All classes of the house.
    pub(super) known: Vec<u16>,
    pub(super) iid: f64,
    pub(super) seed: u64,
}

impl RegionLabels {
    /// The true labels.
    pub fn truth(house: &House) -> RegionLabels {
        RegionLabels {
            classes: house.regions().iter().map(|region| region.label).collect(),
            known: Vec::new(),
            iid: 0.0,
            seed: 0,
        }
    }

    /// The class that a region is labelled as; [`UNLABELED`] for no region.
    pub fn class(&self, region: u16) -> u16 {
        let class = self.classes.get(usize::from(region));
        class.copied().unwrap_or(UNLABELED)
    }

    /// Labelled points of points and their regions, in any frame; `lane` separates clouds.
    pub fn cloud(&self, points_m: &[Point3<f64>], regions: &[u16], lane: u64) -> SemanticCloud {
        let mut draws = self.draws(lane);
        let of = |region: &u16| draws.of_counts(&[(*region, 1)]);
        SemanticCloud {
            labels: regions.iter().map(of).collect(),
            points_m: points_m.to_vec(),
        }
    }

    /// Labels of points, one after the other.
    pub(in crate::simulate::house) fn draws(&self, lane: u64) -> Draws<'_> {
        Draws {
            labels: self,
            stream: Stream::new(self.seed, Purpose::PointFlips, 0, lane),
        }
    }
}

/// The labels of one point after the other.
pub(in crate::simulate::house) struct Draws<'a> {
    labels: &'a RegionLabels,
    stream: Stream,
}

impl Draws<'_> {
    /// The label of the next point.
    pub(in crate::simulate::house) fn class(&mut self, region: u16) -> u16 {
        let labels = self.labels;
        if labels.iid > 0.0 && region != NO_REGION && self.stream.uniform() < labels.iid {
            return one_of(&labels.known, UNLABELED, &mut self.stream);
        }
        labels.class(region)
    }

    /// The labels of points of some regions, counted.
    pub(in crate::simulate::house) fn of_counts(
        &mut self,
        regions: &[(u16, u32)],
    ) -> LabelDistribution {
        let mut counts: Vec<(u16, f32)> = Vec::with_capacity(regions.len() + 2);
        let mut add =
            |class: u16, weight: f32| match counts.iter_mut().find(|(known, _)| *known == class) {
                Some((_, sum)) => *sum += weight,
                None => counts.push((class, weight)),
            };
        for &(region, count) in regions {
            match self.labels.iid > 0.0 {
                false if count > 0 => add(self.labels.class(region), count as f32),
                false => {}
                true => (0..count).for_each(|_| add(self.class(region), 1.0)),
            }
        }
        counts.sort_by_key(|(class, _)| *class);
        LabelDistribution::from_weights(counts)
    }
}
