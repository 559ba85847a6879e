//! Parameters of free space in the mapper.

use lattice_core::raycast::{ClearOptions, Evidence, MAX_FREE_LEVEL, MIN_MAP_BYTES};
use lattice_runtime::params::{ParamError, Params};

/// Longest sweep, s.
const MAX_SWEEP_S: f64 = 60.0;

/// Use of the rays from the sensor to its points.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum FreeSpaceMethod {
    /// None: voxels stay.
    #[default]
    Off,
    /// Voxels that rays pass through go.
    Clear,
    /// Hits and misses of each cell are counted; voxels that are probably free go.
    Evidence,
}

/// Options of free space in a map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MappedFreeSpace {
    /// Use of the rays.
    pub method: FreeSpaceMethod,
    /// Clouds of this long are one scan, ns; 0: each is one.
    pub sweep_ns: i64,
    /// Range, kept ends, misses and memory; evidence uses all but the misses.
    pub clear: ClearOptions,
    /// Hits and misses that make a cell occupied or free.
    pub evidence: Evidence,
    /// Free cells that are published are `2^free_level` as wide; 0: none are.
    pub free_level: u32,
}

impl Default for MappedFreeSpace {
    fn default() -> Self {
        Self {
            method: FreeSpaceMethod::Off,
            sweep_ns: 0,
            clear: ClearOptions::default(),
            evidence: Evidence::default(),
            free_level: 0,
        }
    }
}

impl MappedFreeSpace {
    /// Reads the parameters `free_space`, `rays.*`, `evidence.*` and `free_level`.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let method = match params.string("free_space", "off")?.as_str() {
            "off" => FreeSpaceMethod::Off,
            "clear" => FreeSpaceMethod::Clear,
            "evidence" => FreeSpaceMethod::Evidence,
            other => {
                let problem = format!("{other:?}, expected off, clear or evidence");
                return Err(params.invalid("free_space", problem));
            }
        };
        let sweep_s = within(params, "rays.sweep_s", 0.0, [0.0, MAX_SWEEP_S])?;
        let max_range_m = within(params, "rays.max_range_m", 0.0, [0.0, 1e6])?;
        let misses = params.usize("rays.misses", defaults.clear.misses as usize)?;
        let misses = u32::try_from(misses).ok().filter(|misses| *misses > 0);
        let misses = misses.ok_or_else(|| params.invalid("rays.misses", "expected 1 or more"))?;
        let clear = ClearOptions {
            misses,
            keep_m: within(params, "rays.keep_m", defaults.clear.keep_m, [0.0, 1e6])?,
            keep_ratio: within(
                params,
                "rays.keep_ratio",
                defaults.clear.keep_ratio,
                [0.0, 1.0],
            )?,
            spare_touching: params.bool("rays.spare_touching", defaults.clear.spare_touching)?,
            max_range_m: if max_range_m > 0.0 {
                max_range_m
            } else {
                f64::INFINITY
            },
            max_bytes: params.usize("rays.max_bytes", defaults.clear.max_bytes)?,
        };
        if clear.max_bytes < MIN_MAP_BYTES {
            let problem = format!("{}, expected {MIN_MAP_BYTES} or more", clear.max_bytes);
            return Err(params.invalid("rays.max_bytes", problem));
        }
        let evidence = Evidence {
            hit: params.f64("evidence.hit", defaults.evidence.hit)?,
            miss: params.f64("evidence.miss", defaults.evidence.miss)?,
            least: params.f64("evidence.least", defaults.evidence.least)?,
            most: params.f64("evidence.most", defaults.evidence.most)?,
            threshold: params.f64("evidence.threshold", defaults.evidence.threshold)?,
        };
        evidence
            .check()
            .map_err(|error| params.invalid("evidence", error.to_string()))?;
        let free_level = params.usize("free_level", 0)?;
        let free_level = u32::try_from(free_level).unwrap_or(u32::MAX);
        if free_level > MAX_FREE_LEVEL {
            let problem = format!("{free_level}, expected 0 (none) to {MAX_FREE_LEVEL}");
            return Err(params.invalid("free_level", problem));
        }
        if free_level > 0 && method != FreeSpaceMethod::Evidence {
            return Err(params.invalid("free_level", "needs free_space: evidence"));
        }
        Ok(Self {
            method,
            sweep_ns: (sweep_s * 1e9) as i64,
            clear,
            evidence,
            free_level,
        })
    }
}

fn within(
    params: &Params,
    name: &str,
    default: f64,
    [least, most]: [f64; 2],
) -> Result<f64, ParamError> {
    let value = params.f64(name, default)?;
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(params.invalid(name, format!("{value}, expected {least} to {most}")))
}
