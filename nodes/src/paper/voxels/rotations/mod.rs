//! Fig. 5: distortion and voxel count of clouds under random rotations.

mod measure;

use lattice_core::lattice::LatticeKind;

use super::scan::{Scan, Source, scans};
use super::{Options, unit};
use crate::evaluate::Share;
use crate::paper::estimate::Estimate;
use crate::paper::report::plot::{
    Axes, Curve, Fault, Layout, color, cumulative, curves, key, svg, title,
};
use crate::paper::report::{Cell, Check, Figure, Section, Table, Verdict};
use measure::{Laid, Measured, Turns, measure};
pub use measure::{Quantized, quantized};

/// The lattices that are rounder than cubes.
const ROUND: [LatticeKind; 3] = [LatticeKind::Bcc, LatticeKind::Fcc, LatticeKind::Mcc];
/// How far a mean distance of evenly spread points may be off, of itself.
const TOLERANCE: f64 = 0.002;
/// How far a count of evenly spread points may be off, of itself: the surface of their cube cuts a
/// different number of cells.
const COUNT_TOLERANCE: f64 = 0.005;

/// A cloud in cells of a size under turns of a kind.
struct Run<'a> {
    scan: &'a Scan,
    volume_m3: f64,
    turns: Turns,
    measured: Vec<Measured>,
}

impl Run<'_> {
    fn of(&self, laid: Laid) -> Option<&Measured> {
        self.measured.iter().find(|measured| measured.laid == laid)
    }

    fn paper(&self, kind: LatticeKind) -> Option<&Measured> {
        self.of(Laid::paper(kind))
    }

    fn cubic(&self) -> Option<&Measured> {
        self.paper(LatticeKind::Cubic)
    }

    fn count_change(&self, kind: LatticeKind) -> Option<Estimate> {
        Some(self.paper(kind)?.count_to(self.cubic()?))
    }

    fn is_drawn(&self) -> bool {
        self.scan.volumes_m3.first() == Some(&self.volume_m3)
    }

    fn name(&self) -> String {
        let Run { scan, turns, .. } = self;
        format!("{}, {} m³, {}", scan.title, self.volume_m3, turns.name())
    }
}

pub fn section(options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Section, Fault> {
    let scans = scans(options)?;
    let poses = if options.quick { 60 } else { 500 };
    let tasks: Vec<(&Scan, f64, Turns)> = scans
        .iter()
        .flat_map(|scan| scan.volumes_m3.iter().map(move |volume| (scan, *volume)))
        .flat_map(|(scan, volume)| [Turns::Any, Turns::Yaw].map(|turns| (scan, volume, turns)))
        // Evenly spread points have no vertical.
        .filter(|(scan, _, turns)| scan.source != Source::Uniform || *turns == Turns::Any)
        .collect();
    let mut runs = Vec::new();
    for (number, &(scan, volume_m3, turns)) in tasks.iter().enumerate() {
        let mut laid = LatticeKind::ALL.map(Laid::paper).to_vec();
        if turns == Turns::Yaw {
            laid.extend(ROUND.map(Laid::flat));
        }
        let mut tell = |done| progress((number as f64 + done) / tasks.len() as f64);
        let how = (turns, poses, options.seed);
        runs.push(Run {
            scan,
            volume_m3,
            turns,
            measured: measure(&scan.points, volume_m3, &laid, how, &mut tell)?,
        });
    }
    let mut checks = Vec::new();
    for run in &runs {
        checks.extend(check(run)?);
    }
    let figures = scans.iter().map(|scan| {
        let of = runs
            .iter()
            .filter(|run| run.scan.id == scan.id && run.is_drawn());
        figure(scan, &of.collect::<Vec<_>>())
    });
    let figures = figures.collect::<Result<Vec<_>, Fault>>()?;
    let said = |turns: Turns, kind: LatticeKind| {
        let drawn = runs
            .iter()
            .filter(|run| run.turns == turns && run.is_drawn());
        let scans = drawn.filter(|run| run.scan.source != Source::Uniform);
        let changes = scans.filter_map(|run| Some(100.0 * run.count_change(kind)?.mean));
        let (least, most) = ends(changes);
        format!("{least:+.1} to {most:+.1} %")
    };
    let steadier = |kind: LatticeKind| {
        let drawn = runs
            .iter()
            .filter(|run| run.turns == Turns::Any && run.is_drawn());
        let scans = drawn.filter(|run| run.scan.source != Source::Uniform);
        let ratios = scans.filter_map(|run| {
            let (own, cubic) = (spread(run.paper(kind)?), spread(run.cubic()?));
            Some(own.mean / cubic.mean)
        });
        let (low, high) = ends(ratios);
        format!("{low:.2} to {high:.2}")
    };
    Ok(Section {
        id: "fig5".into(),
        title: "Fig. 5: distortion and voxel count under random rotations".into(),
        claim: "Under uniformly random rotations BCC and FCC have less distortion than cubic, the same for random \
                and for real data. The voxel count differs little for random data; for real scans it is lower and \
                steadier than that of cubic, which is better only in rare instances."
            .into(),
        finding: format!(
            "So it is, for rotations in all directions: voxel counts of scans change by {} (BCC), {} (FCC) and {} (MCC), \
             the standard deviation of the count is {} (BCC) and {} (FCC) of that of cubic, and mean distances fall by \
             some 2.3 % as the theory says. But a robot knows where down is. Turned about the vertical alone, level \
             ground decides: FCC changes by {}, BCC by {}, the flat prisms by {}. Laying FCC and BCC on their flat \
             side gives back most of that.",
            said(Turns::Any, LatticeKind::Bcc),
            said(Turns::Any, LatticeKind::Fcc),
            said(Turns::Any, LatticeKind::Mcc),
            steadier(LatticeKind::Bcc),
            steadier(LatticeKind::Fcc),
            said(Turns::Yaw, LatticeKind::Fcc),
            said(Turns::Yaw, LatticeKind::Bcc),
            said(Turns::Yaw, LatticeKind::Hex),
        ),
        verdict: Verdict::Corrected(
            "It holds for rotations in all directions. In maps whose vertical is known FCC and BCC in the paper's axes \
             take more voxels than cubic on level ground, not fewer."
                .into(),
        ),
        checks,
        tables: vec![summary(&runs), details(&runs)],
        figures,
    })
}

/// What theory and the paper say of a run.
fn check(run: &Run) -> Result<Vec<Check>, Fault> {
    let mut checks = Vec::new();
    let name = run.name();
    let Some(cubic) = run.cubic() else {
        return Ok(checks);
    };
    if run.scan.source == Source::Uniform {
        let cube = unit(LatticeKind::Cubic)?.mean_distance_m([0; 3]);
        for measured in &run.measured {
            let kind = measured.laid.kind;
            let of_theory = unit(kind)?.mean_distance_m([0; 3]) / cube - 1.0;
            checks.push(Check {
                name: format!("{name}: mean distance of {} to cubic (%)", title(kind)),
                printed: None,
                expected: 100.0 * of_theory,
                found: 100.0 * measured.mean_to(cubic).mean,
                tolerance: 100.0 * TOLERANCE,
            });
            checks.push(Check {
                name: format!("{name}: count of {} to cubic (%)", title(kind)),
                printed: None,
                expected: 0.0,
                found: 100.0 * measured.count_to(cubic).mean,
                tolerance: 100.0 * COUNT_TOLERANCE,
            });
        }
        return Ok(checks);
    }
    if run.turns == Turns::Any && run.is_drawn() {
        for kind in ROUND {
            let Some(measured) = run.paper(kind) else {
                continue;
            };
            let lattice = title(kind);
            let mean = measured.mean_to(cubic);
            let count = measured.count_to(cubic);
            let what = format!("{name}: {lattice} has less distortion than cubic");
            checks.push(Check::that(what, mean.is_negative()));
            if run.scan.source == Source::File {
                let what = format!("{name}: {lattice} takes no more voxels than cubic");
                checks.push(Check::that(what, !count.is_positive()));
                continue;
            }
            let what = format!("{name}: {lattice} takes fewer voxels than cubic");
            checks.push(Check::that(what, count.is_negative()));
            let what = format!("{name}: {lattice} takes a steadier number than cubic");
            let (own, other) = (spread(measured), spread(cubic));
            checks.push(Check::that(
                what,
                own.mean + own.half < other.mean - other.half,
            ));
            if let Some(hex) = run.paper(LatticeKind::Hex) {
                let what = format!("{name}: {lattice} takes fewer voxels than hex");
                checks.push(Check::that(what, measured.count_to(hex).is_negative()));
            }
        }
    }
    if run.turns == Turns::Yaw && run.scan.source == Source::Simulated && run.is_drawn() {
        for (kind, more) in [(LatticeKind::Fcc, true), (LatticeKind::Hex, false)] {
            if let Some(change) = run.count_change(kind) {
                let (words, holds) = match more {
                    true => ("more", change.is_positive()),
                    false => ("fewer", change.is_negative()),
                };
                let what = format!("{name}: {} takes {words} voxels than cubic", title(kind));
                checks.push(Check::that(what, holds));
            }
        }
    }
    Ok(checks)
}

/// Standard deviation of the count.
fn spread(measured: &Measured) -> Estimate {
    Estimate::deviation_of(&measured.counts)
}

/// "-5.0 ± 0.1".
fn percent(change: Estimate) -> Cell {
    Cell::Text(format!(
        "{:+.2} ± {:.2}",
        100.0 * change.mean,
        100.0 * change.half
    ))
}

/// A row for each run: the change of the count, lattice by lattice.
fn summary(runs: &[Run]) -> Table {
    let laid: Vec<Laid> = LatticeKind::ALL
        .into_iter()
        .skip(1)
        .map(Laid::paper)
        .chain(ROUND.map(Laid::flat))
        .collect();
    let row = |run: &Run| {
        let cubic = run.cubic();
        let count = cubic.map(|cubic| Estimate::of(cubic.counts.iter().copied()).mean);
        let mut row = vec![
            Cell::Text(run.scan.title.clone()),
            run.turns.name().into(),
            Cell::Number(run.volume_m3, 3),
            count.map_or(Cell::Empty, |count| Cell::Number(count, 0)),
        ];
        row.extend(laid.iter().map(|laid| {
            let change = cubic.and_then(|cubic| Some(run.of(*laid)?.count_to(cubic)));
            change.map_or(Cell::Empty, percent)
        }));
        row
    };
    let mut columns = ["points", "turned by", "cell volume (m³)", "voxels, cubic"]
        .map(String::from)
        .to_vec();
    columns.extend(laid.iter().map(|laid| format!("{} (%)", laid.name())));
    Table {
        name: "fig5_counts".into(),
        caption: "Voxel count against cubic at the same poses, mean with 95 % interval".into(),
        columns,
        rows: runs.iter().map(row).collect(),
    }
}

fn details(runs: &[Run]) -> Table {
    let columns = [
        "points",
        "turned by",
        "cell volume (m³)",
        "lattice",
        "poses",
        "voxels",
        "±",
        "to cubic (%)",
        "±",
        "std of voxels",
        "±",
        "std to cubic",
        "mean distance (m)",
        "to cubic (%)",
        "±",
        "poses at which cubic takes fewer (%)",
        "95 % interval",
    ];
    let mut rows = Vec::new();
    for run in runs {
        let Some(cubic) = run.cubic() else {
            continue;
        };
        for measured in &run.measured {
            let mut row: Vec<Cell> = vec![
                Cell::Text(run.scan.title.clone()),
                run.turns.name().into(),
                Cell::Number(run.volume_m3, 3),
                Cell::Text(measured.laid.name()),
                measured.counts.len().into(),
            ];
            row.extend(Estimate::of(measured.counts.iter().copied()).cells(1.0, 1));
            row.extend(measured.count_to(cubic).cells(100.0, 2));
            row.extend(spread(measured).cells(1.0, 1));
            row.push(Cell::Number(spread(measured).mean / spread(cubic).mean, 3));
            let mean = Estimate::of(measured.means_m.iter().copied()).mean;
            row.push(Cell::Number(mean, 5));
            row.extend(measured.mean_to(cubic).cells(100.0, 2));
            let rare = Share::of(measured.more_than(cubic));
            row.push(Cell::Number(100.0 * rare.share.unwrap_or(f64::NAN), 1));
            let interval = format!("{:.1} to {:.1}", 100.0 * rare.low, 100.0 * rare.high);
            row.push(Cell::Text(interval));
            rows.push(row);
        }
    }
    Table {
        name: "fig5".into(),
        caption: "All lattices on all clouds, with 95 % intervals".into(),
        columns: columns.map(String::from).into(),
        rows,
    }
}

/// Cumulative distributions of a cloud: a row for each kind of turns.
fn figure(scan: &Scan, runs: &[&Run]) -> Result<Figure, Fault> {
    let layout = Layout {
        panel: (500, 310),
        columns: 2,
        rows: runs.len(),
        key_width: 130,
        key: &key(&LatticeKind::ALL),
    };
    let picture = svg(&layout, |areas| {
        let panels = runs.iter().flat_map(|run| [(run, false), (run, true)]);
        for (area, (run, counts)) in areas.iter().zip(panels) {
            let lines: Vec<Curve> = LatticeKind::ALL
                .into_iter()
                .filter_map(|kind| {
                    let measured = run.paper(kind)?;
                    let values = match counts {
                        true => &measured.counts,
                        false => &measured.means_m,
                    };
                    Some((color(kind), cumulative(values)))
                })
                .collect();
            let (what, x) = match counts {
                true => ("voxel count", "voxels"),
                false => ("distortion", "mean distance (m)"),
            };
            let name = format!("{what}, {}", run.turns.name());
            let axes = Axes {
                title: &name,
                x,
                y: "share of poses",
                xs: reach(&lines),
                ys: 0.0..1.0,
            };
            curves(area, &axes, &lines)?;
        }
        Ok(())
    })?;
    Ok(Figure {
        name: format!("fig5_{}", scan.id),
        caption: format!(
            "{} points, {}, cells of {} m³: share of {} poses with at most so much distortion (left) and so many voxels \
             (right).",
            scan.points.len(),
            scan.title,
            scan.volumes_m3.first().copied().unwrap_or(f64::NAN),
            runs.first()
                .and_then(|run| run.cubic())
                .map_or(0, |m| m.counts.len()),
        ),
        svg: picture,
    })
}

/// Least and greatest.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    })
}

/// From the least to the greatest x of some lines, and a little more.
fn reach(lines: &[Curve]) -> std::ops::Range<f64> {
    let xs = lines
        .iter()
        .flat_map(|(_, points)| points.iter().map(|p| p.0));
    let (low, high) = ends(xs);
    let room = 0.04 * (high - low).max(1e-9);
    low - room..high + room
}
