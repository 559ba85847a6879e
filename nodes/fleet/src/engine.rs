//! The data engine: Apache DataFusion in this process, or a cluster of Apache Ballista with the same plan.

use std::collections::BTreeMap;
use std::str::FromStr;

use datafusion::dataframe::DataFrame;
use datafusion::execution::memory_pool::FairSpillPool;
use datafusion::execution::runtime_env::RuntimeEnvBuilder;
use datafusion::prelude::{ParquetReadOptions, SessionConfig, SessionContext};
use futures::StreamExt;

use crate::rows::{TileRows, labels_of, voxels_of};
use crate::tile::Tile;
use crate::{AnyError, Result};

/// One map of many: sums of integers, which no order changes.
const MERGE_VOXELS: &str = "
    SELECT tile, ix, iy, iz, SUM(count) AS count, SUM(sum_x) AS sum_x, SUM(sum_y) AS sum_y,
        SUM(sum_z) AS sum_z, MIN(first_ns) AS first_ns, MAX(last_ns) AS last_ns
    FROM voxels GROUP BY tile, ix, iy, iz";
const MERGE_LABELS: &str = "
    SELECT tile, ix, iy, iz, label, SUM(n) AS n FROM labels GROUP BY tile, ix, iy, iz, label";

/// Choice of the engine: `embedded` or `ballista://HOST:PORT`.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum Engine {
    /// DataFusion in this process.
    #[default]
    Embedded,
    /// A scheduler of Ballista, by host and port.
    Ballista(String),
}

impl FromStr for Engine {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Engine, String> {
        match (text, text.strip_prefix("ballista://")) {
            ("embedded", _) => Ok(Engine::Embedded),
            (_, Some(place)) if place.contains(':') => Ok(Engine::Ballista(place.to_owned())),
            _ => Err(format!(
                "engine {text:?} is neither embedded nor ballista://HOST:PORT"
            )),
        }
    }
}

/// Limits of the engine in this process.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Threads.
    pub threads: usize,
    /// Memory for what is grouped; beyond it goes to temporary files.
    pub memory_bytes: usize,
}

impl Engine {
    /// A session of the engine.
    pub async fn session(&self, limits: &Limits) -> Result<SessionContext> {
        match self {
            Engine::Embedded => {
                let config = SessionConfig::new().with_target_partitions(limits.threads.max(1));
                let pool = FairSpillPool::new(limits.memory_bytes);
                let runtime = RuntimeEnvBuilder::new()
                    .with_memory_pool(std::sync::Arc::new(pool))
                    .build_arc()?;
                Ok(SessionContext::new_with_config_rt(config, runtime))
            }
            #[cfg(feature = "ballista")]
            Engine::Ballista(place) => crate::cluster::session(place).await,
            #[cfg(not(feature = "ballista"))]
            Engine::Ballista(place) => Err(format!(
                "ballista://{place}: this lattice-fleet was built without the feature ballista"
            )
            .into()),
        }
    }
}

/// Paths of the Parquet files that are to become one map.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Inputs {
    /// Files of `voxels`.
    pub voxels: Vec<String>,
    /// Files of `labels`.
    pub labels: Vec<String>,
}

/// The rows of one map of all inputs by tile, not sorted within it.
pub async fn merge(session: &SessionContext, inputs: &Inputs) -> Result<BTreeMap<Tile, TileRows>> {
    let mut tiles = BTreeMap::<Tile, TileRows>::new();
    let merged = grouped(session, "voxels", &inputs.voxels, MERGE_VOXELS).await?;
    if let Some(merged) = merged {
        let mut batches = merged.execute_stream().await?;
        while let Some(batch) = batches.next().await {
            voxels_of(&batch?, |tile, row| {
                tiles.entry(tile).or_default().voxels.push(row);
                Ok(())
            })?;
        }
    }
    let merged = grouped(session, "labels", &inputs.labels, MERGE_LABELS).await?;
    if let Some(merged) = merged {
        let mut batches = merged.execute_stream().await?;
        while let Some(batch) = batches.next().await {
            labels_of(&batch?, |tile, row| {
                tiles.entry(tile).or_default().labels.push(row);
                Ok(())
            })?;
        }
    }
    Ok(tiles)
}

/// A query over some files as a table, if there are any.
async fn grouped(
    session: &SessionContext,
    table: &str,
    files: &[String],
    sql: &str,
) -> Result<Option<DataFrame>> {
    if files.is_empty() {
        return Ok(None);
    }
    let schema = match table {
        "voxels" => crate::schema::voxels(),
        _ => crate::schema::labels(),
    };
    let options = ParquetReadOptions::default().schema(&schema);
    let all = session.read_parquet(files.to_vec(), options).await?;
    session.deregister_table(table)?;
    session.register_table(table, all.into_view())?;
    Ok(Some(session.sql(sql).await.map_err(AnyError::from)?))
}
