//! Correlation of a rotated cloud with the map at all positions.

use nalgebra::{Rotation3, Vector3};

use super::field::Field;
use super::grid::rounded;
use crate::lattice::Simd;

/// Peak of the correlation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Peak {
    /// Sum of the scores of the points.
    pub score: u32,
    /// Heading, radians.
    pub yaw_rad: f64,
    /// Position of the reference point of the source in the map, metres.
    pub place_m: Vector3<f64>,
}

/// Range of cells that may contain the reference point: first cell and number of cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub first: [usize; 3],
    pub dims: [usize; 3],
}

/// Finds the best positions of the reference point for one heading.
///
/// `points` are relative to the reference point, in the source frame, with their channels at this heading. At most
/// `max_cells` cells of them are used. Returns up to `most` local maxima, sorted by descending score.
pub(super) fn best_places(
    field: &Field,
    points: impl Iterator<Item = (Vector3<f64>, usize)>,
    yaw_rad: f64,
    window: Window,
    (max_cells, most): (usize, usize),
) -> Vec<Peak> {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let mut steps: Vec<(usize, [i64; 3])> = points
        .map(|(p, channel)| {
            let step = (turn * p) / field.grid.cell_m;
            (channel, [step.x, step.y, step.z].map(rounded))
        })
        .collect();
    // Each occupied cell of the source counts once.
    steps.sort_unstable_by_key(|(channel, [x, y, z])| (*channel, *z, *y, *x));
    steps.dedup();
    let stride = steps.len().div_ceil(max_cells.max(1)).max(1);
    let steps: Vec<_> = steps.into_iter().step_by(stride).collect();
    let sums = sum_all(field, &steps, window);
    maxima(&sums, window.dims, most)
        .into_iter()
        .map(|(score, cell)| Peak {
            score,
            yaw_rad,
            place_m: field
                .grid
                .center_m(std::array::from_fn(|a| cell[a] + window.first[a])),
        })
        .collect()
}

/// Scores of all cells of the window: the sum of rows of the field, shifted by each point.
///
/// Zero for rows with less than half of the points inside the field.
fn sum_all(field: &Field, steps: &[(usize, [i64; 3])], window: Window) -> Vec<u16> {
    #[cfg(target_arch = "x86_64")]
    if Simd::detect() == Simd::Avx2 {
        // SAFETY: AVX2 was detected.
        #[allow(unsafe_code)]
        return unsafe { sum_all_avx2(field, steps, window) };
    }
    sum_all_portably(field, steps, window)
}

/// [`sum_all_portably`] compiled for AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sum_all_avx2(field: &Field, steps: &[(usize, [i64; 3])], window: Window) -> Vec<u16> {
    sum_all_portably(field, steps, window)
}

#[inline(always)]
fn sum_all_portably(field: &Field, steps: &[(usize, [i64; 3])], window: Window) -> Vec<u16> {
    let [nx, ny, nz] = field.grid.dims;
    let [wx, wy, wz] = window.dims;
    let rows: Vec<Row<'_>> = steps
        .iter()
        .filter_map(|(channel, [x, y, z])| {
            // Cells of the field under the rows of the window.
            let x = window.first[0] as i64 + x;
            let [from, to] = [x, x + wx as i64].map(|x| x.clamp(0, nx as i64));
            Some(Row {
                scores: field.channels.get(*channel)?,
                y: (window.first[1] as i64 + y) as usize,
                z: (window.first[2] as i64 + z) as usize,
                cells: from as usize..to as usize,
                skipped: (from - x) as usize,
            })
        })
        .collect();
    let mut sums = vec![0_u16; wx * wy * wz];
    for (row, sums) in sums.chunks_exact_mut(wx.max(1)).enumerate() {
        let (row_y, row_z) = (row % wy, row / wy);
        // An index before the first row wraps beyond the last one.
        let place = |step: &Row<'_>| {
            let (y, z) = (step.y.wrapping_add(row_y), step.z.wrapping_add(row_z));
            (y < ny && z < nz).then(|| (z * ny + y) * nx)
        };
        if 2 * rows.iter().filter_map(place).count() < steps.len() {
            continue;
        }
        for step in &rows {
            let Some(base) = place(step) else { continue };
            let cells = base + step.cells.start..base + step.cells.end;
            let scores = step.scores.get(cells).unwrap_or_default();
            let sums = sums.get_mut(step.skipped..).unwrap_or_default();
            for (sum, score) in sums.iter_mut().zip(scores) {
                *sum += u16::from(*score);
            }
        }
    }
    sums
}

/// Row of the field at a source point, for the first row of the window.
struct Row<'a> {
    scores: &'a [u8],
    y: usize,
    z: usize,
    /// Cells of the row under the window, and cells of the window before them.
    cells: std::ops::Range<usize>,
    skipped: usize,
}

/// Local maxima among 26 neighbours, sorted by descending score; of equal ones the lower index wins.
fn maxima(sums: &[u16], dims: [usize; 3], most: usize) -> Vec<(u32, [usize; 3])> {
    let [nx, ny, nz] = dims;
    let top = sums.iter().copied().max().unwrap_or(0);
    let floor = (u32::from(top) * 6 / 10).max(1);
    let mut found = Vec::new();
    for (i, &sum) in sums.iter().enumerate() {
        if u32::from(sum) < floor {
            continue;
        }
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        let around = |n: usize, at: usize| at.saturating_sub(1)..=(at + 1).min(n - 1);
        let beaten = around(nz, z).any(|z| {
            around(ny, y).any(|y| {
                around(nx, x).any(|x| {
                    let j = (z * ny + y) * nx + x;
                    let other = sums.get(j).copied().unwrap_or(0);
                    other > sum || (other == sum && j < i)
                })
            })
        });
        if !beaten {
            found.push((u32::from(sum), [x, y, z]));
        }
    }
    found.sort_by_key(|(score, cell)| (std::cmp::Reverse(*score), *cell));
    found.truncate(most);
    found
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::*;
    use nalgebra::Point3;

    /// Reference implementation: looks up every point at every position.
    fn slow(field: &Field, steps: &[(usize, [i64; 3])], window: Window) -> Vec<u16> {
        let [wx, wy, wz] = window.dims;
        let mut sums = Vec::new();
        for (z, y, x) in all_cells(wz, wy, wx) {
            let [_, ny, nz] = field.grid.dims.map(|n| n as i64);
            let (row_y, row_z) = ((y + window.first[1]) as i64, (z + window.first[2]) as i64);
            let outside = |s: &&(usize, [i64; 3])| {
                !(0..ny).contains(&(row_y + s.1[1])) || !(0..nz).contains(&(row_z + s.1[2]))
            };
            if 2 * steps.iter().filter(outside).count() > steps.len() {
                sums.push(0);
                continue;
            }
            let base = [
                x + window.first[0],
                y + window.first[1],
                z + window.first[2],
            ];
            let score = |(channel, step): &(usize, [i64; 3])| {
                let cell = std::array::from_fn(|a| base[a] as i64 + step[a]);
                let at = field.grid.index(cell);
                at.map_or(0, |at| u16::from(field.channels[*channel][at]))
            };
            sums.push(steps.iter().map(score).sum());
        }
        sums
    }

    fn all_cells(a: usize, b: usize, c: usize) -> Vec<(usize, usize, usize)> {
        let all = (0..a).flat_map(|i| (0..b).map(move |j| (i, j)));
        all.flat_map(|(i, j)| (0..c).map(move |k| (i, j, k)))
            .collect()
    }

    #[test]
    fn shifted_rows_are_the_sum_over_points() {
        let mut state = 12345_u64;
        let mut random = |n: u64| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) % n
        };
        let grid = Grid {
            origin_m: Vector3::zeros(),
            cell_m: 1.0,
            dims: [13, 9, 5],
        };
        let channels = (0..2).map(|_| (0..grid.len()).map(|_| random(101) as u8).collect());
        let field = Field {
            channels: channels.collect(),
            grid,
        };
        let steps: Vec<_> = (0..50)
            .map(|_| {
                let step = [
                    random(31) as i64 - 15,
                    random(21) as i64 - 10,
                    random(9) as i64 - 4,
                ];
                (random(2) as usize, step)
            })
            .collect();
        let window = Window {
            first: [2, 1, 0],
            dims: [10, 8, 4],
        };
        assert_eq!(
            sum_all(&field, &steps, window),
            slow(&field, &steps, window)
        );
    }

    #[test]
    fn a_cloud_is_found_where_it_came_from() {
        let points: Vec<Point3<f64>> = [[0, 0, 0], [3, 0, 0], [3, 2, 0], [3, 2, 1], [9, 9, 2]]
            .map(|p| Point3::from(p.map(f64::from)))
            .to_vec();
        let grid = Grid::around(&points, 1.0, 1).unwrap();
        let dims = grid.dims;
        let field = Field::build(grid, &points, 1, |_, _| 100);
        let window = Window {
            first: [0; 3],
            dims,
        };
        let source = points[..4].iter().map(|p| (p - points[2], 0));
        let peaks = best_places(&field, source, 0.0, window, (256, 3));
        assert_eq!(peaks[0].score, 400);
        assert_eq!(peaks[0].place_m, points[2].coords);
    }
}
