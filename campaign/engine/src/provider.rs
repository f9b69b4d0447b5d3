//! `replay` as a table of DataFusion: one log, one partition.

use std::fmt;
use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::datatypes::{Schema, SchemaRef};
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

use crate::about::Abouts;
use crate::dives::{dives_schema, dives_table};
use crate::maker::Maker;
use crate::place::{DiveLog, Place};

/// What a table is of; can be sent to another process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replayed {
    /// URL of the place.
    pub place: String,
    /// The dives, one for each partition.
    pub dives: Vec<DiveLog>,
    /// Parameters of their replays.
    pub parameters: Parameters,
    /// The table of [`TABLES`].
    pub table: String,
    /// What else is known of the dives: then `dives` has plant, pilot and day.
    pub about: Option<Abouts>,
}

impl Replayed {
    /// The table's name and schema.
    ///
    /// Errors: there is no such table.
    fn table(&self) -> Result<(&'static str, SchemaRef)> {
        let name = TABLES.into_iter().find(|table| *table == self.table);
        match name.and_then(|name| Some((name, schema(name)?))) {
            Some(("dives", _)) if self.about.is_some() => Ok(("dives", dives_schema())),
            Some(found) => Ok(found),
            None => plan_err!("{:?} isn't a table of a dive; there are {}", self.table, TABLES.join(", ")),
        }
    }
}

/// A table of dives that are replayed, or taken from the cache, when it is read.
#[derive(Debug)]
pub struct ReplayTable {
    maker: Arc<Maker>,
    replayed: Arc<Replayed>,
    schema: SchemaRef,
}

impl ReplayTable {
    /// Over these dives.
    ///
    /// Errors: there is no such table.
    pub fn new(maker: Arc<Maker>, replayed: Replayed) -> Result<Self> {
        let (_, schema) = replayed.table()?;
        Ok(Self { maker, replayed: Arc::new(replayed), schema })
    }

    /// What it is of.
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
        let plan = ReplayExec::new(self.maker.clone(), self.replayed.clone(), projection.cloned())?;
        Ok(Arc::new(plan))
    }
}

/// Replays dives, one for each partition.
#[derive(Debug)]
pub struct ReplayExec {
    maker: Arc<Maker>,
    replayed: Arc<Replayed>,
    table: &'static str,
    projection: Option<Vec<usize>>,
    properties: Arc<PlanProperties>,
}

impl ReplayExec {
    /// Of these dives; `projection` are the columns that are wanted, all without one.
    ///
    /// Errors: there is no such table or column.
    pub fn new(maker: Arc<Maker>, replayed: Arc<Replayed>, projection: Option<Vec<usize>>) -> Result<Self> {
        let (table, schema) = replayed.table()?;
        let schema: SchemaRef = match &projection {
            None => schema,
            Some(columns) => Arc::new(Schema::clone(&schema).project(columns)?),
        };
        let properties = PlanProperties::new(
            EquivalenceProperties::new(schema),
            Partitioning::UnknownPartitioning(replayed.dives.len()),
            EmissionType::Incremental,
            Boundedness::Bounded,
        );
        Ok(Self { maker, replayed, table, projection, properties: Arc::new(properties) })
    }

    /// What it is of.
    pub fn replayed(&self) -> &Replayed {
        &self.replayed
    }

    /// The columns that are wanted.
    pub fn projection(&self) -> Option<&[usize]> {
        self.projection.as_deref()
    }
}

impl DisplayAs for ReplayExec {
    fn fmt_as(&self, _: DisplayFormatType, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "ReplayExec: {} of {} dives of {}",
            self.table,
            self.replayed.dives.len(),
            self.replayed.place
        )
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
        Vec::new()
    }

    fn apply_expressions(
        &self,
        _: &mut dyn FnMut(&Arc<dyn PhysicalExpr>) -> Result<TreeNodeRecursion>,
    ) -> Result<TreeNodeRecursion> {
        Ok(TreeNodeRecursion::Continue)
    }

    fn with_new_children(self: Arc<Self>, _: Vec<Arc<dyn ExecutionPlan>>) -> Result<Arc<dyn ExecutionPlan>> {
        Ok(self)
    }

    fn execute(&self, partition: usize, _: Arc<TaskContext>) -> Result<SendableRecordBatchStream> {
        let Some(dive) = self.replayed.dives.get(partition).cloned() else {
            return plan_err!("partition {partition} of {} dives", self.replayed.dives.len());
        };
        let (maker, replayed, table) = (self.maker.clone(), self.replayed.clone(), self.table);
        let projection = self.projection.clone();
        let batches = async move {
            let external = |error: crate::error::Error| DataFusionError::External(Box::new(error));
            let place = Place::open(&replayed.place).map_err(external)?;
            let made = maker.make(&place, &dive, &replayed.parameters).await.map_err(external)?;
            let batches = match &replayed.about {
                Some(about) if table == "dives" => {
                    vec![dives_table(&[(dive, made)], about).await.map_err(external)?]
                }
                _ => made.table(table).await.map_err(external)?,
            };
            let wanted = batches.into_iter().map(move |batch| match &projection {
                None => Ok(batch),
                Some(columns) => Ok(batch.project(columns)?),
            });
            Ok::<_, DataFusionError>(futures::stream::iter(wanted.collect::<Vec<_>>()))
        };
        let stream = futures::stream::once(batches).try_flatten().boxed();
        Ok(Box::pin(RecordBatchStreamAdapter::new(self.schema(), stream)))
    }
}

/// The table function `replay(log, parameters [, table])`: `log` as the column `log` of `dives` has it, or `*` for all of them;
/// `parameters` as JSON, or as `target_m=0.3`; `table` is `sections` if it isn't given.
#[derive(Debug)]
pub struct ReplayFunction {
    /// Makes the tables.
    pub maker: Arc<Maker>,
    /// The dives of the campaign, and the parameters that hold where none are given.
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
                        "replay({other}): its arguments are texts: replay(log, parameters [, table])"
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
        replayed.about = None;
        if log != "*" {
            replayed.dives.retain(|dive| dive.log == log);
            if replayed.dives.is_empty() {
                return plan_err!(
                    "replay({log:?}): {} has no such log; * is for all of them",
                    replayed.place
                );
            }
        }
        replayed.parameters = overridden(&replayed.parameters, parameters)?;
        Ok(Arc::new(ReplayTable::new(self.maker.clone(), replayed)?))
    }
}

/// Parameters with some of them replaced: a JSON object, or `key=value` with commas.
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
    fn parameters_are_taken_as_json_and_as_pairs() {
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
