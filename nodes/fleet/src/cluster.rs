//! Apache Ballista: sessions of a cluster, its scheduler and executors, and the map stage as a query.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;

use ballista::prelude::{SessionConfigExt, SessionContextExt};
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::utils::default_session_builder;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::start_server;
use datafusion::arrow::array::{ArrayRef, AsArray, RecordBatch, StringArray};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::{DataType, Field, Schema};
use datafusion::common::DataFusionError;
use datafusion::execution::SessionState;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDF, ScalarUDFImpl, Signature, Volatility,
};
use datafusion::prelude::{ParquetReadOptions, SessionConfig, SessionContext};
use parquet::arrow::ArrowWriter;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::files::{at, write_whole};
use crate::map_stage::Task;
use crate::tables::Tables;

/// Most partitions of a query on a cluster.
const PARTITIONS: usize = 64;
/// Name of the function that maps a log.
const MAP_FUNCTION: &str = "lattice_map";

/// A session of a cluster, by the place of its scheduler.
pub async fn session(place: &str) -> Result<SessionContext> {
    session_of(place, SessionConfig::new_with_ballista()).await
}

async fn session_of(place: &str, config: SessionConfig) -> Result<SessionContext> {
    let state = state_of(config)?;
    let session = SessionContext::remote_with_state(&format!("df://{place}"), state).await?;
    session.register_udf(ScalarUDF::new_from_impl(MapFunction::new()));
    Ok(session)
}

/// State of a session that knows our function, alike in the driver, the scheduler and the executors.
fn state_of(config: SessionConfig) -> datafusion::common::Result<SessionState> {
    let mut state = default_session_builder(config)?;
    let function = Arc::new(ScalarUDF::new_from_impl(MapFunction::new()));
    datafusion::execution::FunctionRegistry::register_udf(&mut state, function)?;
    Ok(state)
}

/// Runs the map stage on a cluster; gives the number of new parts, and what failed.
pub async fn map(place: &str, tasks: &[Task]) -> Result<(usize, Vec<String>)> {
    let Some(first) = tasks.first() else {
        return Ok((0, Vec::new()));
    };
    let scratch = Tables::open(&first.tables)?.scratch_folder();
    let folder = tempfile::tempdir_in(&scratch).map_err(|error| at(&scratch, error))?;
    let mut files = Vec::new();
    for (number, task) in tasks.iter().enumerate() {
        let path = folder.path().join(format!("{number}.parquet"));
        write_task(&path, task)?;
        files.push(path.display().to_string());
    }
    let config =
        SessionConfig::new_with_ballista().with_target_partitions(tasks.len().min(PARTITIONS));
    let session = session_of(place, config).await?;
    let schema = task_schema();
    let options = ParquetReadOptions::default().schema(&schema);
    let all = session.read_parquet(files, options).await?;
    session.register_table("tasks", all.into_view())?;
    let query = format!("SELECT {MAP_FUNCTION}(task) AS answer FROM tasks");
    let answers = session.sql(&query).await?.collect().await?;
    let (mut new, mut failed) = (0, Vec::new());
    for batch in &answers {
        let texts = cast(batch.column(0), &DataType::Utf8)?;
        for text in texts.as_string::<i32>().iter().flatten() {
            match serde_json::from_str(text)? {
                Answer::Added { new: true } => new += 1,
                Answer::Added { new: false } => {}
                Answer::Failed { why } => failed.push(why),
            }
        }
    }
    Ok((new, failed))
}

fn task_schema() -> Schema {
    Schema::new(vec![Field::new("task", DataType::Utf8, false)])
}

fn write_task(path: &Path, task: &Task) -> Result {
    let text: ArrayRef = Arc::new(StringArray::from(vec![serde_json::to_string(task)?]));
    let batch = RecordBatch::try_new(Arc::new(task_schema()), vec![text])?;
    write_whole(path, |file| {
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None)?;
        writer.write(&batch)?;
        writer.close()?;
        Ok(())
    })
}

/// Answer of a task at its end.
#[derive(Serialize, Deserialize)]
enum Answer {
    Added { new: bool },
    Failed { why: String },
}

/// The function `lattice_map(task)`: maps the slice of a log, adds the part, says how it went.
#[derive(Debug, PartialEq, Eq, Hash)]
struct MapFunction {
    signature: Signature,
}

impl MapFunction {
    fn new() -> Self {
        // Volatile: whoever plans a query must not call it.
        let signature = Signature::string(1, Volatility::Volatile);
        Self { signature }
    }
}

impl ScalarUDFImpl for MapFunction {
    fn name(&self) -> &str {
        MAP_FUNCTION
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> datafusion::common::Result<DataType> {
        Ok(DataType::Utf8)
    }

    fn invoke_with_args(
        &self,
        args: ScalarFunctionArgs,
    ) -> datafusion::common::Result<ColumnarValue> {
        let Some(column) = args.args.first() else {
            return Err(DataFusionError::Execution(format!(
                "{MAP_FUNCTION} needs a task"
            )));
        };
        let texts = cast(&column.to_array(args.number_rows)?, &DataType::Utf8)?;
        let answer = |text: Option<&str>| {
            let task = serde_json::from_str::<Task>(text.unwrap_or_default());
            let answer = match task.map_err(crate::AnyError::from).and_then(|task| {
                let failed = |error| format!("{}: {error}", task.title());
                Ok(task.run().map_err(failed)?)
            }) {
                Ok(added) => Answer::Added { new: added.new },
                Err(error) => Answer::Failed {
                    why: error.to_string(),
                },
            };
            serde_json::to_string(&answer).ok()
        };
        let answers: StringArray = texts.as_string::<i32>().iter().map(answer).collect();
        Ok(ColumnarValue::Array(Arc::new(answers)))
    }
}

/// Runs a scheduler until it is stopped.
pub async fn scheduler(address: SocketAddr, executor_timeout_s: u64) -> Result {
    let config = SchedulerConfig {
        bind_host: address.ip().to_string(),
        external_host: address.ip().to_string(),
        bind_port: address.port(),
        executor_timeout_seconds: executor_timeout_s,
        expire_dead_executor_interval_seconds: (executor_timeout_s / 4).max(1),
        override_session_builder: Some(Arc::new(state_of)),
        ..SchedulerConfig::default()
    };
    let cluster = BallistaCluster::new_from_config(&config).await?;
    Ok(start_server(cluster, address, Arc::new(config)).await?)
}

/// Place and size of an executor.
#[derive(Clone, Debug)]
pub struct ExecutorOptions {
    /// Host and port of the scheduler.
    pub scheduler: (String, u16),
    /// Address of this executor; its gRPC port is the next one.
    pub address: SocketAddr,
    /// Tasks at a time.
    pub slots: usize,
    /// Folder for what it shuffles.
    pub work_folder: String,
}

/// Runs an executor until it is stopped.
pub async fn executor(options: ExecutorOptions) -> Result {
    let mut registry = BallistaFunctionRegistry::default();
    let function = Arc::new(ScalarUDF::new_from_impl(MapFunction::new()));
    registry
        .scalar_functions
        .insert(MAP_FUNCTION.to_owned(), function);
    let config = ExecutorProcessConfig {
        bind_host: options.address.ip().to_string(),
        external_host: Some(options.address.ip().to_string()),
        port: options.address.port(),
        grpc_port: options.address.port().saturating_add(1),
        scheduler_host: options.scheduler.0,
        scheduler_port: options.scheduler.1,
        scheduler_connect_timeout_seconds: 30,
        vcores: options.slots,
        work_dir: Some(options.work_folder),
        executor_heartbeat_interval_seconds: 3,
        override_function_registry: Some(Arc::new(registry)),
        ..ExecutorProcessConfig::default()
    };
    Ok(start_executor_process(Arc::new(config)).await?)
}
