//! Quantizing and packing keys, without a store.

use super::{Report, Spent, timed};
use crate::paper_values::Search27;
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeIndex, Simd};
use nalgebra::Isometry3;
use rayon::prelude::*;

/// Points of one task.
const CHUNK: usize = 1 << 14;

/// Way to quantize points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuantizeMethod {
    /// The batch quantizer with the best instructions of this machine.
    Batch,
    /// The batch quantizer with what every machine of the target has.
    Portable,
    /// One point at a time in f64.
    Scalar,
    /// The nearest of 27 candidates, as Ryde & Brünig 2011 do it, with the best instructions; keys
    /// of points on borders may be others.
    Paper27,
}

impl QuantizeMethod {
    fn name(self) -> &'static str {
        match self {
            Self::Batch => "lattice-batch",
            Self::Portable => "lattice-portable",
            Self::Scalar => "lattice-scalar",
            Self::Paper27 => "lattice-paper27",
        }
    }
}

/// Output of a benchmark of quantizing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuantizeOutput {
    /// Keys, in memory that was written before.
    Keys,
    /// Lattice indices, in memory that was written before.
    Indices,
    /// Lattice indices, in memory that is asked for while the clock runs.
    NewIndices,
}

/// Quantizes all points, to indices by [`QuantizeMethod::Batch`] whatever the method; the report
/// has the digest of the keys ([`BlockKey`]).
pub fn quantize(
    method: QuantizeMethod,
    output: QuantizeOutput,
    lattice: &Lattice,
    points_m: &[[f32; 3]],
) -> Report {
    let (name, keys, spent) = match output {
        QuantizeOutput::Keys => {
            let (keys, spent) = to_keys(method, lattice, points_m);
            (method.name(), keys, spent)
        }
        QuantizeOutput::Indices | QuantizeOutput::NewIndices => {
            let new = output == QuantizeOutput::NewIndices;
            let (indices, spent) = to_indices(lattice, points_m, new);
            let key = |w: &LatticeIndex| BlockKey::pack(*w).unwrap_or(BlockKey::NONE);
            ("lattice-indices", indices.iter().map(key).collect(), spent)
        }
    };
    Report {
        n: points_m.len() as u64,
        hash: Some(format!("{:016x}", digest(&keys))),
        ..Report::new(name, lattice, spent)
    }
}

fn to_indices(lattice: &Lattice, points_m: &[[f32; 3]], new: bool) -> (Vec<LatticeIndex>, Spent) {
    let best = BatchQuantizer::new(lattice, Isometry3::identity());
    // Ones, so that the pages are there before the clock runs.
    let given = if new {
        Vec::new()
    } else {
        vec![[1; 3]; points_m.len()]
    };
    timed(|| {
        let mut indices = if new {
            vec![[0; 3]; points_m.len()]
        } else {
            given
        };
        let chunks = points_m
            .par_chunks(CHUNK)
            .zip(indices.par_chunks_mut(CHUNK));
        chunks.for_each(|(points_m, indices)| {
            best.indices(points_m, indices);
        });
        indices
    })
}

fn to_keys(
    method: QuantizeMethod,
    lattice: &Lattice,
    points_m: &[[f32; 3]],
) -> (Vec<BlockKey>, Spent) {
    // Written once before, so that no page is first touched while the clock runs.
    let mut keys = vec![BlockKey::NONE; points_m.len()];
    let batch = |simd| BatchQuantizer::with_simd(lattice, Isometry3::identity(), simd);
    let (best, portable) = (batch(Simd::detect()), batch(Simd::Portable));
    let paper = Search27::new(lattice, Simd::detect());
    let ((), spent) = timed(|| {
        let chunks = points_m.par_chunks(CHUNK).zip(keys.par_chunks_mut(CHUNK));
        chunks.for_each(|(points_m, keys)| match method {
            QuantizeMethod::Batch => blocks(&best, points_m, keys),
            QuantizeMethod::Portable => blocks(&portable, points_m, keys),
            QuantizeMethod::Scalar => scalar(lattice, points_m, keys),
            QuantizeMethod::Paper27 => {
                if let Some(paper) = &paper {
                    paper.codes(points_m, keys);
                }
            }
        });
    });
    (keys, spent)
}

fn blocks(quantizer: &BatchQuantizer, points_m: &[[f32; 3]], mut keys: &mut [BlockKey]) {
    quantizer.for_blocks(points_m, |block, _| {
        let (now, later) = std::mem::take(&mut keys).split_at_mut(block.len());
        now.copy_from_slice(block);
        keys = later;
    });
}

fn scalar(lattice: &Lattice, points_m: &[[f32; 3]], keys: &mut [BlockKey]) {
    let mut keys = keys.iter_mut();
    let points = points_m.iter().map(|p| p.map(f64::from));
    lattice.quantize_each(points, |_, w| {
        if let Some(key) = keys.next() {
            *key = w.and_then(BlockKey::pack).unwrap_or(BlockKey::NONE);
        }
    });
}

/// FNV-1a over the bytes of the keys, little-endian.
fn digest(keys: &[BlockKey]) -> u64 {
    let bytes = keys.iter().flat_map(|key| key.raw().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;

    #[test]
    fn the_digest_is_that_of_fnv_1a() {
        assert_eq!(digest(&[]), 0xcbf2_9ce4_8422_2325);
        // "foobar\0\0" by the reference implementation's definition, folded by hand over its bytes.
        let key = BlockKey::from_raw(u64::from_le_bytes(*b"foobar\0\0")).unwrap();
        let foobar: u64 = 0x8594_4171_f739_67e8;
        let prime: u64 = 0x100_0000_01b3;
        let expected = foobar.wrapping_mul(prime).wrapping_mul(prime);
        assert_eq!(digest(&[key]), expected);
    }

    #[test]
    fn neither_threads_nor_method_change_the_digest_but_points_do() {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
        let points: Vec<[f32; 3]> = (0..50_000)
            .map(|i| [0.01 * i as f32, 0.3 - 0.007 * i as f32, 2.0])
            .collect();
        let hash = |threads, method, points: &[[f32; 3]]| {
            let pool = crate::pool(threads).unwrap();
            pool.install(|| quantize(method, QuantizeOutput::Keys, &lattice, points).hash)
        };
        let one = hash(1, Scalar, &points);
        use QuantizeMethod::{Batch, Portable, Scalar};
        for method in [Scalar, Batch, Portable] {
            assert_eq!(hash(3, method, &points), one, "{method:?}");
            assert_ne!(hash(1, method, &points[1..]), one, "{method:?}");
        }
        let pool = crate::pool(2).unwrap();
        for output in [QuantizeOutput::Indices, QuantizeOutput::NewIndices] {
            let hash = |points| quantize(Batch, output, &lattice, points).hash;
            assert_eq!(pool.install(|| hash(&points)), one, "{output:?}");
            assert_ne!(hash(&points[1..]), one, "{output:?}");
        }
        let paper = |points| hash(2, QuantizeMethod::Paper27, points);
        // Its keys are the exact ones where single precision is enough.
        let near = points[..500].iter().map(|p| p.map(|x| x.rem_euclid(1.7)));
        let near: Vec<[f32; 3]> = near.collect();
        assert_eq!(paper(&near), hash(1, Scalar, &near));
        assert_ne!(paper(&points[1..]), paper(&points));
    }
}
