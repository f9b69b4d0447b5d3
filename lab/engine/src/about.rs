//! Facts about a dive that aren't in its log: plant, pilot, day.
//!
//! The facts come from `dives.csv` in the campaign's folder. Without that file, the plant is the first folder on the
//! log's path, and the day comes from the log's clock.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::place::Place;

/// Name of the file with facts about dives.
pub const FILE: &str = "dives.csv";
/// Columns of `dives.csv`. Only the column `log` is required; the others may be missing or empty.
const COLUMNS: [&str; 4] = ["log", "plant", "pilot", "day"];

/// Facts about a dive that aren't in its log.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct About {
    /// Name of the plant in which the dive took place.
    pub plant: Option<String>,
    /// The pilot's name.
    pub pilot: Option<String>,
    /// Day of the dive, in days since 1970-01-01.
    pub day: Option<i32>,
}

/// Facts about all dives. The key is the log's path.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Abouts(BTreeMap<String, About>);

impl Abouts {
    /// Reads `dives.csv` of a place.
    ///
    /// Errors: the file can't be read; a column or a day is invalid.
    pub async fn read(place: &Place) -> Result<Self, Error> {
        match place.text(FILE).await? {
            Some(text) => Self::parse(&format!("{}{FILE}", place.url()), &text),
            None => Ok(Self::default()),
        }
    }

    fn parse(file: &str, text: &str) -> Result<Self, Error> {
        let wrong = |line: usize, why: String| Error::About { file: file.to_owned(), line, why };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let names = reader.headers().map_err(|error| wrong(1, error.to_string()))?.clone();
        if let Some(unknown) = names.iter().find(|name| !COLUMNS.contains(name)) {
            return Err(wrong(
                1,
                format!("{unknown:?} isn't a column; expected one of {}", COLUMNS.join(", ")),
            ));
        }
        if !names.iter().any(|name| name == "log") {
            return Err(wrong(1, "the column log is missing".to_owned()));
        }
        let mut all = BTreeMap::new();
        for (line, row) in (2..).zip(reader.records()) {
            let row = row.map_err(|error| wrong(line, error.to_string()))?;
            let cell = |column: &str| {
                let found = names.iter().zip(row.iter()).find(|(name, _)| *name == column);
                found.map(|(_, cell)| cell.to_owned()).filter(|cell| !cell.is_empty())
            };
            let Some(log) = cell("log") else { return Err(wrong(line, "log is empty".to_owned())) };
            let day = cell("day").map(|text| {
                day(&text).ok_or_else(|| wrong(line, format!("day = {text}: must be a day like 2024-05-31")))
            });
            let about = About { plant: cell("plant"), pilot: cell("pilot"), day: day.transpose()? };
            if all.insert(log.clone(), about).is_some() {
                return Err(wrong(line, format!("{log} is listed twice")));
            }
        }
        Ok(Self(all))
    }

    /// The facts about a log. `started_us` is the log's start, microseconds of UTC.
    pub fn of(&self, log: &str, started_us: Option<i64>) -> About {
        let mut about = self.0.get(log).cloned().unwrap_or_default();
        let folder = log.split_once('/').map(|(folder, _)| folder.to_owned());
        about.plant = about.plant.or(folder);
        let started = started_us.and_then(|us| i32::try_from(us.div_euclid(86_400_000_000)).ok());
        about.day = about.day.or(started);
        about
    }

    /// Logs that `dives.csv` names but that `logs` doesn't contain.
    pub fn beyond<'a>(&'a self, logs: &[String]) -> Vec<&'a str> {
        self.0.keys().filter(|log| !logs.contains(log)).map(String::as_str).collect()
    }
}

/// Parses a day in ISO 8601.
fn day(text: &str) -> Option<i32> {
    use datafusion::arrow::compute::kernels::cast_utils::Parser as _;
    datafusion::arrow::datatypes::Date32Type::parse(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dives_csv_overrides_facts_from_the_path() {
        let all =
            Abouts::parse("dives.csv", "log, pilot,day\na/x.mcap,Ada,1970-01-03\n\"b,c.mcap\",,\n").unwrap();
        let of = |log: &str, us| all.of(log, us);
        let ada = About { plant: Some("a".to_owned()), pilot: Some("Ada".to_owned()), day: Some(2) };
        assert_eq!(of("a/x.mcap", Some(0)), ada);
        assert_eq!(of("b,c.mcap", Some(-1)), About { day: Some(-1), ..About::default() });
        assert_eq!(of("z.mcap", None), About::default());
        assert_eq!(all.beyond(&["a/x.mcap".to_owned()]), ["b,c.mcap"]);
        let why = |text| Abouts::parse("dives.csv", text).unwrap_err().to_string();
        assert_eq!(
            why("log,pilots\n"),
            "dives.csv:1: \"pilots\" isn't a column; expected one of log, plant, pilot, day"
        );
        assert_eq!(why("log,day\nx,May\n"), "dives.csv:2: day = May: must be a day like 2024-05-31");
        assert_eq!(why("log\nx\nx\n"), "dives.csv:3: x is listed twice");
        assert_eq!(why("plant\n"), "dives.csv:1: there is no column log");
    }
}
