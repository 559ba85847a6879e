//! Quantizing and packing keys, without a store.

use lattice_core::lattice::{Key, Lattice};
use rayon::prelude::*;

use super::{Report, timed};

/// Points of one task.
const CHUNK: usize = 1 << 14;
/// Key of a point without one; no key has this bit.
const NO_KEY: u64 = 1 << 63;

/// How points become keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuantizeMethod {
    /// One point at a time in f64.
    Scalar,
}

impl QuantizeMethod {
    fn name(self) -> &'static str {
        match self {
            Self::Scalar => "lattice-quantize-scalar",
        }
    }
}

/// Quantizes all points into a stream of keys in memory; the report has the digest of the stream.
pub fn quantize(
    method: QuantizeMethod,
    lattice: &Lattice,
    res_m: f64,
    points_m: &[[f32; 3]],
) -> Report {
    // Written once before, so that no page is first touched while the clock runs.
    let mut keys = vec![NO_KEY; points_m.len()];
    let ((), spent) = timed(|| {
        let chunks = points_m.par_chunks(CHUNK).zip(keys.par_chunks_mut(CHUNK));
        chunks.for_each(|(points_m, keys)| match method {
            QuantizeMethod::Scalar => scalar(lattice, points_m, keys),
        });
    });
    let mut report = Report::new(method.name(), lattice.kind().name(), res_m, spent);
    report.n = points_m.len() as u64;
    report.hash = Some(format!("{:016x}", digest(&keys)));
    report
}

fn scalar(lattice: &Lattice, points_m: &[[f32; 3]], keys: &mut [u64]) {
    let mut keys = keys.iter_mut();
    let points = points_m.iter().map(|p| p.map(f64::from));
    lattice.quantize_each(points, |_, w| {
        if let Some(key) = keys.next() {
            *key = w.and_then(Key::pack).map_or(NO_KEY, Key::raw);
        }
    });
}

/// FNV-1a over the bytes of the keys, little-endian.
fn digest(keys: &[u64]) -> u64 {
    let bytes = keys.iter().flat_map(|key| key.to_le_bytes());
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
        let key = u64::from_le_bytes(*b"foobar\0\0");
        let foobar: u64 = 0x8594_4171_f739_67e8;
        let prime: u64 = 0x100_0000_01b3;
        assert_eq!(
            digest(&[key]),
            foobar.wrapping_mul(prime).wrapping_mul(prime)
        );
    }

    #[test]
    fn threads_do_not_change_the_digest_but_points_do() {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
        let points: Vec<[f32; 3]> = (0..50_000)
            .map(|i| [0.01 * i as f32, 0.3 - 0.007 * i as f32, 2.0])
            .collect();
        let hash = |threads, points: &[[f32; 3]]| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| quantize(QuantizeMethod::Scalar, &lattice, 0.1, points).hash)
        };
        assert_eq!(hash(1, &points), hash(3, &points));
        assert_ne!(hash(1, &points), hash(1, &points[1..]));
    }
}
