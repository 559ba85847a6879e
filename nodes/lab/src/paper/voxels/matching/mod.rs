//! Fig. 6: position errors of scan matching.

mod compare;
mod draw;
mod group;
mod judge;
mod scenes;
mod trials;

use super::report_options::Options;
use crate::AnyError;
use crate::report::plot::title;
use crate::report::{Cell, Figure, Section, Table};
use compare::{Estimate, Quantiles, SHARES};
use group::{Group, Played};
use judge::{ELSEWHERE, checks, finding, verdict};
use lattice_core::lattice::LatticeKind;
use scenes::{Source, scenes};

/// Trials of a scene, and of a quick run.
const TRIALS: (usize, usize) = (600, 24);
/// Resamples of the trials, and of a quick run.
const RESAMPLES: (usize, usize) = (2000, 400);

pub fn section(options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Section, AnyError> {
    let pick = |(full, quick): (usize, usize)| if options.quick { quick } else { full };
    let (sources, scenes) = scenes(options.seed, options.pairs.as_deref(), &options.pair_files)?;
    let all = scenes.len() as f64;
    let mut played = Vec::new();
    for (number, scene) in scenes.into_iter().enumerate() {
        let source = sources.get(scene.source).ok_or("a scene has no scans")?;
        let mut tell = |done: f64| progress((number as f64 + done) / all);
        let n = pick(TRIALS);
        let trials = trials::run(&scene, number, source, options.seed, n, &mut tell)?;
        let quantiles = Quantiles::of(&trials, options.seed, number, pick(RESAMPLES));
        played.push(Played {
            scene,
            trials,
            quantiles,
        });
    }
    // Scenes of a place follow each other.
    let places = played.chunk_by(|a, b| a.scene.place == b.scene.place);
    let groups = places.filter_map(|members| {
        let place = members.first()?.scene.place.as_str();
        Some((place, Group::of(&members.iter().collect::<Vec<_>>())?))
    });
    let groups: Vec<(&str, Group)> = groups.collect();
    let (_, rooms) = groups.first().ok_or("there are no rooms")?;
    let doubt_m = sources.iter().find_map(Source::doubt_m);
    Ok(Section {
        id: "fig6".into(),
        title: "Fig. 6: position errors of scan matching".into(),
        claim: "Matched by multi-resolution occupied voxel lists, 3D laser scans of an office have lower \
                position errors with the FCC lattice than with cubic, and fewer outliers. The box plot has no \
                numbers in the text."
            .into(),
        finding: finding(&groups, pick(TRIALS), doubt_m),
        verdict: verdict(&groups),
        checks: if options.quick { Vec::new() } else { checks(rooms) },
        tables: vec![errors_table(&played), change_table(&played, &groups)],
        figures: vec![
            Figure::new("fig6", format!(
                    "Position errors of {} alignments a box. Whiskers: the last value within 1.5 \
                     interquartile ranges; dots: beyond; dark band: 95 % interval of the median. All lattices \
                     of a panel have the same scans, starts, and orientations.",
                    pick(TRIALS)
                ), draw::boxes_of(&played)?),
            Figure::new("fig6_change", "Change of the error against cubic with 95 % intervals (paired bootstrap). Full: \
                          median. Hollow: 95th percentile. Below 0 is better than cubic. A bar that reaches the border goes on.", draw::changes_of(&played)?),
        ],
    })
}

fn between(low: f64, high: f64, digits: usize) -> Cell {
    Cell::Text(format!("{low:.digits$} to {high:.digits$}"))
}

fn errors_table(played: &[Played]) -> Table {
    let mut rows = Vec::new();
    for Played {
        scene,
        trials,
        quantiles,
    } in played
    {
        for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate() {
            let errors_m = trials.errors_m(lattice);
            let far = errors_m.iter().filter(|e| **e > scene.side_m).count();
            let [side, start] = [(scene.side_m, 2), (scene.start_m, 1)];
            let [side, start] = [side, start].map(|(value, digits)| Cell::Number(value, digits));
            let kind = title(kind).into();
            let mut row = vec![
                scene.place.clone().into(),
                side,
                start,
                kind,
                errors_m.len().into(),
            ];
            for share in 0..SHARES.len() {
                let Estimate { value, low, high } = quantiles.estimate(share, lattice);
                row.push(Cell::Number(value, 4));
                row.push(between(low, high, 4));
            }
            let largest = errors_m.iter().copied().fold(0.0, f64::max);
            row.extend([Cell::Number(largest, 3), far.into()]);
            row.push(Cell::Number(trials.evaluations(lattice), 0));
            rows.push(row);
        }
    }
    let columns = "scans|cells (m)|start ± (m)|lattice|trials|median (m)|95 % interval|\
        95th percentile (m)|95 % interval|largest (m)|over one cell side|poses tried";
    Table::new(
        "fig6",
        "Position errors of the aligned scans; poses tried: on average",
        columns,
        rows,
    )
}

fn change_table(played: &[Played], groups: &[(&str, Group)]) -> Table {
    let alone = |p: &Played| Some((p.scene.title(), Group::of(&[p])?, false));
    let mut all: Vec<(String, Group, bool)> = played.iter().filter_map(alone).collect();
    all.extend(
        groups
            .iter()
            .enumerate()
            .map(|(number, (place, group))| (format!("{place}, all"), group.clone(), number == 0)),
    );
    let mut rows = Vec::new();
    for (place, group, rooms) in all {
        for (lattice, kind) in LatticeKind::ALL.into_iter().enumerate().skip(1) {
            let mut row: Vec<Cell> = vec![place.clone().into(), title(kind).into()];
            for (share, of) in group.change.iter().enumerate() {
                let Estimate { value, low, high } = of[lattice];
                row.push(Cell::Number(value, 1));
                row.push(between(low, high, 1));
                let elsewhere = rooms.then_some(ELSEWHERE[lattice][share]);
                row.push(Cell::number(elsewhere, 1));
            }
            row.push(Cell::Number(group.evaluations[lattice], 1));
            rows.push(row);
        }
    }
    let columns = "scans|lattice|median (%)|95 % interval|in another simulation|95th percentile (%)|\
        95 % interval|in another simulation|poses tried (%)";
    Table::new(
        "fig6_change",
        "Change against cubic in the same trials; several settings: geometric mean",
        columns,
        rows,
    )
}
