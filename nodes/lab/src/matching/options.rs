//! Options of the matching.

/// Options of [`align`](super::align); by default the numbers of the original, with a second fine stage.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AlignOptions {
    /// Most points of the scan that are looked at, one of a cell.
    pub max_points: usize,
    /// Most steps on one level.
    pub level_iterations: usize,
    /// Last climbs, on the finest level, each by shorter steps than the one before; the original has one.
    pub fine_stages: usize,
    /// Most steps of each of the last climbs.
    pub fine_iterations: usize,
    /// Steps of the first of the last climbs over those of the finest level, and of each over those of
    /// the one before.
    pub fine_step: f64,
    /// Turn of one step on the finest level, radians; twice as much from one level to the next.
    pub step_rad: f64,
}

impl Default for AlignOptions {
    fn default() -> AlignOptions {
        AlignOptions {
            max_points: 2000,
            level_iterations: 20,
            fine_stages: 2,
            fine_iterations: 100,
            fine_step: 0.25,
            step_rad: 0.5_f64.to_radians(),
        }
    }
}

/// Half the widths of what is searched, about a pose; 0 keeps an axis as it is.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spread {
    /// Along the axes of the map, metres.
    pub translation_m: [f64; 3],
    /// About the axes of the map through the datum of the scan, which should be where the scanner
    /// was (a rotation vector), radians, at most pi.
    pub rotation_rad: [f64; 3],
}

/// Options of [`search`](super::search); by default the numbers of the original.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SearchOptions {
    /// Most points of the scan that are looked at, one of a cell.
    pub max_points: usize,
    /// Poses kept of a level, and given in the end.
    pub keep: usize,
    /// Distance of the features, at which a turn moves a point as far as a shift does, metres.
    pub feature_range_m: f64,
    /// Most poses of the coarsest grid; it takes 8 bytes for each.
    pub max_poses: usize,
}

impl Default for SearchOptions {
    fn default() -> SearchOptions {
        SearchOptions {
            max_points: 2000,
            keep: 100,
            feature_range_m: 8.0,
            max_poses: 5_000_000,
        }
    }
}
