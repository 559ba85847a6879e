//! How wrong the labels of the two devices are (semantic_icp section 5, track B).

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::regions::{NO_REGION, Region};
use super::{HeadsetTrial, House, HouseError};
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use lattice_core::registration::{LabelDistribution, SemanticCloud, UNLABELED};

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

/// Shares of overlapping points with the same class, by class: road, building, car, vegetation,
/// sidewalk, fence, pole and other ground of SemanticKITTI, one network on scans 20 m apart.
pub const MEASURED_AGREEMENTS: [f64; 8] = [0.89, 0.87, 0.89, 0.88, 0.76, 0.73, 0.71, 0.37];

/// More of the picture than asked for may be flipped by this, so that large regions get their turn.
const OVERSHOOT: f64 = 0.04;

/// Which device has the wrong label of a flipped region.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum FlipSide {
    /// The one or the other, half of the picture each.
    #[default]
    Either,
    /// The robot's map.
    Map,
    /// The headset.
    Headset,
    /// Both, each with a wrong class of its own; with `consistent` both the same.
    Both,
}

/// How labels are wrong.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LabelModel {
    /// Share q of regions that are labelled wrongly as a whole, 0 to 1. Of what the headset sees it
    /// is the share of pixels, met as nearly as whole regions allow; elsewhere the probability.
    pub region_flips: f64,
    /// Who is wrong.
    pub side: FlipSide,
    /// A class is always taken for the same other one, as two segmenters that call one thing by
    /// two names do; else each region gets a wrong class of its own.
    pub consistent: bool,
    /// Share of single points with a random class, 0 to 1.
    pub iid: f64,
    /// Weight that the wrong classes of [`LabelModel::consistent`] have in each label, 0 to 1: soft labels.
    pub softness: f64,
}

/// The labels of one device, region by region.
#[derive(Clone, PartialEq, Debug)]
pub struct RegionLabels {
    classes: Vec<u16>,
    /// A plausible other class of each region.
    others: Vec<u16>,
    /// All classes of the house.
    known: Vec<u16>,
    iid: f64,
    softness: f64,
    seed: u64,
}

/// One draw of a [`LabelModel`].
#[derive(Clone, PartialEq, Debug)]
pub struct LabelDraw {
    /// Labels of the robot's map.
    pub map: RegionLabels,
    /// Labels of the headset.
    pub headset: RegionLabels,
    /// Share of the headset's points in regions that were flipped on either device.
    pub flipped_share: f64,
    /// Share of the headset's points in regions with different labels in map and headset.
    pub different_share: f64,
}

impl LabelModel {
    /// Wrong whole regions alone.
    pub fn flips(region_flips: f64) -> LabelModel {
        LabelModel {
            region_flips,
            ..LabelModel::default()
        }
    }

    /// Draws the labels of both devices for a trial, by the seed alone.
    pub fn draw(
        &self,
        house: &House,
        trial: &HeadsetTrial,
        seed: u64,
    ) -> Result<LabelDraw, HouseError> {
        self.draw_all(house, std::slice::from_ref(trial), seed)
    }

    /// [`LabelModel::draw`] for one map and several trials, whose pictures count as one.
    pub fn draw_all(
        &self,
        house: &House,
        trials: &[HeadsetTrial],
        seed: u64,
    ) -> Result<LabelDraw, HouseError> {
        self.draw_by(house, trials, seed, LabelModel::flipped)
    }

    /// Labels as a real network disagrees with itself from two places: each class has one of
    /// [`MEASURED_AGREEMENTS`], is taken for the same other class, and
    /// its regions are wrong on the one or the other device.
    pub fn draw_measured(
        house: &House,
        trials: &[HeadsetTrial],
        seed: u64,
    ) -> Result<LabelDraw, HouseError> {
        let model = LabelModel {
            consistent: true,
            ..LabelModel::default()
        };
        model.draw_by(house, trials, seed, |_, _, stream| {
            let mut agreements: BTreeMap<u16, f64> = BTreeMap::new();
            for region in house.regions() {
                let drawn = || one_of_all(&MEASURED_AGREEMENTS, stream);
                agreements.entry(region.label).or_insert_with(drawn);
            }
            let flip = |region: &Region| {
                let agreement = agreements.get(&region.label).copied().unwrap_or(1.0);
                let (wrong, coin) = (stream.uniform() >= agreement, stream.uniform() < 0.5);
                [wrong && coin, wrong && !coin]
            };
            house.regions().iter().map(flip).collect()
        })
    }

    /// Draws with the regions that `flipped` says are wrong in map and headset, from the pixels of each.
    fn draw_by(
        &self,
        house: &House,
        trials: &[HeadsetTrial],
        seed: u64,
        flipped: impl FnOnce(&LabelModel, &[u64], &mut Stream) -> Vec<[bool; 2]>,
    ) -> Result<LabelDraw, HouseError> {
        within("region_flips", self.region_flips, 0.0, 1.0)?;
        within("iid", self.iid, 0.0, 1.0)?;
        within("softness", self.softness, 0.0, 1.0)?;
        let regions = house.regions();
        let mut stream = Stream::new(seed, Purpose::LabelFlips, 0, 0);
        let mut pixels = vec![0_u64; regions.len()];
        let headset_scans = trials.iter().flat_map(|trial| &trial.headset_scans);
        for region in headset_scans.flat_map(|headset_scan| &headset_scan.regions) {
            if let Some(pixels) = pixels.get_mut(usize::from(*region)) {
                *pixels += 1;
            }
        }
        let truth: Vec<u16> = regions.iter().map(|region| region.label).collect();
        let mut confusion = Confusion::new(house, &mut stream);
        let others: Vec<u16> = truth.iter().map(|class| confusion.usual(*class)).collect();
        let flipped = flipped(self, &pixels, &mut stream);
        let (mut map, mut headset) = (truth.clone(), truth);
        for (i, region) in regions.iter().enumerate() {
            let [in_map, in_headset] = flipped[i];
            let mut wrong = |stream: &mut Stream| match self.consistent {
                true => others[i],
                false => confusion.any(region, stream),
            };
            // Always drawn, so that a region's wrong class does not depend on the others.
            let wrong = [wrong(&mut stream), wrong(&mut stream)];
            if in_map {
                map[i] = wrong[0];
            }
            if in_headset {
                headset[i] = wrong[1];
            }
        }
        let seen: u64 = pixels.iter().sum();
        let share = |counts: &dyn Fn(usize) -> bool| {
            let of = pixels.iter().enumerate().filter(|(i, _)| counts(*i));
            of.map(|(_, pixels)| pixels).sum::<u64>() as f64 / seen.max(1) as f64
        };
        let flipped_share = share(&|i| flipped[i] != [false; 2]);
        let different_share = share(&|i| map[i] != headset[i]);
        let device = |classes, lane: u64| RegionLabels {
            classes,
            others: others.clone(),
            known: confusion.known.clone(),
            iid: self.iid,
            softness: self.softness,
            seed: seed.wrapping_mul(2).wrapping_add(lane),
        };
        Ok(LabelDraw {
            map: device(map, 0),
            headset: device(headset, 1),
            flipped_share,
            different_share,
        })
    }

    /// Which regions are wrong in map and headset.
    fn flipped(&self, pixels: &[u64], stream: &mut Stream) -> Vec<[bool; 2]> {
        let mut flipped = vec![[false; 2]; pixels.len()];
        let mut order: Vec<usize> = (0..pixels.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, (stream.uniform() * (i + 1) as f64) as usize);
        }
        let all = pixels.iter().sum::<u64>() as f64;
        let (goal, most) = (
            self.region_flips * all,
            (self.region_flips + OVERSHOOT) * all,
        );
        let mut left = all;
        // Pixels of the wrong regions, and of those in the map and in the headset.
        let (mut wrong, mut of) = (0.0, [0.0; 2]);
        for i in order {
            let size = pixels[i] as f64;
            let [chance, coin] = [stream.uniform(), stream.uniform()];
            let flip = match pixels[i] {
                0 => chance < self.region_flips,
                _ if self.region_flips == 0.0 => false,
                _ if wrong + size <= most => true,
                // Too large, but without it there would be too few: whichever is nearer.
                _ => wrong + size - goal < goal - wrong - (left - size),
            };
            left -= size;
            if !flip {
                continue;
            }
            wrong += size;
            let first_in_map = of[0] < of[1] || (of[0] == of[1] && coin < 0.5);
            flipped[i] = match self.side {
                FlipSide::Map => [true, false],
                FlipSide::Headset => [false, true],
                FlipSide::Both => [true, true],
                FlipSide::Either if size == 0.0 => [coin < 0.5, coin >= 0.5],
                FlipSide::Either => [first_in_map, !first_in_map],
            };
            for (sum, wrong) in of.iter_mut().zip(flipped[i]) {
                *sum += if wrong { size } else { 0.0 };
            }
        }
        flipped
    }
}

/// What classes are taken for.
struct Confusion {
    /// Plausible other classes of each class.
    others: BTreeMap<u16, Vec<u16>>,
    usual: BTreeMap<u16, u16>,
    known: Vec<u16>,
}

impl Confusion {
    fn new(house: &House, stream: &mut Stream) -> Confusion {
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
    fn usual(&mut self, class: u16) -> u16 {
        self.usual.get(&class).copied().unwrap_or(class)
    }

    fn any(&mut self, region: &Region, stream: &mut Stream) -> u16 {
        let others = self.others.get(&region.label).map(Vec::as_slice);
        one_of(others.unwrap_or_default(), region.label, stream)
    }
}

fn one_of_all(shares: &[f64], stream: &mut Stream) -> f64 {
    let choice = (stream.uniform() * shares.len() as f64) as usize;
    shares.get(choice).copied().unwrap_or(1.0)
}

fn one_of(classes: &[u16], or: u16, stream: &mut Stream) -> u16 {
    let choice = (stream.uniform() * classes.len() as f64) as usize;
    classes.get(choice).copied().unwrap_or(or)
}

impl RegionLabels {
    /// The true labels.
    pub fn truth(house: &House) -> RegionLabels {
        RegionLabels {
            classes: house.regions().iter().map(|region| region.label).collect(),
            others: Vec::new(),
            known: Vec::new(),
            iid: 0.0,
            softness: 0.0,
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
    pub(super) fn draws(&self, lane: u64) -> Draws<'_> {
        Draws {
            labels: self,
            stream: Stream::new(self.seed, Purpose::PointFlips, 0, lane),
        }
    }
}

/// The labels of one point after the other.
pub(super) struct Draws<'a> {
    labels: &'a RegionLabels,
    stream: Stream,
}

impl Draws<'_> {
    /// The label of the next point.
    pub(super) fn class(&mut self, region: u16) -> u16 {
        let labels = self.labels;
        if labels.iid > 0.0 && region != NO_REGION && self.stream.uniform() < labels.iid {
            return one_of(&labels.known, UNLABELED, &mut self.stream);
        }
        labels.class(region)
    }

    /// The labels of points of some regions, counted.
    pub(super) fn of_counts(&mut self, regions: &[(u16, u32)]) -> LabelDistribution {
        let mut counts: Vec<(u16, f32)> = Vec::with_capacity(regions.len() + 2);
        let mut add =
            |class: u16, weight: f32| match counts.iter_mut().find(|(known, _)| *known == class) {
                Some((_, sum)) => *sum += weight,
                None => counts.push((class, weight)),
            };
        let softness = self.labels.softness as f32;
        for &(region, count) in regions {
            let (bulk, single) = match self.labels.iid > 0.0 {
                true => (0, count),
                false => (count, 0),
            };
            let mut put = |class: u16, weight: f32| {
                let other = self.labels.others.get(usize::from(region)).copied();
                match other.filter(|_| softness > 0.0) {
                    Some(other) => {
                        add(class, weight * (1.0 - softness));
                        add(other, weight * softness);
                    }
                    None => add(class, weight),
                }
            };
            if bulk > 0 {
                put(self.labels.class(region), bulk as f32);
            }
            for _ in 0..single {
                let labels = self.labels;
                let random = region != NO_REGION && self.stream.uniform() < labels.iid;
                let class = match random {
                    true => one_of(&labels.known, UNLABELED, &mut self.stream),
                    false => labels.class(region),
                };
                put(class, 1.0);
            }
        }
        counts.sort_by_key(|(class, _)| *class);
        LabelDistribution::from_weights(counts)
    }
}
