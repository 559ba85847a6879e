//! Parts whose tables were changed and whose digests were made again: rows and points are held against the manifest.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::Schema;
use lattice_core::voxels::file::MapColumns;
use lattice_fleet::files::{FileId, write_manifest};
use lattice_fleet::part::PartInfo;
use lattice_fleet::rows::TileRows;
use lattice_fleet::schema;
use lattice_fleet::tile_files::tile_folder;
use parquet::arrow::ArrowWriter;

use crate::fixture::{Recipe, json, merged, parts, refused, run, text};

/// A part, and one of its tiles with many rows.
struct Forger {
    part: PathBuf,
    info: PartInfo,
    tile: usize,
}

impl Forger {
    fn new(part: &Path) -> Forger {
        let info = PartInfo::read(&part.join("part.json")).unwrap();
        let rows = |tile: &usize| info.tiles[*tile].rows;
        let tile = (0..info.tiles.len()).max_by_key(rows).unwrap();
        Forger {
            part: part.to_owned(),
            info,
            tile,
        }
    }

    fn rows(&self) -> TileRows {
        let tile = &self.info.tiles[self.tile];
        tile.read(&self.part, &self.info.map).unwrap()
    }

    /// Writes rows with fitting digests, and with a fitting number of rows and largest count; with fitting sums of
    /// points too unless these are to differ.
    fn write(&self, rows: &TileRows, without: Option<&str>, sums_fit: bool) {
        let mut info = self.info.clone();
        let tile = &mut info.tiles[self.tile];
        let folder = tile_folder(&self.part, tile.tile);
        let voxels = folder.join("voxels.parquet");
        write_batch(
            &voxels,
            &without_column(rows.voxel_batch(tile.tile).unwrap(), without),
        );
        let labels = folder.join("labels.parquet");
        write_batch(&labels, &rows.label_batch(tile.tile).unwrap());
        tile.voxels = FileId::of(&voxels).unwrap();
        tile.labels = Some(FileId::of(&labels).unwrap());
        tile.rows = rows.voxels.len() as u64;
        tile.label_rows = rows.labels.len() as u64;
        tile.max_count = rows.max_count();
        if sums_fit {
            let totals = rows.totals();
            tile.points = totals.points as u64;
            tile.labelled_points = totals.labelled_points as u64;
        }
        write_info(&self.part, info);
    }
}

fn write_info(part: &Path, mut info: PartInfo) {
    info.digest.clear();
    write_manifest(&part.join("part.json"), &info).unwrap();
}

fn write_batch(path: &Path, batch: &RecordBatch) {
    let file = fs::File::create(path).unwrap();
    let mut writer =
        ArrowWriter::try_new(file, batch.schema(), Some(schema::properties())).unwrap();
    writer.write(batch).unwrap();
    writer.close().unwrap();
}

fn without_column(batch: RecordBatch, name: Option<&str>) -> RecordBatch {
    let kept = |number: &usize| Some(batch.schema().field(*number).name().as_str()) != name;
    let kept: Vec<_> = (0..batch.num_columns()).filter(kept).collect();
    let fields: Vec<_> = kept
        .iter()
        .map(|i| batch.schema().field(*i).clone())
        .collect();
    let columns = kept.iter().map(|i| batch.column(*i).clone()).collect();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns).unwrap()
}

#[test]
fn forged_rows_are_refused_by_the_name_of_their_part() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables [1] 50%");
    let recipes = [Recipe::new(1), Recipe::new(2)];
    for recipe in &recipes {
        run([
            "to-table",
            text(&recipe.write(folder.path())),
            "-o",
            text(&tables),
        ]);
    }
    let part = parts(&tables).remove(0);
    let forger = Forger::new(&part);
    let good = forger.rows();
    assert!(good.voxels.len() > 100);
    let reach = MapColumns::offset_reach(&forger.info.map.columns().unwrap().lattice) as i64;
    type Forgery<'a> = Box<dyn Fn(&mut TileRows) + 'a>;
    let forgeries: [(&str, Forgery, Option<&str>); 10] = [
        (
            "its manifest promises",
            Box::new(|rows| {
                let half = rows.voxels.len() / 2;
                rows.voxels.truncate(half);
            }),
            None,
        ),
        (
            "its manifest promises",
            Box::new(|rows| rows.labels.truncate(3)),
            None,
        ),
        (
            "comes twice or out of order",
            Box::new(|rows| rows.voxels.extend(good.voxels.clone())),
            None,
        ),
        (
            "comes twice or out of order",
            Box::new(|rows| rows.labels.extend(good.labels.clone())),
            None,
        ),
        (
            "a count is at least 1",
            Box::new(|rows| {
                for row in &mut rows.voxels[..2] {
                    row.sums = Some([-3, 0, 0, 0]);
                }
            }),
            None,
        ),
        (
            "offset sums",
            Box::new(|rows| {
                let [count, ..] = rows.voxels[5].sums.unwrap();
                rows.voxels[5].sums = Some([count, 1 << 62, 0, 0]);
            }),
            None,
        ),
        (
            "offset sums",
            Box::new(|rows| {
                let [count, ..] = rows.voxels[5].sums.unwrap();
                rows.voxels[5].sums = Some([count, 0, 0, -(count * reach) - 1]);
            }),
            None,
        ),
        (
            "with -1 points",
            Box::new(|rows| rows.labels[2].n = -1),
            None,
        ),
        ("columns", Box::new(|_| ()), Some("sum_y")),
        ("columns", Box::new(|_| ()), Some("first_ns")),
    ];
    let (fresh, out) = (folder.path().join("fresh"), folder.path().join("out.lat"));
    for (expected, forge, without) in &forgeries {
        let mut rows = good.clone();
        forge(&mut rows);
        forger.write(&rows, *without, expected.starts_with("comes twice"));
        let places = ["merge", text(&tables), "--out", text(&fresh)];
        for map_out in [&[][..], &["--map-out", text(&out)]] {
            let said = refused(places.iter().chain(map_out));
            assert!(
                said.contains(expected) && said.contains(text(&part)),
                "{expected}: {said}"
            );
            assert!(!fresh.exists() && !out.exists(), "{expected}");
        }
        let said = refused(["status", text(&tables), "--verify"]);
        assert!(said.contains(text(&part)), "{expected}: {said}");
    }
    // Of an earlier merged map nothing changes.
    forger.write(&good, None, true);
    run(["merge", text(&tables), "--out", text(&fresh)]);
    let before = files(&fresh);
    let third = Recipe::new(3);
    run([
        "to-table",
        text(&third.write(folder.path())),
        "-o",
        text(&tables),
    ]);
    let mut rows = good.clone();
    rows.voxels.truncate(10);
    forger.write(&rows, None, false);
    refused(["merge", text(&tables), "--out", text(&fresh)]);
    assert_eq!(files(&fresh), before);
    forger.write(&good, None, true);
    run([
        "merge",
        text(&tables),
        "--out",
        text(&fresh),
        "--map-out",
        text(&out),
    ]);
    let all = recipes.iter().chain([&third]).map(Recipe::map);
    assert_eq!(fs::read(&out).unwrap(), merged(all));
    assert_eq!(
        json(&run(["status", text(&tables), "--json"]))["damaged"],
        serde_json::json!([])
    );
}

/// Paths and bytes of all files below a folder.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(self::files(&path)),
            false => files.push((path.clone(), fs::read(&path).unwrap())),
        }
    }
    files.sort();
    files
}
