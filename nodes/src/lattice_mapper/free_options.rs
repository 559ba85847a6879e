//! Free space parameters of the mapper.

use crate::options::one_of;
use lattice_core::raycast::{ClearOptions, Evidence, MAX_FREE_LEVEL, MIN_MAP_BYTES, Reach};
use lattice_runtime::params::{ParamError, Params};

/// Largest settable ray length and kept end, m.
const MAX_LENGTH_M: f64 = 1e6;
/// Largest settable sweep duration, s.
const MAX_SWEEP_S: f64 = 60.0;

/// Use of the rays from the sensor to its points.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum FreeSpaceMethod {
    /// Rays are ignored.
    #[default]
    Off,
    /// Rays clear the voxels that they traverse.
    Clear,
    /// Hits and misses of each cell are counted; voxels that are probably free are removed.
    Evidence,
}

/// Free space options of a map.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct MappedFreeSpace {
    /// Method.
    pub method: FreeSpaceMethod,
    /// Duration of a sweep, whose clouds count as one scan, ns; 0: each cloud is a scan.
    pub sweep_ns: i64,
    /// Range, kept ends, misses and memory; evidence uses all but the misses.
    pub clear: ClearOptions,
    /// Evidence model of hits and misses.
    pub evidence: Evidence,
    /// Level of published free cells, `2^free_level` voxels wide; 0: not published.
    pub free_level: u32,
    /// Log-odds for all cells that rays pass, as octrees need them; not with a free level.
    pub is_fine: bool,
}

impl MappedFreeSpace {
    /// Reads the parameters `free_space`, `rays.*`, `evidence.*` and `free_level`.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        let Self {
            clear, evidence, ..
        } = Self::default();
        let methods = [
            ("off", FreeSpaceMethod::Off),
            ("clear", FreeSpaceMethod::Clear),
            ("evidence", FreeSpaceMethod::Evidence),
        ];
        let method = one_of(params, "free_space", &methods)?;
        let sweep_s = params.f64_in("rays.sweep_s", 0.0, 0.0..=MAX_SWEEP_S)?;
        let max_range_m = params.f64_in("rays.max_range_m", 0.0, 0.0..=MAX_LENGTH_M)?;
        let endless = max_range_m == 0.0;
        let bytes = MIN_MAP_BYTES..=usize::MAX;
        let reach = Reach {
            max_range_m: if endless { f64::INFINITY } else { max_range_m },
            keep_m: params.f64_in("rays.keep_m", clear.reach.keep_m, 0.0..=MAX_LENGTH_M)?,
            keep_ratio: params.f64_in("rays.keep_ratio", clear.reach.keep_ratio, 0.0..=1.0)?,
        };
        let clear = ClearOptions {
            misses: params.usize_in("rays.misses", clear.misses as usize, 1..=u32::MAX as usize)?
                as u32,
            reach,
            spare_touching: params.bool("rays.spare_touching", clear.spare_touching)?,
            max_bytes: params.usize_in("rays.max_bytes", clear.max_bytes, bytes)?,
        };
        let evidence = Evidence {
            hit: params.f64("evidence.hit", evidence.hit)?,
            miss: params.f64("evidence.miss", evidence.miss)?,
            least: params.f64("evidence.least", evidence.least)?,
            most: params.f64("evidence.most", evidence.most)?,
            threshold: params.f64("evidence.threshold", evidence.threshold)?,
        };
        evidence
            .check()
            .map_err(|error| params.invalid("evidence", error.to_string()))?;
        let free_level = params.usize_in("free_level", 0, 0..=MAX_FREE_LEVEL as usize)?;
        if free_level > 0 && method != FreeSpaceMethod::Evidence {
            return Err(params.invalid("free_level", "needs free_space: evidence"));
        }
        Ok(Self {
            method,
            sweep_ns: (sweep_s * 1e9) as i64,
            clear,
            evidence,
            free_level: free_level as u32,
            is_fine: free_level == 0 && params.bool("octomap_services", false)?,
        })
    }
}
