//! The table `replay` of DataFusion: one partition per log.

use std::fmt;
use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::array::cast::AsArray as _;
use datafusion::arrow::array::{ArrayRef, RecordBatch, StringArray};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::catalog::memory::MemorySourceConfig;
use datafusion::catalog::{Session, TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::tree_node::TreeNodeRecursion;
use datafusion::common::{ScalarValue, plan_err};
use datafusion::error::{DataFusionError, Result};
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::logical_expr::{Expr, TableType};
use datafusion::physical_expr::{EquivalenceProperties, PhysicalExpr};
use datafusion::physical_plan::execution_plan::{Boundedness, EmissionType};
use datafusion::physical_plan::stream::RecordBatchStreamAdapter;
use datafusion::physical_plan::{DisplayAs, DisplayFormatType, ExecutionPlan, Partitioning, PlanProperties};
use futures::{StreamExt as _, TryStreamExt as _};
use headrace_tables::{Parameters, TABLES, schema};
use serde::{Deserialize, Serialize};

use crate::maker::Maker;
use crate::place::{DiveLog, Place};

/// Description of a replay table. It can be sent to another process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replayed {
    /// URL of the folder or bucket with the logs.
    pub place: String,
    /// The dives, one per partition.
    pub dives: Vec<DiveLog>,
    /// Parameters of the replays.
    pub parameters: Parameters,
    /// Name of the table, one of [`TABLES`].
    pub table: String,
}

impl Replayed {
    /// The table's name and schema.
    ///
    /// Errors: no table has this name.
    fn table(&self) -> Result<(&'static str, SchemaRef)> {
        let name = TABLES.into_iter().find(|table| *table == self.table);
        let Some(found) = name.and_then(|name| Some((name, schema(name)?))) else {
            return plan_err!(
                "{:?} isn't a table of a dive; expected one of {}",
                self.table,
                TABLES.join(", ")
            );
        };
        Ok(found)
    }

    /// A plan that lists the dives, one per partition.
    fn listed(&self) -> Result<Arc<dyn ExecutionPlan>> {
        let schema = Arc::new(Schema::new(vec![Field::new("dive", DataType::Utf8, false)]));
        let partition = |dive: &DiveLog| {
            let text = serde_json::to_string(dive).map_err(|error| external(error.into()))?;
            let column = Arc::new(StringArray::from(vec![text]));
            Ok(vec![RecordBatch::try_new(schema.clone(), vec![column])?])
        };
        let partitions = self.dives.iter().map(partition).collect::<Result<Vec<_>>>()?;
        Ok(MemorySourceConfig::try_new_exec(&partitions, schema.clone(), None)?)
    }
}

/// A table of dives. Reading the table replays the dives, or takes them from the cache.
#[derive(Debug)]
pub struct ReplayTable {
    maker: Arc<Maker>,
    replayed: Replayed,
    schema: SchemaRef,
}

impl ReplayTable {
    /// Creates the table of the described dives.
    ///
    /// Errors: no table has this name.
    pub fn new(maker: Arc<Maker>, replayed: Replayed) -> Result<Self> {
        let (_, schema) = replayed.table()?;
        Ok(Self { maker, replayed, schema })
    }

    /// Description of the table.
    pub fn replayed(&self) -> &Replayed {
        &self.replayed
    }
}

#[async_trait]
impl TableProvider for ReplayTable {
    fn schema(&self) -> SchemaRef {
        self.schema.clone()
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    async fn scan(
        &self,
        _: &dyn Session,
        projection: Option<&Vec<usize>>,
        _: &[Expr],
        _: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let asked = Asked {
            replayed: Replayed { dives: Vec::new(), ..self.replayed.clone() },
            projection: projection.cloned(),
        };
        Ok(Arc::new(ReplayExec::new(self.maker.clone(), asked, self.replayed.listed()?)?))
    }
}

/// The request that applies to each dive of an input plan. It can be sent to another process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// Table and parameters. The list of dives is empty, because the dives come from the input plan.
    pub replayed: Replayed,
    /// The requested columns of the table; `None` means all columns.
    pub projection: Option<Vec<usize>>,
}

/// Replays the dives listed by its input plan, partition by partition.
///
/// The node gets its list of dives from an input plan. A distributing engine can divide a list, but knows nothing of
/// replays.
#[derive(Debug)]
pub struct ReplayExec {
    maker: Arc<Maker>,
    asked: Arc<Asked>,
    table: &'static str,
    listed: Arc<dyn ExecutionPlan>,
    properties: Arc<PlanProperties>,
}

impl ReplayExec {
    /// Creates the node for the dives that `listed` returns as JSON texts.
    ///
    /// Errors: the requested table or column doesn't exist.
    pub fn new(
        maker: Arc<Maker>,
        asked: impl Into<Arc<Asked>>,
        listed: Arc<dyn ExecutionPlan>,
    ) -> Result<Self> {
        let asked = asked.into();
        let (table, schema) = asked.replayed.table()?;
        let schema: SchemaRef = match &asked.projection {
            None => schema,
            Some(columns) => Arc::new(Schema::clone(&schema).project(columns)?),
        };
        let properties = PlanProperties::new(
            EquivalenceProperties::new(schema),
            Partitioning::UnknownPartitioning(listed.properties().output_partitioning().partition_count()),
            EmissionType::Incremental,
            Boundedness::Bounded,
        );
        Ok(Self { maker, asked, table, listed, properties: Arc::new(properties) })
    }

    /// The request, applied to each listed dive.
    pub fn asked(&self) -> &Asked {
        &self.asked
    }
}

impl DisplayAs for ReplayExec {
    fn fmt_as(&self, _: DisplayFormatType, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ReplayExec: {} of dives of {}", self.table, self.asked.replayed.place)
    }
}

impl ExecutionPlan for ReplayExec {
    fn name(&self) -> &'static str {
        "ReplayExec"
    }

    fn properties(&self) -> &Arc<PlanProperties> {
        &self.properties
    }

    fn children(&self) -> Vec<&Arc<dyn ExecutionPlan>> {
        vec![&self.listed]
    }

    /// Returns false, because the list of dives is already divided into the required partitions.
    fn benefits_from_input_partitioning(&self) -> Vec<bool> {
        vec![false]
    }

    fn apply_expressions(
        &self,
        _: &mut dyn FnMut(&Arc<dyn PhysicalExpr>) -> Result<TreeNodeRecursion>,
    ) -> Result<TreeNodeRecursion> {
        Ok(TreeNodeRecursion::Continue)
    }

    fn with_new_children(
        self: Arc<Self>,
        children: Vec<Arc<dyn ExecutionPlan>>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let [listed] = children.as_slice() else {
            return plan_err!("ReplayExec over {} plans: expected one", children.len());
        };
        Ok(Arc::new(Self::new(self.maker.clone(), self.asked.clone(), listed.clone())?))
    }

    fn execute(&self, partition: usize, context: Arc<TaskContext>) -> Result<SendableRecordBatchStream> {
        let place = Place::open(&self.asked.replayed.place).map_err(|error| external(error.into()))?;
        let (maker, asked, table) = (self.maker.clone(), self.asked.clone(), self.table);
        let dives = self.listed.execute(partition, context)?;
        let dives = dives.map_ok(|batch| futures::stream::iter(listed_dives(&batch)));
        let batches = dives.try_flatten().and_then(move |dive| {
            let (maker, asked, place) = (maker.clone(), asked.clone(), place.clone());
            async move {
                let made = maker.make(&place, &dive, &asked.replayed.parameters).await;
                let batches = made.map_err(|error| external(error.into()))?.table(table).await;
                let batches = batches.map_err(|error| external(error.into()))?.into_iter();
                let wanted = batches.map(|batch| {
                    // If the log is a copy, its cached tables contain the path of the log that was replayed.
                    let batch = if table == "dives" { under_path(&batch, &dive.log)? } else { batch };
                    match &asked.projection {
                        None => Ok(batch),
                        Some(columns) => Ok(batch.project(columns)?),
                    }
                });
                Ok(futures::stream::iter(wanted.collect::<Vec<_>>()))
            }
        });
        Ok(Box::pin(RecordBatchStreamAdapter::new(self.schema(), batches.try_flatten().boxed())))
    }
}

/// The dives in a batch of [`Replayed::listed`].
fn listed_dives(batch: &RecordBatch) -> Vec<Result<DiveLog>> {
    let texts = batch.columns().first().and_then(|column| column.as_string_opt::<i32>());
    let parsed = texts.into_iter().flatten().flatten().map(serde_json::from_str);
    parsed.map(|dive| dive.map_err(|error| external(error.into()))).collect()
}

/// Rows of the table `dives`, with the given path in the column `log`.
fn under_path(batch: &RecordBatch, log: &str) -> Result<RecordBatch> {
    let columns =
        batch.schema_ref().fields().iter().zip(batch.columns()).map(|(field, column)| -> ArrayRef {
            if field.name() == "log" {
                Arc::new(StringArray::from_iter_values(std::iter::repeat_n(log, batch.num_rows())))
            } else {
                column.clone()
            }
        });
    Ok(RecordBatch::try_new(batch.schema(), columns.collect())?)
}

fn external(error: Box<dyn std::error::Error + Send + Sync>) -> DataFusionError {
    DataFusionError::External(error)
}

/// The table function `replay(log, parameters [, table])`.
///
/// `log` is a value of the column `log` of `dives`, or `*` for all. `parameters` is JSON, or `target_m=0.3`. `table`
/// defaults to `sections`.
#[derive(Debug)]
pub struct ReplayFunction {
    /// Makes the tables of the requested dives.
    pub maker: Arc<Maker>,
    /// The dives of the campaign, and the default parameters.
    pub all: Replayed,
}

impl TableFunctionImpl for ReplayFunction {
    fn call_with_args(&self, args: TableFunctionArgs<'_, '_>) -> Result<Arc<dyn TableProvider>> {
        let mut texts = Vec::new();
        for expression in args.exprs() {
            match expression {
                Expr::Literal(ScalarValue::Utf8(Some(text)), _) => texts.push(text.as_str()),
                other => {
                    return plan_err!(
                        "replay({other}): its arguments must be texts: replay(log, parameters [, table])"
                    );
                }
            }
        }
        let (log, parameters, table) = match texts.as_slice() {
            [log] => (*log, "", "sections"),
            [log, parameters] => (*log, *parameters, "sections"),
            [log, parameters, table] => (*log, *parameters, *table),
            _ => return plan_err!("replay takes one to three arguments: replay(log, parameters [, table])"),
        };
        let mut replayed = self.all.clone();
        table.clone_into(&mut replayed.table);
        if log != "*" {
            replayed.dives.retain(|dive| dive.log == log);
            if replayed.dives.is_empty() {
                return plan_err!("replay({log:?}): {} has no such log; * means all logs", replayed.place);
            }
        }
        replayed.parameters = overridden(&replayed.parameters, parameters)?;
        Ok(Arc::new(ReplayTable::new(self.maker.clone(), replayed)?))
    }
}

/// Overrides the parameters that a text names. The text is a JSON object, or `key=value` pairs separated by commas.
fn overridden(base: &Parameters, text: &str) -> Result<Parameters> {
    let external = |error: serde_json::Error| DataFusionError::Plan(format!("parameters {text:?}: {error}"));
    let mut all = serde_json::to_value(base).map_err(external)?;
    let text = text.trim();
    let given: serde_json::Value = if text.starts_with('{') {
        serde_json::from_str(text).map_err(external)?
    } else {
        let mut given = serde_json::Map::new();
        for pair in text.split(',').filter(|pair| !pair.trim().is_empty()) {
            let Some((key, value)) = pair.split_once('=') else {
                return plan_err!("parameters {text:?}: expected a JSON object, or key=value, ...");
            };
            given.insert(key.trim().to_owned(), serde_json::from_str(value.trim()).map_err(external)?);
        }
        given.into()
    };
    if let (Some(all), serde_json::Value::Object(given)) = (all.as_object_mut(), given) {
        all.extend(given);
    }
    let parameters: Parameters = serde_json::from_value(all).map_err(external)?;
    parameters.check().map_err(|error| DataFusionError::Plan(error.to_string()))?;
    Ok(parameters)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_read_from_json_and_from_pairs() {
        let base = Parameters { target_m: Some(1.0), ..Parameters::default() };
        assert_eq!(overridden(&base, "").unwrap(), base);
        let both = Parameters { target_m: Some(0.3), section_m: Some(0.5), ..Parameters::default() };
        assert_eq!(overridden(&base, r#"{"target_m": 0.3, "section_m": 0.5}"#).unwrap(), both);
        assert_eq!(overridden(&base, "target_m=0.3, section_m=0.5").unwrap(), both);
        for wrong in ["target", "target_m=0", "aim_m=1", "{", "target_m=x"] {
            assert!(overridden(&base, wrong).is_err(), "{wrong}");
        }
    }
}
