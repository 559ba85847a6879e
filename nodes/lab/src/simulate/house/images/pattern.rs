//! Patterns of materials, and numbers at places that are the same wherever they are computed.

/// Kind of a pattern.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Pattern {
    /// One colour.
    Plain,
    /// Two colours in spots.
    Mottled,
    /// Two colours in upright stripes, or in stripes along the floor.
    Stripes,
    /// Two colours in squares.
    Checker,
    /// Squares with joints.
    Tiles,
    /// Rings of a tree, in boards.
    Wood,
    /// Backs of books in rows where it is upright.
    Books,
    /// Spots of many colours.
    Painting,
}

/// A number of 32 bits that looks random, of three whole numbers.
pub(super) fn hash([x, y, z]: [i32; 3], seed: u32) -> u32 {
    let mut h = seed ^ 0x9e37_79b9;
    for part in [x, y, z] {
        h = (h ^ part as u32).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 15)).wrapping_mul(0xc2b2_ae35);
        h ^= h >> 13;
    }
    h
}

/// The same from 0 to 1.
pub(super) fn unit(cell: [i32; 3], seed: u32) -> f32 {
    (hash(cell, seed) >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise from 0 to 1 with one knot for each unit of length: values at the corners of a cube, blended.
pub(super) fn noise(place: [f32; 3], seed: u32) -> f32 {
    let low = place.map(f32::floor);
    let blend = |i: usize| {
        let t = place[i] - low[i];
        t * t * (3.0 - 2.0 * t)
    };
    let [u, v, w] = [0, 1, 2].map(blend);
    let corner = |x: i32, y: i32, z: i32| {
        let [i, j, k] = low.map(|c| c as i32);
        unit(
            [i.wrapping_add(x), j.wrapping_add(y), k.wrapping_add(z)],
            seed,
        )
    };
    let along = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edge = |y: i32, z: i32| along(corner(0, y, z), corner(1, y, z), u);
    let face = |z: i32| along(edge(0, z), edge(1, z), v);
    along(face(0), face(1), w)
}

/// Number of a cell of some length, and the share of the way through it.
pub(super) fn cell(at: f32, length: f32) -> (i32, f32) {
    let cells = at / length;
    (cells.floor() as i32, cells - cells.floor())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_fills_its_range() {
        let at = |i: i32| noise([i as f32 * 0.01, 0.3, -7.7], 5);
        let (mut low, mut high) = (1.0_f32, 0.0_f32);
        for i in -5000..5000 {
            assert!((at(i) - at(i + 1)).abs() < 0.03);
            (low, high) = (low.min(at(i)), high.max(at(i)));
        }
        assert!((0.0..0.2).contains(&low) && (0.8..1.0).contains(&high));
        assert!((0.0..=1.0).contains(&noise([0.0, 1e30, -1e30], 1)));
    }
}
