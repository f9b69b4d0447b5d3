//! The table `dives` of a campaign. Each row is the row in a dive's own tables. The log's path in the campaign's folder
//! or bucket is added, and facts from outside the log (plant, pilot, day).

use std::sync::Arc;

use datafusion::arrow::array::cast::AsArray as _;
use datafusion::arrow::array::types::TimestampMicrosecondType;
use datafusion::arrow::array::{Array as _, ArrayRef, Date32Array, RecordBatch, StringArray};
use datafusion::arrow::compute::concat_batches;
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::error::DataFusionError;
use headrace_tables::schema;

use crate::about::Abouts;
use crate::error::Error;
use crate::maker::Made;
use crate::place::DiveLog;

/// Schema of the table `dives`: the columns of one dive, with `plant`, `pilot` and `day` inserted after `log`.
pub fn dives_schema() -> SchemaRef {
    let fields = schema("dives").map(|schema| schema.fields().to_vec()).unwrap_or_default();
    let mut all = Vec::new();
    for field in fields {
        let is_log = field.name() == "log";
        all.push(field);
        if is_log {
            for (name, kind) in
                [("plant", DataType::Utf8), ("pilot", DataType::Utf8), ("day", DataType::Date32)]
            {
                all.push(Arc::new(Field::new(name, kind, true)));
            }
        }
    }
    Arc::new(Schema::new(all))
}

/// Makes the table `dives`. Each row is the row in a dive's own tables. The log's path in the campaign's folder or
/// bucket is added, and facts from outside the log (plant, pilot, day).
pub(crate) async fn dives_table(dives: &[(DiveLog, Made)], about: &Abouts) -> Result<RecordBatch, Error> {
    let Some(own) = schema("dives") else {
        return Err(DataFusionError::Internal("no dives".to_owned()).into());
    };
    let mut rows = Vec::new();
    for (_, made) in dives {
        rows.extend(made.table("dives").await?);
    }
    let rows = concat_batches(&own, &rows).map_err(DataFusionError::from)?;
    let logs: Vec<String> = dives.iter().map(|(dive, _)| dive.log.clone()).collect();
    let started = rows.column_by_name("started_utc");
    let started = started.and_then(|started| started.as_primitive_opt::<TimestampMicrosecondType>());
    let started = |row: usize| started.filter(|of| of.is_valid(row)).map(|of| of.value(row));
    let abouts: Vec<_> = logs.iter().enumerate().map(|(row, log)| about.of(log, started(row))).collect();
    let schema = dives_schema();
    let columns = schema.fields().iter().map(|field| -> ArrayRef {
        match field.name().as_str() {
            "log" => Arc::new(StringArray::from_iter_values(&logs)),
            "plant" => Arc::new(abouts.iter().map(|about| about.plant.clone()).collect::<StringArray>()),
            "pilot" => Arc::new(abouts.iter().map(|about| about.pilot.clone()).collect::<StringArray>()),
            "day" => Arc::new(abouts.iter().map(|about| about.day).collect::<Date32Array>()),
            name => rows
                .column_by_name(name)
                .cloned()
                .unwrap_or_else(|| Arc::new(StringArray::new_null(logs.len()))),
        }
    });
    let columns = columns.collect();
    let batch = RecordBatch::try_new(schema.clone(), columns);
    Ok(batch.map_err(DataFusionError::from)?)
}
