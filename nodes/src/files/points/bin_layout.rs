//! Column layouts of raw binary scans, and their detection in a file without a header.

use std::fmt;
use std::str::FromStr;

use super::scalar::Scalar;

/// Limit of columns.
const MAX_COLUMNS: usize = 64;
/// Layouts tried if none is given: KITTI, nuScenes (5), with normals or colours (6 to 8), and doubles.
const KNOWN: [BinLayout; 8] = [
    BinLayout::KITTI,
    BinLayout::floats(3),
    BinLayout::floats(5),
    BinLayout::floats(6),
    BinLayout::floats(7),
    BinLayout::floats(8),
    BinLayout::doubles(3),
    BinLayout::doubles(4),
];
/// Plausible absolute coordinates of a scan, m.
const COORDINATES_M: std::ops::RangeInclusive<f64> = 1e-12..=1e7;
/// Largest fraction of points with implausible coordinates for an accepted layout.
const MAX_ABSURD: f64 = 0.01;
/// Fraction of points on the y axis above which the numbers are halves of doubles.
const MOST_HALVES: f64 = 0.5;
/// Margin between layouts. The columns of a wrong layout mix the true ones and are similar. A layout is rejected if
/// another one explains this fraction of the variance more, and this many times as much. Scans of KITTI explain 67 %
/// by four columns and equally by eight; other layouts explain at most two thirds of their own value by four.
const MORE: f64 = 0.05;
const TIMES: f64 = 1.4;
/// Fraction of the best explained variance below which an alternative layout is not suggested.
const WORTH_NAMING: f64 = 0.5;
/// Smallest sample size for distinguishing layouts, numbers.
const MIN_NUMBERS: usize = 256;

/// Columns of a `.bin` file: records of little-endian numbers, x, y and z (m) first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BinLayout {
    pub(super) columns: usize,
    pub(super) scalar: Scalar,
}

impl BinLayout {
    /// x, y, z and intensity in single precision.
    pub(super) const KITTI: BinLayout = BinLayout::floats(4);

    const fn floats(columns: usize) -> BinLayout {
        let scalar = Scalar::F32;
        BinLayout { columns, scalar }
    }

    const fn doubles(columns: usize) -> BinLayout {
        let scalar = Scalar::F64;
        BinLayout { columns, scalar }
    }

    /// Bytes of a point.
    pub(super) fn bytes(self) -> usize {
        self.columns * self.scalar.size()
    }

    fn words(self) -> String {
        let numbers = match self.scalar {
            Scalar::F64 => "doubles",
            _ => "floats",
        };
        format!("{} {numbers}", self.columns)
    }
}

impl FromStr for BinLayout {
    type Err = String;

    fn from_str(text: &str) -> Result<BinLayout, String> {
        let (number, layout): (_, fn(usize) -> BinLayout) = match text.strip_suffix('d') {
            Some(number) => (number, BinLayout::doubles),
            None => (text, BinLayout::floats),
        };
        let columns = number
            .parse()
            .ok()
            .filter(|n| (3..=MAX_COLUMNS).contains(n));
        columns.map(layout).ok_or_else(|| {
            format!("expected 3 to {MAX_COLUMNS} columns, followed by d for doubles, as 5 or 3d")
        })
    }
}

impl fmt::Display for BinLayout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let suffix = if self.scalar == Scalar::F64 { "d" } else { "" };
        write!(f, "{}{suffix}", self.columns)
    }
}

/// Checks whether a file may be a KITTI scan; the error names the reason and the layouts that fit.
///
/// `sample` is its beginning, `size_bytes` its length if known.
pub(super) fn check_kitti(sample: &[u8], size_bytes: Option<u64>) -> Result<(), String> {
    let fit = |layout: BinLayout| Fit::new(layout, sample, size_bytes);
    let own = fit(BinLayout::KITTI);
    let others: Vec<Fit> = KNOWN.iter().skip(1).map(|layout| fit(*layout)).collect();
    let is_alike = |other: &&Fit| {
        other.is_possible()
            && other.explained > own.explained + MORE
            && other.explained > TIMES * own.explained
    };
    let why = if let Some(size_bytes) = size_bytes.filter(|_| !own.divides) {
        format!("its {size_bytes} bytes are not a multiple of a point of 4 floats (16 bytes)")
    } else if own.absurd > MAX_ABSURD {
        let percent = 100.0 * own.absurd;
        format!("as 4 floats a point, {percent:.0} % of its points have implausible coordinates")
    } else if others.iter().any(|other| is_alike(&other)) {
        "as 4 floats a point, all its columns are similar".to_owned()
    } else {
        return Ok(());
    };
    let as_kitti = match own.divides {
        true => "; `--columns 4` reads it anyway",
        false => "",
    };
    let mut fitting: Vec<&Fit> = others.iter().filter(|other| other.is_possible()).collect();
    fitting.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    let most = fitting.first().map_or(0.0, |best| best.explained);
    fitting.retain(|fit| fit.explained >= WORTH_NAMING * most);
    let named: Vec<String> = fitting
        .iter()
        .take(3)
        .map(|fit| format!("{} (`--columns {}`)", fit.layout.words(), fit.layout))
        .collect();
    Err(match named.as_slice() {
        [] => {
            format!("{why}; no other known layout fits: the file is cut short or of another kind")
        }
        [best] => format!("{why}; {best} would fit{as_kitti}"),
        [best, others @ ..] => {
            let others = others.join(" or ");
            format!("{why}; {best} would fit best, else {others}{as_kitti}")
        }
    })
}

/// Fit of a layout to a file.
struct Fit {
    layout: BinLayout,
    /// True if the file length is a multiple of the record length, as far as known.
    divides: bool,
    /// Fraction of sample points with implausible coordinates.
    absurd: f64,
    /// Fraction of the variance explained by the columns.
    explained: f64,
}

impl Fit {
    fn new(layout: BinLayout, sample: &[u8], size_bytes: Option<u64>) -> Fit {
        let (columns, size) = (layout.columns, layout.scalar.size());
        let numbers = sample.chunks_exact(size);
        let numbers: Vec<f64> = numbers
            .filter_map(|bytes| layout.scalar.decode(bytes))
            .collect();
        let points = numbers.chunks_exact(columns);
        let count = points.len().max(1) as f64;
        let share = |is: fn(&[f64]) -> bool| {
            points.clone().filter(|point| is(point)).count() as f64 / count
        };
        // Some writers store rays without return as NaN.
        let is_absurd = |point: &[f64]| {
            let axes = point.get(..3).unwrap_or_default();
            !axes.iter().all(|c| c.is_nan())
                && axes
                    .iter()
                    .any(|c| *c != 0.0 && !COORDINATES_M.contains(&c.abs()))
        };
        // The lower halves of short doubles are 0: read as floats, x and z of all points are 0.
        let is_half =
            |point: &[f64]| matches!(point, [x, y, z, ..] if *x == 0.0 && *y != 0.0 && *z == 0.0);
        let halves = Some(share(is_half)).filter(|share| *share > MOST_HALVES);
        Fit {
            layout,
            divides: size_bytes.is_none_or(|size| size % layout.bytes() as u64 == 0),
            absurd: halves.unwrap_or_else(|| share(is_absurd)),
            explained: match numbers.len() {
                MIN_NUMBERS.. => explained(&numbers, columns),
                _ => 0.0,
            },
        }
    }

    fn is_possible(&self) -> bool {
        self.divides && self.absurd <= MAX_ABSURD
    }
}

/// Correlation ratio: fraction of the variance between columns, of magnitudes or of
/// values, whichever is larger; both in logarithms, so that units have no weight.
fn explained(numbers: &[f64], columns: usize) -> f64 {
    let magnitude = |v: f64| (v.abs() + 1e-3).ln();
    let ratios = [magnitude, f64::asinh].map(|feature| {
        let (mut sums, mut all, mut squares, mut count) =
            (vec![(0.0, 0.0); columns], 0.0, 0.0, 0.0);
        for point in numbers.chunks_exact(columns) {
            for (value, (sum, n)) in point.iter().zip(&mut sums) {
                let value = feature(if value.is_finite() { *value } else { 0.0 });
                *sum += value;
                *n += 1.0;
                all += value;
                squares += value * value;
                count += 1.0;
            }
        }
        let about = all * all / count;
        let between: f64 = sums.iter().map(|(sum, n)| sum * sum / n).sum();
        let total = squares - about;
        match total > 1e-9 * squares {
            true => (between - about) / total,
            false => 0.0,
        }
    });
    ratios.into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a scanner in a street, ring after ring, with so many columns.
    fn scan(columns: usize) -> Vec<f64> {
        let mut numbers = Vec::new();
        for i in 0..3000_u32 {
            let turn = f64::from(i) * 0.0123;
            let range_m = 4.0 + 15.0 * (f64::from(i) * 0.618).fract();
            let ring = f64::from(i % 32);
            let more = [0.3 * (f64::from(i) * 0.754).fract(), ring, 0.1, 1.0, 200.0];
            let point = [
                range_m * turn.cos(),
                range_m * turn.sin(),
                -1.7 + 0.05 * ring,
            ];
            numbers.extend(point.into_iter().chain(more).take(columns));
        }
        numbers
    }

    fn bytes(numbers: &[f64], layout: BinLayout) -> Vec<u8> {
        let encode = |v: &f64| match layout.scalar {
            Scalar::F64 => v.to_le_bytes().to_vec(),
            _ => (*v as f32).to_le_bytes().to_vec(),
        };
        numbers.iter().flat_map(encode).collect()
    }

    fn checked(layout: BinLayout) -> Result<(), String> {
        let bytes = bytes(&scan(layout.columns), layout);
        check_kitti(&bytes, Some(bytes.len() as u64))
    }

    #[test]
    fn layouts_are_told_apart_by_their_columns() {
        assert_eq!(checked(BinLayout::KITTI), Ok(()));
        for layout in KNOWN.into_iter().skip(1) {
            let why = checked(layout).unwrap_err();
            assert!(
                why.contains(&format!("`--columns {layout}`")),
                "{layout}: {why}"
            );
        }
        let doubles = checked(BinLayout::doubles(3)).unwrap_err();
        assert!(doubles.contains("implausible coordinates"), "{doubles}");
        let five = checked(BinLayout::floats(5)).unwrap_err();
        assert!(
            five.contains("columns are similar; 5 floats (`--columns 5`) would fit"),
            "{five}"
        );
    }

    #[test]
    fn points_that_are_alike_in_all_columns_are_believed() {
        for seed in 0..20_u32 {
            let number =
                |i: u32| 50.0 * (f64::from(i + 1) * 0.618_033_988_7 + f64::from(seed)).fract();
            for count in [4, 400, 4000] {
                let cube: Vec<f64> = (0..count).map(number).collect();
                let cube = bytes(&cube, BinLayout::KITTI);
                assert_eq!(
                    check_kitti(&cube, Some(cube.len() as u64)),
                    Ok(()),
                    "{seed}"
                );
            }
        }
        assert_eq!(check_kitti(&[], Some(0)), Ok(()));
        assert_eq!(check_kitti(&[0; 4096], Some(4096)), Ok(()));
        let nans = f32::NAN.to_le_bytes().repeat(4096);
        assert_eq!(check_kitti(&nans, None), Ok(()));
    }

    #[test]
    fn lengths_that_do_not_fit_are_named() {
        let whole = bytes(&scan(4), BinLayout::KITTI);
        let cut = &whole[..whole.len() - 3];
        let why = check_kitti(cut, Some(cut.len() as u64)).unwrap_err();
        assert!(
            why.contains("47997 bytes") && why.contains("cut short"),
            "{why}"
        );
        // 2501 points of 3 floats.
        let three = bytes(&scan(3)[..7503], BinLayout::floats(3));
        let why = check_kitti(&three, Some(three.len() as u64)).unwrap_err();
        assert!(
            why.contains("30012 bytes") && why.contains("`--columns 3`"),
            "{why}"
        );
    }

    #[test]
    fn layouts_are_typed_as_they_are_shown() {
        for text in ["3", "4", "5", "64", "3d", "10d"] {
            assert_eq!(text.parse::<BinLayout>().unwrap().to_string(), text);
        }
        assert_eq!("4".parse(), Ok(BinLayout::KITTI));
        for text in [
            "",
            "2",
            "65",
            "d",
            "-3",
            "4f",
            "4 d",
            "99999999999999999999",
        ] {
            let error = text.parse::<BinLayout>().unwrap_err();
            assert!(error.contains("3 to 64"), "{error}");
        }
    }
}
