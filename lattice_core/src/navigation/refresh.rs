//! Surfaces of the columns around changed samples.

use rayon::prelude::*;

use super::columns::Columns;
use super::options::GroundOptions;
use super::surfaces::{self, ColumnState, Layer};
use super::terrain;
use super::tiles::{Column, ColumnSet, Tiles};

/// Columns after which surfaces are judged: bounds the layers that are kept until then. Small maps of tests have many
/// batches too.
const BATCH: usize = if cfg!(test) { 64 } else { 1 << 14 };

/// Brings surfaces and their inclinations up to date where samples changed; returns the number of windows that were
/// gathered for it.
///
/// Surfaces are judged once those around them are found, with the layers that were gathered for them.
pub(super) fn refresh(
    columns: &Columns,
    states: &mut Tiles<ColumnState>,
    changed: &ColumnSet,
    ground: &GroundOptions,
) -> u64 {
    // Inclinations reach further than surfaces.
    let beyond = terrain::REACH * columns.stride();
    let seen = changed.around(columns.reach());
    let mut waiting = match states.is_empty() {
        true => seen.rows(),
        false => changed.around(columns.reach() + beyond).rows(),
    };
    let mut seen = seen.rows();
    let mut refresh = Refresh {
        columns,
        states,
        ground,
        layers: Tiles::default(),
        gathered: 0,
    };
    while !seen.is_empty() {
        let mut batch = Vec::new();
        while let Some(row) = seen.first_entry().filter(|_| batch.len() < BATCH) {
            batch.extend(row.remove());
        }
        refresh.find(&batch);
        let end = seen.first_key_value().map(|(row, _)| *row);
        let is_surrounded =
            |row: i32| end.is_none_or(|end| row + ColumnSet::rows_within(beyond) < end);
        let mut batch = Vec::new();
        while let Some(row) = waiting
            .first_entry()
            .filter(|row| is_surrounded(*row.key()))
        {
            batch.extend(row.remove());
        }
        refresh.judge(batch);
    }
    refresh.gathered
}

/// State of [`refresh`].
struct Refresh<'a> {
    columns: &'a Columns,
    states: &'a mut Tiles<ColumnState>,
    ground: &'a GroundOptions,
    /// Layers of surfaces that were found and not yet judged.
    layers: Tiles<Vec<Layer>>,
    gathered: u64,
}

impl Refresh<'_> {
    fn find(&mut self, batch: &[Column]) {
        let found: Vec<_> = (batch.par_iter())
            .map(|column| surfaces::of_column(self.columns, *column, self.ground))
            .collect();
        self.gathered += batch.len() as u64;
        for (column, found) in batch.iter().zip(found) {
            let (state, layers) = found.unzip();
            self.states.set(*column, state);
            self.layers.set(*column, layers);
        }
    }

    fn judge(&mut self, mut batch: Vec<Column>) {
        let has_surfaces = |state: &ColumnState| !state.surfaces.is_empty();
        batch.retain(|column| self.states.get(*column).is_some_and(has_surfaces));
        let terrains: Vec<_> = (batch.par_iter())
            .map(|column| {
                let kept = self.layers.get(*column);
                let judge = |layers: &[Layer]| {
                    terrain::standable(self.columns, self.states, *column, layers, self.ground)
                };
                match kept {
                    Some(layers) => (judge(layers), 0),
                    None => (
                        judge(&surfaces::layers_of(self.columns, *column, self.ground)),
                        1,
                    ),
                }
            })
            .collect();
        for (column, (terrains, windows)) in batch.iter().zip(terrains) {
            self.layers.set(*column, None);
            self.gathered += windows;
            let surfaces = self
                .states
                .get_mut(*column)
                .map(|state| &mut state.surfaces);
            for (surface, terrain) in surfaces.into_iter().flatten().zip(terrains) {
                (surface.slope, surface.step_m) = (terrain.slope, terrain.step_m);
                surface.is_standable = terrain.is_standable;
            }
        }
    }
}
