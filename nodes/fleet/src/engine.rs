//! The data engine: Apache DataFusion in this process, or a cluster of Apache Ballista with the same plan.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::dataframe::DataFrame;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::{
    ListingOptions, ListingTable, ListingTableConfig, ListingTableUrl,
};
use datafusion::execution::memory_pool::FairSpillPool;
use datafusion::execution::runtime_env::RuntimeEnvBuilder;
use datafusion::prelude::{SessionConfig, SessionContext};
use futures::StreamExt;
use url::Url;

use crate::files::at;
use crate::rows::{TileRows, Totals, labels_of, totals_of, voxels_of};
use crate::tile::Tile;
use crate::{AnyError, Result, schema};

/// Merge of voxels: sums of integers, which do not depend on the order of rows.
const MERGE_VOXELS: &str = "
    SELECT tile, ix, iy, iz, SUM(count) AS count, SUM(sum_x) AS sum_x, SUM(sum_y) AS sum_y,
        SUM(sum_z) AS sum_z, MIN(first_ns) AS first_ns, MAX(last_ns) AS last_ns, COUNT(*) AS merged_rows
    FROM voxels GROUP BY tile, ix, iy, iz";
const MERGE_LABELS: &str = "
    SELECT tile, ix, iy, iz, label, SUM(n) AS n, COUNT(*) AS merged_rows
    FROM labels GROUP BY tile, ix, iy, iz, label";

/// Choice of the engine: `embedded` or `ballista://HOST:PORT`.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum Engine {
    /// DataFusion in this process.
    #[default]
    Embedded,
    /// Host and port of a Ballista scheduler.
    Ballista(String),
}

impl FromStr for Engine {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Engine, String> {
        match (text, text.strip_prefix("ballista://")) {
            ("embedded", _) => Ok(Engine::Embedded),
            (_, Some(place)) if place.contains(':') => Ok(Engine::Ballista(place.to_owned())),
            _ => Err(format!(
                "engine {text:?} is neither `embedded` nor ballista://HOST:PORT"
            )),
        }
    }
}

/// Limits of the engine in this process.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Threads.
    pub threads: usize,
    /// Memory for grouping; more is spilled to temporary files.
    pub memory_bytes: usize,
}

impl Engine {
    /// Creates a session of the engine, which spills to a folder.
    pub async fn session(&self, limits: &Limits, spill: &Path) -> Result<SessionContext> {
        match self {
            Engine::Embedded => {
                let config = SessionConfig::new().with_target_partitions(limits.threads.max(1));
                let pool = FairSpillPool::new(limits.memory_bytes);
                let runtime = RuntimeEnvBuilder::new()
                    .with_memory_pool(Arc::new(pool))
                    .with_temp_file_path(spill)
                    .build_arc()?;
                Ok(SessionContext::new_with_config_rt(config, runtime))
            }
            #[cfg(feature = "ballista")]
            Engine::Ballista(place) => crate::cluster::session(place).await,
            #[cfg(not(feature = "ballista"))]
            Engine::Ballista(place) => Err(format!(
                "ballista://{place}: this lattice-fleet was built without the feature `ballista`"
            )
            .into()),
        }
    }
}

/// Parquet files to merge into one map, by absolute paths.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Inputs {
    /// Files of `voxels`.
    pub voxels: Vec<PathBuf>,
    /// Files of `labels`.
    pub labels: Vec<PathBuf>,
}

/// Merged rows of a tile, and the totals of the rows that the engine has read for them.
#[derive(Clone, Default, Debug)]
pub struct MergedRows {
    /// Rows, not sorted.
    pub rows: TileRows,
    /// Totals of the input rows.
    pub read: Totals,
}

/// Merges the rows of all inputs to one map, tile by tile.
pub async fn merge(
    session: &SessionContext,
    inputs: &Inputs,
) -> Result<BTreeMap<Tile, MergedRows>> {
    let mut tiles = BTreeMap::<Tile, MergedRows>::new();
    let schema = schema::voxels();
    let each = |batch: &RecordBatch, tiles: &mut BTreeMap<Tile, MergedRows>| -> Result {
        voxels_of(batch, &mut |tile, row| {
            tiles.entry(tile).or_default().rows.voxels.push(row);
            Ok(())
        })?;
        totals_of(batch, "count", |tile, rows, points| {
            tiles.entry(tile).or_default().read.add_voxels(rows, points);
        })
    };
    if let Some(merged) = query(session, "voxels", schema, &inputs.voxels, MERGE_VOXELS).await? {
        let mut batches = merged.execute_stream().await?;
        while let Some(batch) = batches.next().await {
            each(&batch?, &mut tiles)?;
        }
    }
    let schema = schema::labels();
    if let Some(merged) = query(session, "labels", schema, &inputs.labels, MERGE_LABELS).await? {
        let mut batches = merged.execute_stream().await?;
        while let Some(batch) = batches.next().await {
            let batch = batch?;
            labels_of(&batch, &mut |tile, row| {
                tiles.entry(tile).or_default().rows.labels.push(row);
                Ok(())
            })?;
            totals_of(&batch, "n", |tile, rows, points| {
                tiles.entry(tile).or_default().read.add_labels(rows, points);
            })?;
        }
    }
    Ok(tiles)
}

/// A query over Parquet files as one table; none without files.
pub async fn query(
    session: &SessionContext,
    table: &str,
    schema: SchemaRef,
    files: &[PathBuf],
    sql: &str,
) -> Result<Option<DataFrame>> {
    if files.is_empty() {
        return Ok(None);
    }
    let places = files.iter().map(|path| literal_url(path));
    let places = places.collect::<Result<Vec<_>>>()?;
    let options = ListingOptions::new(Arc::new(ParquetFormat::default()));
    let config = ListingTableConfig::new_with_multi_paths(places);
    let config = config.with_listing_options(options).with_schema(schema);
    session.deregister_table(table)?;
    session.register_table(table, Arc::new(ListingTable::try_new(config)?))?;
    Ok(Some(session.sql(sql).await.map_err(AnyError::from)?))
}

/// URL of one file. A path would be read as a pattern where it has `*`, `?` or `[`.
fn literal_url(path: &Path) -> Result<ListingTableUrl> {
    let url = Url::from_file_path(path);
    let url = url.map_err(|()| at(path, "is not an absolute path"))?;
    Ok(ListingTableUrl::try_new(url, None)?)
}
