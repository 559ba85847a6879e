//! Scan matching by occupied cells alone: lists of several resolutions (Ryde & Hu, the
//! matcher behind Fig. 6 of Ryde & Brünig 2011).
//!
//! A [`MultiResolutionList`] holds the map once for each level, with cells of twice the side from one
//! level to the next. A pose is as good as the number of scan points that it puts into occupied
//! cells. [`align`] climbs from a guess, the coarsest level first; [`search`] tries a grid of poses
//! and divides the best ones, level by level. Both take any lattice.

mod align;
mod levels;
mod sample;
mod search;
#[cfg(test)]
mod tests;

pub use align::{Alignment, align};
pub use levels::MultiResolutionList;
use sample::{MAX_POINTS, sample};
pub use search::{Spread, search};
