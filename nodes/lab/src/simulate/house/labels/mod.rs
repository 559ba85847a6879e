//! Wrong labels on the robot and on the headset (semantic_icp section 5, track B).

mod confusion;
mod flips;

use super::{HeadsetTrial, House};
use crate::AnyError;
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use confusion::Confusion;
use flips::flipped;
use lattice_core::registration::{LabelDistribution, SemanticCloud, UNLABELED};
use nalgebra::Point3;

/// The labels of one device, region by region.
#[derive(Clone, PartialEq, Debug)]
pub struct RegionLabels(Vec<u16>);

impl RegionLabels {
    /// The true labels.
    pub fn truth(house: &House) -> RegionLabels {
        RegionLabels(house.regions().iter().map(|region| region.label).collect())
    }

    /// The class that a region is labelled as; [`UNLABELED`] for no region.
    pub fn class(&self, region: u16) -> u16 {
        let class = self.0.get(usize::from(region));
        class.copied().unwrap_or(UNLABELED)
    }

    /// Labelled points of points and their regions, in any frame.
    pub fn cloud(&self, points_m: &[Point3<f64>], regions: &[u16]) -> SemanticCloud {
        SemanticCloud {
            labels: regions
                .iter()
                .map(|region| self.of_counts(&[(*region, 1)]))
                .collect(),
            points_m: points_m.to_vec(),
        }
    }

    /// The labels of counted points of some regions.
    pub(super) fn of_counts(&self, regions: &[(u16, u32)]) -> LabelDistribution {
        let mut counts: Vec<(u16, f32)> = Vec::with_capacity(regions.len());
        for &(region, count) in regions.iter().filter(|(_, count)| *count > 0) {
            let class = self.class(region);
            match counts.iter_mut().find(|(known, _)| *known == class) {
                Some((_, sum)) => *sum += count as f32,
                None => counts.push((class, count as f32)),
            }
        }
        counts.sort_by_key(|(class, _)| *class);
        LabelDistribution::from_weights(counts)
    }
}

/// One draw of the labels of both devices.
#[derive(Clone, PartialEq, Debug)]
pub struct LabelDraw {
    /// Labels of the robot's map.
    pub map: RegionLabels,
    /// Labels of the headset.
    pub headset: RegionLabels,
    /// Share of the headset's points in regions with different labels in map and headset.
    pub different_share: f64,
}

impl LabelDraw {
    /// Draws labels by the seed alone: a share of the regions, 0 to 1, is wrong as a whole, on the one
    /// device or the other. Of what the headset sees in all trials together it is the share of pixels,
    /// met as nearly as whole regions allow; elsewhere the probability.
    pub fn new(
        house: &House,
        trials: &[HeadsetTrial],
        flips: f64,
        seed: u64,
    ) -> Result<LabelDraw, AnyError> {
        within("flips", flips, 0.0, 1.0)?;
        let regions = house.regions();
        let mut stream = Stream::new(seed, Purpose::LabelFlips, 0, 0);
        let pixels = pixels_of(regions.len(), trials);
        let confusion = Confusion::new(house);
        // One number a class, as ever, so that a seed gives the labels that it always gave.
        for _ in 0..confusion.len() {
            stream.uniform();
        }
        let flipped = flipped(flips, &pixels, &mut stream);
        let mut map = RegionLabels::truth(house);
        let mut headset = map.clone();
        for (i, region) in regions.iter().enumerate() {
            // Always drawn, so that a region's wrong class does not depend on the others.
            let wrong = [(); 2].map(|()| confusion.any(region.label, &mut stream));
            for (labels, (wrong, flipped)) in [&mut map, &mut headset]
                .into_iter()
                .zip(wrong.into_iter().zip(flipped[i]))
            {
                if flipped {
                    labels.0[i] = wrong;
                }
            }
        }
        let different = pixels
            .iter()
            .enumerate()
            .filter(|(i, _)| map.0[*i] != headset.0[*i]);
        let different: u64 = different.map(|(_, pixels)| pixels).sum();
        let seen: u64 = pixels.iter().sum();
        Ok(LabelDraw {
            map,
            headset,
            different_share: different as f64 / seen.max(1) as f64,
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
