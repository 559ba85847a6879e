//! Values and sets of columns, in square tiles.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

/// Column of the grid: floor of x and y over the resolution.
pub(super) type Column = [i32; 2];

/// Binary logarithm of a tile's edge in columns.
const SHIFT: u32 = 3;
/// Columns along the edge of a tile.
const SIDE: i32 = 1 << SHIFT;
/// Columns of a tile.
const CELLS: usize = (SIDE * SIDE) as usize;

/// Tile of a column, and the place of the column in it.
fn place(column: Column) -> (Column, usize) {
    let [x, y] = column.map(|i| (i & (SIDE - 1)) as usize);
    (column.map(|i| i >> SHIFT), y << SHIFT | x)
}

/// Column at a place of a tile.
fn column(tile: Column, place: usize) -> Column {
    let [x, y] = [place & (SIDE as usize - 1), place >> SHIFT].map(|i| i as i32);
    [tile[0] << SHIFT | x, tile[1] << SHIFT | y]
}

/// Values of columns. Neighbours mostly have the same tile, so that few tiles are looked up.
#[derive(Clone, Debug)]
pub(super) struct Tiles<T> {
    /// Each with a value at least.
    tiles: FxHashMap<Column, Tile<T>>,
}

#[derive(Clone, Debug)]
struct Tile<T> {
    count: usize,
    cells: Vec<Option<T>>,
}

impl<T> Default for Tiles<T> {
    fn default() -> Tiles<T> {
        Tiles {
            tiles: FxHashMap::default(),
        }
    }
}

impl<T> Tiles<T> {
    pub(super) fn get(&self, column: Column) -> Option<&T> {
        let (tile, place) = place(column);
        self.tiles.get(&tile)?.cells.get(place)?.as_ref()
    }

    pub(super) fn get_mut(&mut self, column: Column) -> Option<&mut T> {
        let (tile, place) = place(column);
        self.tiles.get_mut(&tile)?.cells.get_mut(place)?.as_mut()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    pub(super) fn set(&mut self, column: Column, value: Option<T>) {
        if value.is_some() || self.get(column).is_some() {
            self.update(column, |cell| *cell = value);
        }
    }

    /// Changes the value of a column; `None` is none.
    pub(super) fn update<R>(
        &mut self,
        column: Column,
        change: impl FnOnce(&mut Option<T>) -> R,
    ) -> Option<R> {
        let (tile, place) = place(column);
        let content = self.tiles.entry(tile).or_insert_with(|| Tile {
            count: 0,
            cells: (0..CELLS).map(|_| None).collect(),
        });
        let cell = content.cells.get_mut(place)?;
        let before = usize::from(cell.is_some());
        let result = change(cell);
        content.count = content.count + usize::from(cell.is_some()) - before;
        if content.count == 0 {
            self.tiles.remove(&tile);
        }
        Some(result)
    }

    /// Columns and their values, unordered.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Column, &T)> {
        self.tiles.iter().flat_map(|(tile, content)| {
            let values = content.cells.iter().enumerate();
            values.filter_map(|(place, value)| Some((column(*tile, place), value.as_ref()?)))
        })
    }

    /// Passes the values of the columns of a square around a column.
    pub(super) fn for_square(&self, [x, y]: Column, reach: i32, mut f: impl FnMut(&T)) {
        let ends = |i: i32| [i.saturating_sub(reach), i.saturating_add(reach)];
        let ([left, right], [low, high]) = (ends(x), ends(y));
        for tile_y in low >> SHIFT..=high >> SHIFT {
            for tile_x in left >> SHIFT..=right >> SHIFT {
                let Some(tile) = self.tiles.get(&[tile_x, tile_y]) else {
                    continue;
                };
                // Part of a range of columns in the tile.
                let part = |tile: i32, begin: i32, end: i32| {
                    let first = tile << SHIFT;
                    let within = |i: i32| (i - first).clamp(0, SIDE - 1) as usize;
                    within(begin)..=within(end)
                };
                let columns = part(tile_x, left, right);
                for row in part(tile_y, low, high) {
                    let row = row << SHIFT;
                    let cells = tile.cells.get(row + columns.start()..=row + columns.end());
                    cells.into_iter().flatten().flatten().for_each(&mut f);
                }
            }
        }
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.tiles.values().map(|tile| tile.count).sum()
    }
}

/// Columns of a tile whose bits are set.
fn columns_of(tile: Column, bits: u64) -> impl Iterator<Item = Column> {
    let places = (0..CELLS).filter(move |place| bits >> place & 1 == 1);
    places.map(move |place| column(tile, place))
}

/// Set of columns: a bit each.
#[derive(Clone, Debug, Default)]
pub(super) struct ColumnSet {
    tiles: FxHashMap<Column, u64>,
}

impl ColumnSet {
    pub(super) fn insert(&mut self, column: Column) {
        let (tile, place) = place(column);
        *self.tiles.entry(tile).or_default() |= 1 << place;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    fn iter(&self) -> impl Iterator<Item = Column> {
        let tiles = self.tiles.iter();
        tiles.flat_map(|(tile, bits)| columns_of(*tile, *bits))
    }

    /// Rows of tiles that columns within a reach of a row may be in, on either side.
    pub(super) fn rows_within(reach: i32) -> i32 {
        (reach + SIDE - 1) / SIDE
    }

    /// Columns by their row of tiles; those of a tile follow each other.
    pub(super) fn rows(&self) -> BTreeMap<i32, Vec<Column>> {
        let mut rows: BTreeMap<i32, Vec<Column>> = BTreeMap::new();
        for (tile, bits) in &self.tiles {
            let row = rows.entry(tile[1]).or_default();
            row.extend(columns_of(*tile, *bits));
        }
        rows
    }

    /// Columns within a reach along both axes of any of these.
    pub(super) fn around(&self, reach: i32) -> ColumnSet {
        let (mut wide, mut all) = (ColumnSet::default(), ColumnSet::default());
        for [x, y] in self.iter() {
            let beside = (-reach..=reach).filter_map(|dx| x.checked_add(dx));
            beside.for_each(|x| wide.insert([x, y]));
        }
        for [x, y] in wide.iter() {
            let beside = (-reach..=reach).filter_map(|dy| y.checked_add(dy));
            beside.for_each(|y| all.insert([x, y]));
        }
        all
    }
}
