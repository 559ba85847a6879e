//! Models of wrong labels on the robot and on the headset (semantic_icp section 5, track B).

mod confusion;
mod flips;
mod points;

use super::{HeadsetTrial, House};
use crate::AnyError;
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use confusion::Confusion;
use flips::flipped;
pub use points::RegionLabels;

/// Device that has the wrong label of a flipped region.
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

/// Model of wrong labels.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LabelModel {
    /// Share q of regions that are labelled wrongly as a whole, 0 to 1. Of what the headset sees it
    /// is the share of pixels, met as nearly as whole regions allow; elsewhere the probability.
    pub region_flips: f64,
    /// Device that is wrong.
    pub side: FlipSide,
    /// A class is always taken for the same other one, as two segmenters that call one thing by
    /// two names do; else each region gets a wrong class of its own.
    pub consistent: bool,
    /// Share of single points with a random class, 0 to 1.
    pub iid: f64,
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
    /// Model of wrong whole regions alone.
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
    ) -> Result<LabelDraw, AnyError> {
        self.draw_all(house, std::slice::from_ref(trial), seed)
    }

    /// Draws the labels for one map and several trials, whose pictures count as one.
    pub fn draw_all(
        &self,
        house: &House,
        trials: &[HeadsetTrial],
        seed: u64,
    ) -> Result<LabelDraw, AnyError> {
        within("region_flips", self.region_flips, 0.0, 1.0)?;
        within("iid", self.iid, 0.0, 1.0)?;
        let regions = house.regions();
        let mut stream = Stream::new(seed, Purpose::LabelFlips, 0, 0);
        let pixels = pixels_of(regions.len(), trials);
        let truth: Vec<u16> = regions.iter().map(|region| region.label).collect();
        let confusion = Confusion::new(house, &mut stream);
        let flipped = flipped(self, &pixels, &mut stream);
        let (mut map, mut headset) = (truth.clone(), truth);
        for (i, region) in regions.iter().enumerate() {
            let [in_map, in_headset] = flipped[i];
            let wrong = |stream: &mut Stream| match self.consistent {
                true => confusion.usual(region.label),
                false => confusion.any(region.label, stream),
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
            known: confusion.known.clone(),
            iid: self.iid,
            seed: seed.wrapping_mul(2).wrapping_add(lane),
        };
        Ok(LabelDraw {
            map: device(map, 0),
            headset: device(headset, 1),
            flipped_share,
            different_share,
        })
    }
}

/// Pixels of each region in the pictures of some trials.
fn pixels_of(regions: usize, trials: &[HeadsetTrial]) -> Vec<u64> {
    let mut pixels = vec![0_u64; regions];
    let scans = trials.iter().flat_map(|trial| &trial.headset_scans);
    for region in scans.flat_map(|scan| &scan.regions) {
        if let Some(pixels) = pixels.get_mut(usize::from(*region)) {
            *pixels += 1;
        }
    }
    pixels
}

/// One of some classes, or another if there are none.
fn one_of(classes: &[u16], or: u16, stream: &mut Stream) -> u16 {
    let choice = (stream.uniform() * classes.len() as f64) as usize;
    classes.get(choice).copied().unwrap_or(or)
}
