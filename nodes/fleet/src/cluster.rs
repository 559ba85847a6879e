//! Apache Ballista: sessions of a cluster, its scheduler and executors, and the map stage as a query.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
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
use datafusion::execution::runtime_env::RuntimeEnv;
use datafusion::execution::{SessionState, SessionStateBuilder};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDF, ScalarUDFImpl, Signature, Volatility,
};
use datafusion::prelude::{SessionConfig, SessionContext};
use parquet::arrow::ArrowWriter;
use serde::{Deserialize, Serialize};

use crate::engine::query;
use crate::files::{at, write_whole};
use crate::map_stage::{Task, Worker};
use crate::roots::Roots;
use crate::stop::Scratch;
use crate::tables::Tables;
use crate::{Result, rooted_store};

/// Largest number of partitions of a query on a cluster.
const PARTITIONS: usize = 64;
/// Name of the function that maps a log.
const MAP_FUNCTION: &str = "lattice_map";

/// Creates a session of a cluster, by host and port of its scheduler.
pub async fn session(place: &str) -> Result<SessionContext> {
    session_of(place, SessionConfig::new_with_ballista()).await
}

async fn session_of(place: &str, config: SessionConfig) -> Result<SessionContext> {
    let state = state_of(config, None)?;
    let session = SessionContext::remote_with_state(&format!("df://{place}"), state).await?;
    session.register_udf(ScalarUDF::new_from_impl(MapFunction::new(None)));
    Ok(session)
}

/// State of a session with the function of the map stage, the same in driver and scheduler.
fn state_of(
    config: SessionConfig,
    runtime: Option<Arc<RuntimeEnv>>,
) -> datafusion::common::Result<SessionState> {
    let mut state = default_session_builder(config)?;
    if let Some(runtime) = runtime {
        state = SessionStateBuilder::new_from_existing(state)
            .with_runtime_env(runtime)
            .build();
    }
    let function = Arc::new(ScalarUDF::new_from_impl(MapFunction::new(None)));
    datafusion::execution::FunctionRegistry::register_udf(&mut state, function)?;
    Ok(state)
}

/// Runs the map stage on a cluster. Returns the number of new parts, and the errors of the tasks that failed.
pub async fn map(place: &str, tasks: &[Task]) -> Result<(usize, Vec<String>)> {
    let Some(first) = tasks.first() else {
        return Ok((0, Vec::new()));
    };
    let parent = Tables::open(&first.tables)?.scratch_folder();
    let folder = Scratch::create(&parent, ".tasks-").map_err(|error| at(&parent, error))?;
    let mut files = Vec::new();
    for (number, task) in tasks.iter().enumerate() {
        let path = folder.path().join(format!("{number}.parquet"));
        write_task(&path, task)?;
        files.push(path);
    }
    let config =
        SessionConfig::new_with_ballista().with_target_partitions(tasks.len().min(PARTITIONS));
    let session = session_of(place, config).await?;
    let sql = format!("SELECT {MAP_FUNCTION}(task) AS answer FROM tasks");
    let schema = Arc::new(task_schema());
    let Some(answers) = query(&session, "tasks", schema, &files, &sql).await? else {
        return Ok((0, Vec::new()));
    };
    let (mut new, mut failed, mut answered) = (0, Vec::new(), 0);
    for batch in &answers.collect().await? {
        let texts = cast(batch.column(0), &DataType::Utf8)?;
        for text in texts.as_string::<i32>().iter().flatten() {
            answered += 1;
            match serde_json::from_str(text)? {
                Answer::Added { new: true } => new += 1,
                Answer::Added { new: false } => {}
                Answer::Failed { why } => failed.push(why),
            }
        }
    }
    if answered != tasks.len() {
        let count = tasks.len();
        return Err(format!("the cluster has answered {answered} of {count} tasks").into());
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

/// Result of a task.
#[derive(Serialize, Deserialize)]
enum Answer {
    Added { new: bool },
    Failed { why: String },
}

/// The function `lattice_map(task)`: maps the slice of a log, adds the part and returns an [`Answer`].
#[derive(Debug, PartialEq, Eq, Hash)]
struct MapFunction {
    signature: Signature,
    /// Program and roots of an executor; none in driver and scheduler, which run no task.
    worker: Option<Worker>,
}

impl MapFunction {
    fn new(worker: Option<Worker>) -> Self {
        // Volatile: a planner must not evaluate it.
        let signature = Signature::string(1, Volatility::Volatile);
        Self { signature, worker }
    }

    /// Runs a task in JSON; fails with the name of the task.
    fn run(&self, text: &str) -> Result<bool> {
        let task: Task = serde_json::from_str(text)?;
        let failed = |error| format!("{}: {error}", task.title());
        let Some(worker) = &self.worker else {
            return Err(failed("only an executor runs tasks".into()).into());
        };
        Ok(task.run(worker).map_err(failed)?.new)
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
            let answer = match self.run(text.unwrap_or_default()) {
                Ok(new) => Answer::Added { new },
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

/// Fails for an address beyond this machine: the cluster has neither encryption nor authentication.
pub fn check_address(address: &SocketAddr, is_insecure: bool) -> Result {
    match address.ip().is_loopback() || is_insecure {
        true => Ok(()),
        false => Err(format!(
            "{address} is not a loopback address, and whoever reaches it can run queries and tasks: there is neither \
             encryption nor authentication; give --insecure in a network of your own"
        )
        .into()),
    }
}

/// Runs a scheduler until it is stopped. Queries read files below the roots only, and spill to a folder.
pub async fn scheduler(
    address: SocketAddr,
    executor_timeout_s: u64,
    roots: &Roots,
    work_folder: &Path,
) -> Result {
    let runtime = rooted_store::runtime(roots, work_folder)?;
    let config = SchedulerConfig {
        bind_host: address.ip().to_string(),
        external_host: address.ip().to_string(),
        bind_port: address.port(),
        executor_timeout_seconds: executor_timeout_s,
        expire_dead_executor_interval_seconds: (executor_timeout_s / 4).max(1),
        override_session_builder: Some(Arc::new(move |config| {
            state_of(config, Some(runtime.clone()))
        })),
        ..SchedulerConfig::default()
    };
    let cluster = BallistaCluster::new_from_config(&config).await?;
    Ok(start_server(cluster, address, Arc::new(config)).await?)
}

/// Addresses, size and worker of an executor.
#[derive(Clone, Debug)]
pub struct ExecutorOptions {
    /// Host and port of the scheduler.
    pub scheduler: (String, u16),
    /// Address of this executor; its gRPC port is the next one.
    pub address: SocketAddr,
    /// Concurrent tasks.
    pub slots: usize,
    /// Folder for shuffle and spill files.
    pub work_folder: PathBuf,
    /// True if addresses beyond this machine are allowed.
    pub is_insecure: bool,
    /// Program of the tasks.
    pub worker: Worker,
    /// Folders of logs and tables.
    pub roots: Roots,
}

/// Runs an executor until it is stopped.
pub async fn executor(options: ExecutorOptions) -> Result {
    let (host, port) = &options.scheduler;
    for address in (host.as_str(), *port).to_socket_addrs()? {
        check_address(&address, options.is_insecure)?;
    }
    let mut registry = BallistaFunctionRegistry::default();
    let function = MapFunction::new(Some(options.worker));
    let function = Arc::new(ScalarUDF::new_from_impl(function));
    registry
        .scalar_functions
        .insert(MAP_FUNCTION.to_owned(), function);
    let runtime = rooted_store::runtime(&options.roots, &options.work_folder)?;
    let config = ExecutorProcessConfig {
        bind_host: options.address.ip().to_string(),
        external_host: Some(options.address.ip().to_string()),
        port: options.address.port(),
        grpc_port: options.address.port().saturating_add(1),
        scheduler_host: options.scheduler.0,
        scheduler_port: options.scheduler.1,
        scheduler_connect_timeout_seconds: 30,
        vcores: options.slots,
        work_dir: Some(options.work_folder.display().to_string()),
        executor_heartbeat_interval_seconds: 3,
        override_function_registry: Some(Arc::new(registry)),
        override_runtime_producer: Some(Arc::new(move |_: &SessionConfig| Ok(runtime.clone()))),
        ..ExecutorProcessConfig::default()
    };
    Ok(start_executor_process(Arc::new(config)).await?)
}
