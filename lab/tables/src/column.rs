//! A table as a list of columns. Each column has a description, and a function that takes its value from a row of the
//! report.
//!
//! The schemas, the record batches and the file `docs/reference/dive-tables.csv` are made from the same list.

use std::fmt::Write as _;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray, TimestampMicrosecondArray,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};

use crate::Error;

/// Name of the first column of every table, which identifies the dive.
pub(crate) const DIVE: &str = "dive";
const DIVE_ABOUT: &str = "The dive: first 16 digits of its log's SHA-256; the key between tables";

/// Function that takes a column's value from a row; `None` is null.
pub(crate) enum Get<R> {
    Text(fn(&R) -> Option<String>),
    Number(fn(&R) -> Option<f64>),
    Count(fn(&R) -> Option<i64>),
    Truth(fn(&R) -> Option<bool>),
    /// Time as microseconds of UTC since 1970.
    Moment(fn(&R) -> Option<i64>),
}

impl<R> Get<R> {
    fn data_type(&self) -> DataType {
        match self {
            Self::Text(_) => DataType::Utf8,
            Self::Number(_) => DataType::Float64,
            Self::Count(_) => DataType::Int64,
            Self::Truth(_) => DataType::Boolean,
            Self::Moment(_) => DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into())),
        }
    }

    fn array(&self, rows: &[R]) -> ArrayRef {
        match self {
            Self::Text(get) => Arc::new(rows.iter().map(get).collect::<StringArray>()),
            Self::Number(get) => Arc::new(rows.iter().map(get).collect::<Float64Array>()),
            Self::Count(get) => Arc::new(rows.iter().map(get).collect::<Int64Array>()),
            Self::Truth(get) => Arc::new(rows.iter().map(get).collect::<BooleanArray>()),
            Self::Moment(get) => {
                Arc::new(rows.iter().map(get).collect::<TimestampMicrosecondArray>().with_timezone("UTC"))
            }
        }
    }
}

/// A column: its name with the unit, its description, and the function that takes its value.
pub(crate) struct Column<R>(pub(crate) &'static str, pub(crate) &'static str, pub(crate) Get<R>);

/// A table whose rows are made from values of type `R`.
pub(crate) struct Table<R> {
    pub(crate) name: &'static str,
    /// Description of one row of the table, for the documentation.
    pub(crate) about: &'static str,
    pub(crate) columns: Vec<Column<R>>,
}

impl<R> Table<R> {
    pub(crate) fn schema(&self) -> SchemaRef {
        let dive = Field::new(DIVE, DataType::Utf8, false);
        let columns =
            self.columns.iter().map(|Column(name, _, get)| Field::new(*name, get.data_type(), true));
        Arc::new(Schema::new([dive].into_iter().chain(columns).collect::<Vec<_>>()))
    }

    pub(crate) fn batch(&self, dive: &str, rows: &[R]) -> Result<RecordBatch, Error> {
        let dives: ArrayRef = Arc::new(StringArray::from_iter_values(rows.iter().map(|_| dive)));
        let columns = self.columns.iter().map(|Column(_, _, get)| get.array(rows));
        RecordBatch::try_new(self.schema(), [dives].into_iter().chain(columns).collect())
            .map_err(|source| Error::Table { table: self.name, source })
    }

    /// Appends the table's description as rows of CSV.
    pub(crate) fn describe(&self, page: &mut String) {
        let mut row = |name: &str, kind: &str, about: &str| {
            // Writing to a string can't fail.
            writeln!(page, "{},{name},{kind},\"{}\"", self.name, about.replace('"', "\"\""))
                .unwrap_or_default();
        };
        row("", "", self.about);
        row(DIVE, "text", DIVE_ABOUT);
        for Column(name, about, get) in &self.columns {
            let kind = match get {
                Get::Text(_) => "text",
                Get::Number(_) => "number",
                Get::Count(_) => "integer",
                Get::Truth(_) => "boolean",
                Get::Moment(_) => "time",
            };
            row(name, kind, about);
        }
    }
}

/// Converts a count to Arrow's widest signed integer, which SQL sums without surprises.
#[expect(clippy::unnecessary_wraps, reason = "as columns want it")]
pub(crate) fn count(value: impl TryInto<i64>) -> Option<i64> {
    Some(value.try_into().unwrap_or(i64::MAX))
}
