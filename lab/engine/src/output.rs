//! Writes the answer of a query to the terminal, or to a file whose extension determines the format.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::csv::WriterBuilder;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::arrow::error::ArrowError;
use datafusion::arrow::json::LineDelimitedWriter;
use datafusion::arrow::util::pretty::pretty_format_batches;
use datafusion::error::DataFusionError;
use datafusion::parquet::arrow::ArrowWriter;

use crate::error::{Error, of_file};

/// File extensions that [`write`] supports.
pub const ENDINGS: [&str; 3] = ["csv", "json", "parquet"];

/// Formats an answer as a text table.
///
/// Errors: a value can't be formatted.
pub fn pretty(answer: &[RecordBatch]) -> Result<String, Error> {
    let shown = pretty_format_batches(answer).map_err(DataFusionError::from)?;
    Ok(shown.to_string())
}

/// Checks that [`write`] supports a path's extension.
///
/// Errors: the extension isn't supported.
pub fn check(path: &Path) -> Result<(), Error> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned()).unwrap_or_default();
    if ENDINGS.contains(&ending.as_str()) {
        return Ok(());
    }
    Err(Error::Usage(format!("--out {}: expected an ending of .{}", path.display(), ENDINGS.join(", ."))))
}

/// Writes an answer as CSV, JSON lines or Parquet, by the path's extension.
///
/// Errors: the extension isn't supported, or the file can't be written.
pub fn write(path: &Path, schema: &SchemaRef, answer: &[RecordBatch]) -> Result<(), Error> {
    check(path)?;
    let mut file = File::create(path).map_err(of_file("writing", path))?;
    let failed = |error: ArrowError| of_file("writing", path)(std::io::Error::other(error));
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("csv") => {
            let mut writer = WriterBuilder::new().with_header(true).build(&mut file);
            if answer.is_empty() {
                writer.write(&RecordBatch::new_empty(schema.clone())).map_err(failed)?;
            }
            answer.iter().try_for_each(|batch| writer.write(batch)).map_err(failed)?;
        }
        Some("json") => {
            let mut writer = LineDelimitedWriter::new(&mut file);
            answer.iter().try_for_each(|batch| writer.write(batch)).map_err(failed)?;
            writer.finish().map_err(failed)?;
        }
        _ => {
            let failed = |source| Error::Parquet { doing: "writing", path: path.to_owned(), source };
            let copy = file.try_clone().map_err(of_file("writing", path))?;
            let mut writer = ArrowWriter::try_new(copy, schema.clone(), None).map_err(failed)?;
            answer.iter().try_for_each(|batch| writer.write(batch)).map_err(failed)?;
            writer.close().map_err(failed)?;
        }
    }
    file.flush().map_err(of_file("writing", path))
}

/// The text in a column's first row.
pub fn only_text(array: &datafusion::arrow::array::ArrayRef) -> Option<String> {
    use datafusion::arrow::array::{Array as _, cast::AsArray as _};
    let texts = array.as_string_opt::<i32>()?;
    (!texts.is_empty() && texts.is_valid(0)).then(|| texts.value(0).to_owned())
}

/// The integer in a column's first row.
pub fn only_count(array: &datafusion::arrow::array::ArrayRef) -> Option<i64> {
    use datafusion::arrow::array::{Array as _, cast::AsArray as _, types::Int64Type};
    let counts = array.as_primitive_opt::<Int64Type>()?;
    (!counts.is_empty() && counts.is_valid(0)).then(|| counts.value(0))
}
