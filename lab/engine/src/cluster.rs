//! Runs replays and queries on many machines, with Ballista's scheduler, executors and client.
//!
//! Scheduler, executors and client each have a codec for [`ReplayTable`] and [`ReplayExec`]. Ballista distributes the
//! work, repeats failed tasks and collects the results.

use std::net::SocketAddr;
use std::sync::Arc;

use ballista_core::config::{BALLISTA_SCHEDULER_MAX_PARTITIONS_PER_TASK, TaskSchedulingPolicy};
use ballista_core::extension::{SessionConfigExt as _, SessionStateExt as _};
use ballista_core::serde::{BallistaLogicalExtensionCodec, BallistaPhysicalExtensionCodec};
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::start_server;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::catalog::TableProvider;
use datafusion::common::{Result, TableReference, plan_err};
use datafusion::datasource::file_format::FileFormatFactory;
use datafusion::error::DataFusionError;
use datafusion::execution::{SessionStateBuilder, TaskContext};
use datafusion::logical_expr::{Extension, LogicalPlan};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::prelude::{SessionConfig, SessionContext};
use datafusion_proto::logical_plan::LogicalExtensionCodec;
use datafusion_proto::physical_plan::{PhysicalExtensionCodec, PhysicalProtoConverterExtension};
use headrace_tables::program_version;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::Error;
use crate::maker::Maker;
use crate::provider::{Asked, ReplayExec, ReplayTable, Replayed};

/// Prefix that distinguishes encoded plan nodes of this program from Ballista's own nodes.
const OURS: &[u8] = b"headrace ";
/// Time without a heartbeat after which an executor counts as lost, s. A busy executor sends a heartbeat every 5 s.
const LOST_AFTER_S: u64 = 15;
/// Interval at which the scheduler looks for lost executors, s.
const LOOK_EVERY_S: u64 = 1;
/// Longest message, bytes. A plan lists all dives, at about 300 bytes each.
const MESSAGE_BYTES: u32 = 256 << 20;

/// Runs Ballista's scheduler until it ends.
///
/// Errors: the scheduler can't listen on the address.
pub async fn schedule(address: SocketAddr, maker: Arc<Maker>) -> Result<(), Error> {
    let codec = Arc::new(Codec::new(maker));
    let config = SchedulerConfig {
        bind_host: address.ip().to_string(),
        bind_port: address.port(),
        external_host: address.ip().to_string(),
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        executor_timeout_seconds: LOST_AFTER_S,
        expire_dead_executor_interval_seconds: LOOK_EVERY_S,
        grpc_server_max_decoding_message_size: MESSAGE_BYTES,
        grpc_server_max_encoding_message_size: MESSAGE_BYTES,
        grpc_client_max_message_size: MESSAGE_BYTES,
        override_logical_codec: Some(codec.clone()),
        override_physical_codec: Some(codec),
        ..SchedulerConfig::default()
    };
    let failed = |error| Error::Usage(format!("scheduling on {address}: {error}"));
    let cluster = BallistaCluster::new_from_config(&config).await.map_err(failed)?;
    start_server(cluster, address, Arc::new(config)).await.map_err(failed)
}

/// Runs an executor until it is stopped.
///
/// The executor waits for the scheduler at `host`:`port`, and then runs `threads` tasks at a time for it. Other
/// processes fetch results from `address`.
///
/// Errors: the executor can't listen on the address, or the scheduler has ended.
pub async fn execute(
    (host, port): (&str, u16),
    address: SocketAddr,
    threads: usize,
    maker: Arc<Maker>,
) -> Result<(), Error> {
    let failed = |why: String| Error::Usage(format!("executing on {address} for {host}:{port}: {why}"));
    let work = tempfile::tempdir().map_err(|error| failed(error.to_string()))?;
    let codec = Arc::new(Codec::new(maker));
    let config = ExecutorProcessConfig {
        bind_host: address.ip().to_string(),
        port: address.port(),
        scheduler_host: host.to_owned(),
        scheduler_port: port,
        // Any value except 0 makes the executor wait until the scheduler is available.
        scheduler_connect_timeout_seconds: 60,
        vcores: threads,
        task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
        work_dir: Some(work.path().to_string_lossy().into_owned()),
        grpc_max_decoding_message_size: MESSAGE_BYTES,
        grpc_max_encoding_message_size: MESSAGE_BYTES,
        override_logical_codec: Some(codec.clone()),
        override_physical_codec: Some(codec),
        ..ExecutorProcessConfig::default()
    };
    start_executor_process(Arc::new(config)).await.map_err(|error| failed(error.to_string()))
}

/// Creates a session whose plans are run by the executors of a scheduler.
///
/// Errors: only those of the engine itself. If the scheduler is missing, the first query returns an error.
pub fn session(scheduler: &str, maker: Arc<Maker>) -> Result<SessionContext, Error> {
    let config = SessionConfig::new_with_ballista()
        // Each task has one dive, because a task with several dives ends only when its longest replay ends.
        .set_usize(BALLISTA_SCHEDULER_MAX_PARTITIONS_PER_TASK, 1)
        .with_ballista_grpc_client_max_message_size(MESSAGE_BYTES as usize)
        .with_ballista_logical_extension_codec(Arc::new(Codec::new(maker)));
    let state = SessionStateBuilder::new().with_default_features().with_config(config).build();
    Ok(SessionContext::new_with_state(state.upgrade_for_ballista(format!("http://{scheduler}"))?))
}

/// Encodes this program's table and plan node, and delegates the rest to Ballista.
#[derive(Debug)]
struct Codec {
    maker: Arc<Maker>,
    logical: BallistaLogicalExtensionCodec,
    physical: BallistaPhysicalExtensionCodec,
}

impl Codec {
    fn new(maker: Arc<Maker>) -> Self {
        Self {
            maker,
            logical: BallistaLogicalExtensionCodec::default(),
            physical: BallistaPhysicalExtensionCodec::default(),
        }
    }
}

/// Appends a node of this program, preceded by the program's version.
fn encode(what: &impl Serialize, bytes: &mut Vec<u8>) -> Result<()> {
    bytes.extend_from_slice(OURS);
    let with_version = (program_version(), what);
    serde_json::to_writer(bytes, &with_version).map_err(|error| DataFusionError::External(Box::new(error)))
}

/// Decodes a node of this program; `None` for any other node.
///
/// Errors: the node is from another program version.
fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<Option<T>> {
    let Some(text) = bytes.strip_prefix(OURS) else { return Ok(None) };
    let external = |error| DataFusionError::External(Box::new(error));
    let (version, what): (String, serde_json::Value) = serde_json::from_slice(text).map_err(external)?;
    if version != program_version() {
        let here = program_version();
        return plan_err!(
            "a plan of headrace-campaign {version} on {here}: client, scheduler and executors must have the same version"
        );
    }
    Ok(Some(serde_json::from_value(what).map_err(external)?))
}

impl LogicalExtensionCodec for Codec {
    fn try_decode(&self, bytes: &[u8], inputs: &[LogicalPlan], context: &TaskContext) -> Result<Extension> {
        self.logical.try_decode(bytes, inputs, context)
    }

    fn try_encode(&self, node: &Extension, bytes: &mut Vec<u8>) -> Result<()> {
        self.logical.try_encode(node, bytes)
    }

    fn try_decode_table_provider(
        &self,
        bytes: &[u8],
        table: &TableReference,
        schema: SchemaRef,
        context: &TaskContext,
    ) -> Result<Arc<dyn TableProvider>> {
        match decode::<Replayed>(bytes)? {
            Some(replayed) => Ok(Arc::new(ReplayTable::new(self.maker.clone(), replayed)?)),
            None => self.logical.try_decode_table_provider(bytes, table, schema, context),
        }
    }

    fn try_encode_table_provider(
        &self,
        table: &TableReference,
        node: Arc<dyn TableProvider>,
        bytes: &mut Vec<u8>,
    ) -> Result<()> {
        match node.downcast_ref::<ReplayTable>() {
            Some(ours) => encode(ours.replayed(), bytes),
            None => self.logical.try_encode_table_provider(table, node, bytes),
        }
    }

    fn try_decode_file_format(
        &self,
        bytes: &[u8],
        context: &TaskContext,
    ) -> Result<Arc<dyn FileFormatFactory>> {
        self.logical.try_decode_file_format(bytes, context)
    }

    fn try_encode_file_format(&self, bytes: &mut Vec<u8>, node: Arc<dyn FileFormatFactory>) -> Result<()> {
        self.logical.try_encode_file_format(bytes, node)
    }
}

impl PhysicalExtensionCodec for Codec {
    fn try_decode(
        &self,
        bytes: &[u8],
        inputs: &[Arc<dyn ExecutionPlan>],
        context: &TaskContext,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        match (decode::<Asked>(bytes)?, inputs) {
            (Some(asked), [listed]) => {
                Ok(Arc::new(ReplayExec::new(self.maker.clone(), asked, listed.clone())?))
            }
            (Some(_), _) => plan_err!("ReplayExec over {} plans: expected one", inputs.len()),
            (None, _) => self.physical.try_decode(bytes, inputs, context, converter),
        }
    }

    fn try_encode(
        &self,
        node: Arc<dyn ExecutionPlan>,
        bytes: &mut Vec<u8>,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Result<()> {
        match node.downcast_ref::<ReplayExec>() {
            Some(ours) => encode(ours.asked(), bytes),
            None => self.physical.try_encode(node, bytes, converter),
        }
    }
}
