//! The robot's map of a survey, whose labels can be changed without another survey.

use super::{RegionLabels, Survey};
use crate::AnyError;
use lattice_core::lattice::Lattice;
use lattice_core::registration::SemanticCloud;
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::{Point3, Vector3};

/// The voxels of a survey, each with its centroid and how many points of which region are in it.
#[derive(Clone, Debug)]
pub struct SurveyMap {
    centroids_m: Vec<Point3<f64>>,
    /// Start of the regions of each voxel, and the end.
    starts: Vec<usize>,
    regions: Vec<(u16, u32)>,
}

impl SurveyMap {
    /// Inserts a survey into cells of a lattice.
    pub fn new(survey: &Survey, lattice: &Lattice) -> Result<SurveyMap, AnyError> {
        // Regions take the place of labels.
        let list = voxels(survey, lattice, &survey.regions)?;
        let mut map = SurveyMap {
            centroids_m: Vec::with_capacity(list.len()),
            starts: vec![0],
            regions: Vec::new(),
        };
        for (key, voxel) in list.sorted() {
            let centroid = list.center_m(key) + Vector3::from(voxel.mean_offset_m());
            map.centroids_m.push(centroid.into());
            let counts = list.labels(key);
            map.regions
                .extend(counts.iter().map(|l| (l.label, l.count)));
            map.starts.push(map.regions.len());
        }
        Ok(map)
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.centroids_m.len()
    }

    /// True if there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.centroids_m.is_empty()
    }

    /// The centroids with the shares of their labels, map frame, in the order of
    /// [`SemanticCloud::from_voxels`].
    pub fn cloud(&self, labels: &RegionLabels) -> SemanticCloud {
        let voxel = |range: &[usize]| {
            let regions = self.regions.get(range[0]..range[1]).unwrap_or_default();
            labels.of_counts(regions)
        };
        SemanticCloud {
            labels: self.starts.windows(2).map(voxel).collect(),
            points_m: self.centroids_m.clone(),
        }
    }
}

impl Survey {
    /// The survey as a map of labelled voxels: label histograms as `lattice_mapper` keeps them.
    pub fn voxels(&self, lattice: &Lattice, labels: &RegionLabels) -> Result<VoxelList, AnyError> {
        let labels = self.regions.iter().map(|&region| labels.class(region));
        voxels(self, lattice, &labels.collect::<Vec<u16>>())
    }
}

fn voxels(survey: &Survey, lattice: &Lattice, labels: &[u16]) -> Result<VoxelList, AnyError> {
    let payload = Payload {
        labels: true,
        ..Payload::default()
    };
    let list = VoxelList::new(lattice.clone(), survey.cloud.datum_m, usize::MAX)?;
    let mut list = list.with_payload(payload);
    list.insert_labelled(&survey.cloud, labels);
    Ok(list)
}
