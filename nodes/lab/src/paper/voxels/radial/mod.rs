//! Fig. 4: distances of the points of the own and of adjacent cells.

mod spread;

use super::report_options::Options;
use super::sample::Samples;
use crate::AnyError;
use crate::report::plot::{Layout, curves, key, svg, title};
use crate::report::{Cell, Check, Figure, Section, Table, Verdict, numbers};
use lattice_core::lattice::LatticeKind;
use spread::{Cells, Spread};
use std::iter;

/// Allowed error of a figure: a share of it, and half of its last digit.
const TOLERANCE: f64 = 0.002;
const DIGIT: f64 = 0.5e-4;
/// Allowed error of a change, %: that of its two figures, and half of its last digit.
const CHANGE_TOLERANCE: f64 = 0.25;

/// A set and what is known of it: number of cells, mean, standard deviation, nearest and farthest.
type Known = (LatticeKind, Cells, usize, [f64; 4]);

#[rustfmt::skip]
const KNOWN: [Known; 16] = [
    (LatticeKind::Cubic, Cells::Own, 1, [0.4803, 0.1390, 0.0, 0.8660]),
    (LatticeKind::Bcc, Cells::Own, 1, [0.4691, 0.1249, 0.0, 0.7043]),
    (LatticeKind::Fcc, Cells::Own, 1, [0.4695, 0.1257, 0.0, 0.7937]),
    (LatticeKind::Mcc, Cells::Own, 1, [0.4693, 0.1254, 0.0, 0.7282]),
    (LatticeKind::Hex, Cells::Own, 1, [0.4813, 0.1369, 0.0, 0.7972]),
    (LatticeKind::HexOptimal, Cells::Own, 1, [0.4754, 0.1330, 0.0, 0.7960]),
    (LatticeKind::Cubic, Cells::Printed, 26, [1.4776, 0.3780, 0.5000, 2.5981]),
    (LatticeKind::Cubic, Cells::Faces, 6, [1.0848, 0.2709, 0.5000, 1.6583]),
    (LatticeKind::Bcc, Cells::Printed, 14, [1.2313, 0.2828, 0.5456, 1.9160]),
    (LatticeKind::Fcc, Cells::Printed, 12, [1.1927, 0.2711, 0.5612, 1.7748]),
    (LatticeKind::Mcc, Cells::Printed, 14, [1.2376, 0.2903, 0.5493, 2.1285]),
    (LatticeKind::Hex, Cells::Printed, 18, [1.3532, 0.3383, 0.4163, 2.1899]),
    (LatticeKind::Cubic, Cells::Touching, 26, [1.4776, 0.3780, 0.5000, 2.5981]),
    (LatticeKind::Bcc, Cells::Touching, 14, [1.2313, 0.2828, 0.5456, 1.9160]),
    (LatticeKind::Fcc, Cells::Touching, 18, [1.3406, 0.3440, 0.5612, 2.3811]),
    (LatticeKind::Hex, Cells::Touching, 20, [1.3680, 0.3362, 0.4163, 2.1899]),
];

pub fn section(options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Section, AnyError> {
    let samples = Samples::new(options);
    let mut spreads = Vec::new();
    let mut checks = Vec::new();
    // MCC's 14 printed cells are all that touch; the optimal prisms touch as those of the paper do.
    let more = [
        (LatticeKind::Mcc, Cells::Touching),
        (LatticeKind::HexOptimal, Cells::Touching),
    ];
    let wanted = KNOWN.iter().map(|known| (known.0, known.1)).chain(more);
    let count = KNOWN.len() + more.len();
    let known = KNOWN.iter().map(Some).chain(iter::repeat(None));
    for (number, (set, known)) in wanted.zip(known).enumerate() {
        let mut tell = |done| progress((number as f64 + done) / count as f64);
        let spread = Spread::new(set, &samples, options.seed, &mut tell)?;
        if let Some(known) = known {
            checks.extend(against(&spread, known));
        }
        spreads.push(spread);
    }
    let mut changes = Vec::new();
    for comparison in COMPARISONS {
        let (change, checked) = compared(&spreads, comparison)?;
        checks.extend(checked);
        changes.push(change);
    }
    let said = |number: usize, words: fn(&Change) -> String| {
        changes.get(number).map_or(String::new(), words)
    };
    let columns =
        "lattice|cells|number|mean|mean, random|±|std|std, random|±|nearest|farthest|range";
    let compared = "compared|std (%)|±|std, exact (%)|range, exact (%)";
    Ok(Section {
        id: "fig4".into(),
        title: "Fig. 4: distances of points in the own and in adjacent cells".into(),
        claim: "Points in adjacent cells of FCC are less spread in distance than those of cubic: 30 % smaller \
                standard deviation, 40 % smaller range. BCC, FCC and MCC also have less spread within the cell."
            .into(),
        finding: format!(
            "With the paper's sets the standard deviation is {} and the range {:.1} % against cubic: as printed. \
             But that compares the 12 face neighbours of FCC with all 26 touching cubes. Like for like, FCC gains \
             little, and of faces only nothing; the tightest neighbourhood of touching cells is that of BCC.",
            said(0, |change| format!("{:+.3} ± {:.3} %", change.std, change.half)),
            changes.first().map_or(f64::NAN, |change| change.range),
        ),
        verdict: Verdict::Corrected(format!(
            "The numbers hold for 12 cells against 26. All touching cells of FCC against those of cubic: {}; of \
             BCC: {}.",
            said(1, Change::words),
            said(2, Change::words),
        )),
        checks,
        tables: vec![
            Table::new("fig4_compared", "Spread of the distances of adjacent cells against cubic, with 95 % intervals", compared, changes.iter().map(Change::row)),
            Table::new("fig4", format!(
                    "Distances from a lattice point, cell sides: exact, and of {} random points in each cell with \
                     95 % intervals",
                    samples.points()
                ), columns, spreads.iter().map(Spread::row)),
        ],
        figures: vec![Figure::new("fig4", "Density of the distance of points from a lattice point, unit volume. Left peaks: own cell. Right: \
                      adjacent cells; the sets of the paper (left panel) and all touching cells (right panel).", draw(&spreads)?)],
    })
}

/// A set of cells of a lattice.
type Set = (LatticeKind, Cells);

const FCC_12: Set = (LatticeKind::Fcc, Cells::Printed);
const FCC_18: Set = (LatticeKind::Fcc, Cells::Touching);
const BCC_14: Set = (LatticeKind::Bcc, Cells::Touching);

/// A name with the change of standard deviation and range as printed, %; a set, that of cubes, and the
/// change as known.
type Comparison = ((&'static str, [Option<f64>; 2]), (Set, Cells, [f64; 2]));

const COMPARISONS: [Comparison; 4] = [
    (
        ("FCC 12 to cubic 26, as the paper", PRINTED),
        (FCC_12, Cells::Printed, [-28.4, -42.2]),
    ),
    (
        ("touching: FCC 18 to cubic 26", [None; 2]),
        (FCC_18, Cells::Touching, [-9.0, -13.3]),
    ),
    (
        ("touching: BCC 14 to cubic 26", [None; 2]),
        (BCC_14, Cells::Touching, [-25.2, -34.7]),
    ),
    (
        ("faces: FCC 12 to cubic 6", [None; 2]),
        (FCC_12, Cells::Faces, [0.1, 4.8]),
    ),
];
const PRINTED: [Option<f64>; 2] = [Some(-30.0), Some(-40.0)];

/// Change of the spread of one set against that of another, %.
struct Change {
    name: &'static str,
    /// Change of the standard deviation, from random points, and half of its 95 % interval.
    std: f64,
    half: f64,
    exact_std: f64,
    range: f64,
}

/// A comparison made, and its checks.
fn compared(
    spreads: &[Spread],
    ((name, [printed_std, printed_range]), (ours, cubic, [std, range])): Comparison,
) -> Result<(Change, [Check; 3]), AnyError> {
    let find = |(kind, cells)| {
        let mut spreads = spreads.iter();
        let found = spreads.find(|spread| spread.kind == kind && spread.cells == cells);
        found.ok_or("a set of cells is compared that is not computed")
    };
    let (a, b) = (find(ours)?, find((LatticeKind::Cubic, cubic))?);
    let ratio = a.std.over(&b.std);
    let change = Change {
        name,
        std: 100.0 * (ratio.mean - 1.0),
        half: 100.0 * ratio.half,
        exact_std: 100.0 * (a.exact_std / b.exact_std - 1.0),
        range: 100.0 * (a.range() / b.range() - 1.0),
    };
    let checks = [
        ("std, random points", printed_std, std, change.std),
        ("std, exact", printed_std, std, change.exact_std),
        ("range", printed_range, range, change.range),
    ];
    let checks = checks.map(|(what, printed, expected, found)| {
        let what = format!("{name}: {what} (%)");
        let check = Check::new(what, expected, found, CHANGE_TOLERANCE);
        check.with_printed(printed)
    });
    Ok((change, checks))
}

impl Change {
    fn row(&self) -> Vec<Cell> {
        let figures = numbers(3, [self.std, self.half, self.exact_std, self.range]);
        iter::once(self.name.into()).chain(figures).collect()
    }

    fn words(&self) -> String {
        format!("std {:+.1} %, range {:+.1} %", self.exact_std, self.range)
    }
}

/// Random points and exact figures against what is known.
fn against(spread: &Spread, known: &Known) -> Vec<Check> {
    let (_, _, n, [mean, std, nearest, farthest]) = *known;
    let name = format!("{}, {}", title(spread.kind), spread.cells.name());
    let number = Check::count(format!("{name}: cells"), n, spread.n)
        .with_printed((spread.cells == Cells::Printed).then_some(n as f64));
    let figures = [
        ("mean, random points", mean, spread.mean.mean),
        ("mean, exact", mean, spread.exact_mean),
        ("std, random points", std, spread.std.mean),
        ("std, exact", std, spread.exact_std),
        ("nearest", nearest, spread.nearest),
        ("farthest", farthest, spread.farthest),
    ];
    let figures = figures.map(|(what, expected, found)| {
        let tolerance = TOLERANCE * expected + DIGIT;
        Check::new(format!("{name}: {what}"), expected, found, tolerance)
    });
    iter::once(number).chain(figures).collect()
}

fn draw(spreads: &[Spread]) -> Result<String, AnyError> {
    let key = key(&LatticeKind::ALL);
    let layout = Layout::new((500, 380), [2, 1], 130, &key);
    svg(&layout, |areas| {
        let panels = [
            (Cells::Printed, "sets of the paper"),
            (Cells::Touching, "all touching cells"),
        ];
        for (area, (cells, title)) in areas.iter().zip(panels) {
            let shown = |s: &&Spread| s.cells == cells || s.cells == Cells::Own;
            let shown: Vec<_> = spreads.iter().filter(shown).map(Spread::curve).collect();
            let x = ("distance (cell sides)", 0.0..2.6);
            curves(area, title, x, ("density", 0.0..4.0), &shown)?;
        }
        Ok(())
    })
}
