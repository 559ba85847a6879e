//! Image planes in which convolution taps are shifted rows.

use std::ops::Range;

use super::taps::MAX_LANES;

/// Values of a band that fit half of a 1 MiB cache.
const NEAR: usize = 1 << 17;
/// Limit of values of a band, per thread.
const MAX_VALUES: usize = 1 << 22;

/// Convolution parameters of one image axis.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) struct Axis {
    /// Input pixels.
    pub input: usize,
    /// Output pixels.
    pub output: usize,
    /// Kernel size.
    pub kernel: usize,
    /// Stride, input pixels.
    pub stride: usize,
    /// Dilation, input pixels.
    pub dilation: usize,
    /// Zero padding before the input.
    pub padding: usize,
}

impl Axis {
    /// Number of planes: every `stride`-th pixel is in the same plane, so that adjacent outputs are contiguous.
    fn phases(self) -> usize {
        if self.kernel > 1 { self.stride } else { 1 }
    }

    /// Plane of a weight and the shift in it.
    fn tap(self, weight: usize) -> (usize, usize) {
        let at = weight * self.dilation;
        (at % self.stride, at / self.stride)
    }

    /// Pixels of a plane beyond the output.
    fn halo(self) -> usize {
        self.tap(self.kernel.saturating_sub(1)).1
    }

    /// Input position of a plane's pixel.
    fn place(self, phase: usize, pixel: usize) -> Option<usize> {
        let place = pixel.checked_mul(self.stride)?.checked_add(phase)?;
        let place = place.checked_sub(self.padding)?;
        (place < self.input).then_some(place)
    }
}

/// Layout of an image in bands of output rows whose planes fit the cache.
#[derive(Clone, Debug, Hash, PartialEq, Eq)]
pub(super) struct Layout {
    channels: usize,
    rows: Axis,
    columns: Axis,
    /// Output rows per band.
    pub band: usize,
}

impl Layout {
    /// `None` if planes would be too large: large dilation or stride.
    pub fn new(channels: usize, rows: Axis, columns: Axis) -> Option<Self> {
        for axis in [rows, columns] {
            let apart = axis.kernel.checked_sub(1)?.checked_mul(axis.dilation)?;
            apart.checked_div(axis.stride)?.checked_add(axis.output)?;
        }
        let row = [
            rows.phases(),
            columns.phases(),
            columns.output + columns.halo(),
        ];
        let row = row
            .iter()
            .try_fold(channels, |all, n| all.checked_mul(*n))?;
        let band = NEAR.checked_div(row)?.saturating_sub(rows.halo());
        let band = band.max(rows.halo()).clamp(1, rows.output.max(1));
        let values = row.checked_mul(band + rows.halo())?;
        (values <= MAX_VALUES).then_some(Self {
            channels,
            rows,
            columns,
            band,
        })
    }

    /// Row pitch of a plane: an output position in a band is row times pitch plus column.
    pub fn width(&self) -> usize {
        self.columns.output + self.columns.halo()
    }

    fn plane(&self) -> usize {
        (self.band + self.rows.halo()) * self.width()
    }

    /// Values per channel: an odd number of cache lines, which avoids conflicts between channels.
    pub fn channel(&self) -> usize {
        let all = self.rows.phases() * self.columns.phases() * self.plane();
        all.next_multiple_of(32) + 16
    }

    /// Offset of each tap in a channel.
    pub fn taps(&self) -> Vec<usize> {
        let mut taps = Vec::with_capacity(self.rows.kernel * self.columns.kernel);
        for (row, down) in (0..self.rows.kernel).map(|weight| self.rows.tap(weight)) {
            for (column, right) in (0..self.columns.kernel).map(|weight| self.columns.tap(weight)) {
                let plane = row * self.columns.phases() + column;
                taps.push(plane * self.plane() + down * self.width() + right);
            }
        }
        taps
    }

    /// Fills the planes of an output band from the image.
    pub fn fill(&self, image: &[f32], band: &Range<usize>, planes: &mut Vec<f32>) {
        planes.resize(self.channels * self.channel() + MAX_LANES, 0.0);
        let image = image.chunks_exact((self.rows.input * self.columns.input).max(1));
        for (image, planes) in image.zip(planes.chunks_exact_mut(self.channel())) {
            let mut rows = planes.chunks_exact_mut(self.width());
            for phase in 0..self.rows.phases() {
                for column in 0..self.columns.phases() {
                    for row in band.start..band.start + self.band + self.rows.halo() {
                        let place = self.rows.place(phase, row);
                        let from = place.and_then(|row| image.get(row * self.columns.input..));
                        let from = from.and_then(|from| from.get(..self.columns.input));
                        let to = rows.next().unwrap_or_default();
                        self.fill_row(from.unwrap_or_default(), column, to);
                    }
                }
            }
        }
    }

    /// Fills a row of a plane from a row of the image.
    fn fill_row(&self, from: &[f32], phase: usize, to: &mut [f32]) {
        let Axis {
            stride, padding, ..
        } = self.columns;
        let before = padding.saturating_sub(phase).div_ceil(stride).min(to.len());
        let (zeros, to) = to.split_at_mut(before);
        zeros.fill(0.0);
        let first = before * stride + phase - padding.min(before * stride + phase);
        let from = from.get(first..).unwrap_or_default();
        let (to, zeros) = to.split_at_mut(from.len().div_ceil(stride).min(to.len()));
        zeros.fill(0.0);
        match stride {
            1 => to.copy_from_slice(from.get(..to.len()).unwrap_or_default()),
            // Deinterleaving pairs is vectorised.
            2 => {
                let (pairs, last) = from.as_chunks::<2>();
                for (to, [from, _]) in to.iter_mut().zip(pairs) {
                    *to = *from;
                }
                for (to, from) in to.iter_mut().skip(pairs.len()).zip(last) {
                    *to = *from;
                }
            }
            _ => {
                for (to, from) in to.iter_mut().zip(from.iter().step_by(stride)) {
                    *to = *from;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(input: usize, [kernel, stride, dilation, padding]: [usize; 4]) -> Axis {
        let output = (input + 2 * padding - (kernel - 1) * dilation - 1) / stride + 1;
        Axis {
            input,
            output,
            kernel,
            stride,
            dilation,
            padding,
        }
    }

    #[test]
    fn taps_find_the_pixels_of_each_output() {
        let channels = 2;
        let cases = [
            [1, 1, 1, 0],
            [3, 1, 1, 1],
            [3, 2, 1, 1],
            [3, 1, 4, 4],
            [7, 4, 1, 3],
            [3, 3, 2, 0],
            [1, 2, 1, 0],
        ];
        for case in cases {
            let (rows, columns) = (axis(19, case), axis(30, case));
            let layout = Layout::new(channels, rows, columns).unwrap();
            let layout = Layout { band: 4, ..layout };
            let image: Vec<f32> = (1..=channels * 19 * 30).map(|i| i as f32).collect();
            let mut planes = vec![f32::NAN; 3];
            for begin in (0..rows.output).step_by(4) {
                let band = begin..rows.output.min(begin + 4);
                layout.fill(&image, &band, &mut planes);
                let [kernel, stride, dilation, padding] = case;
                for (y, x, channel) in band.flat_map(|y| {
                    (0..columns.output).flat_map(move |x| (0..channels).map(move |c| (y, x, c)))
                }) {
                    for (weight, tap) in layout.taps().iter().enumerate() {
                        let row = y * stride + weight / kernel * dilation;
                        let column = x * stride + weight % kernel * dilation;
                        let inside = (padding..padding + 19).contains(&row)
                            && (padding..padding + 30).contains(&column);
                        let pixel =
                            || image[(channel * 19 + row - padding) * 30 + column - padding];
                        let at = channel * layout.channel() + (y - begin) * layout.width() + x;
                        let expected = if inside { pixel() } else { 0.0 };
                        assert_eq!(planes[at + tap], expected, "{case:?} {y} {x} {weight}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_would_take_too_much_memory_has_no_layout() {
        let near = axis(64, [3, 1, 1, 1]);
        assert!(Layout::new(64, near, near).is_some());
        for far in [
            Axis {
                dilation: 1 << 40,
                ..near
            },
            Axis {
                dilation: usize::MAX,
                ..near
            },
            Axis {
                stride: 1 << 40,
                ..near
            },
            Axis { stride: 0, ..near },
            Axis { kernel: 0, ..near },
            Axis {
                output: usize::MAX,
                ..near
            },
        ] {
            assert_eq!(Layout::new(64, near, far), None);
            assert_eq!(Layout::new(64, far, near), None);
        }
    }
}
