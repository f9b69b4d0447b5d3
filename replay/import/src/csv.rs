//! Tables of values (CSV) with one timestamp per row.
//!
//! The emulator of a sensor encodes the sensor's values as the bytes that the sensor would have sent, so that the
//! ordinary decoder can read them.

use std::collections::BTreeMap;

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::Rot;
use headrace_geometry::math::{self, PI};
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use crate::calendar::iso_8601_ns;
use crate::emulated::{BEYOND, Doubt, EmulatedSensor, Unsent, Value};
use crate::entry::{Clock, Entry, ImportReport, Step};
use crate::format::Format;

/// Maximum number of values in a reading of a sensor.
const SLOTS: usize = 9;
const LONGEST_LINE: usize = 1 << 16;
/// Allowed speeds of sound with which a device computed ranges, m/s. The vehicle file has the same limits.
pub(super) const SOUND_SPEED_MPS: core::ops::RangeInclusive<f64> = 1000.0..=2000.0;

/// A quantity that a sensor measures: name, index among the sensor's values, and allowed units with their factors to
/// SI units. Quantities with the same index are alternatives.
type Quantity = (&'static str, usize, &'static [(&'static str, f64)]);

const ANGLE: &[(&str, f64)] = &[("rad", 1.0), ("deg", PI / 180.0)];
const RATE: &[(&str, f64)] = &[("rad/s", 1.0), ("deg/s", PI / 180.0)];
const FORCE: &[(&str, f64)] = &[("m/s2", 1.0), ("g", 9.806_65)];
pub(super) const LENGTH: &[(&str, f64)] = &[("m", 1.0), ("cm", 0.01), ("mm", 0.001)];
const SPEED: &[(&str, f64)] = &[("m/s", 1.0)];
pub(super) const PRESSURE: &[(&str, f64)] =
    &[("Pa", 1.0), ("hPa", 100.0), ("mbar", 100.0), ("kPa", 1000.0), ("bar", 1e5)];

/// Statement of a column about the doubt in a sensor's values.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Doubtful {
    Confidence,
    Valid,
    Status,
    Sd,
    Variance,
}

/// A column about doubt: name, meaning, and allowed units with their factors to SI units; without units for flags.
type DoubtColumn = (&'static str, Doubtful, &'static [(&'static str, f64)]);

const CONFIDENCE: DoubtColumn = ("confidence", Doubtful::Confidence, &[("ratio", 1.0), ("percent", 0.01)]);
const VALID: DoubtColumn = ("valid", Doubtful::Valid, &[]);
const STATUS: DoubtColumn = ("status", Doubtful::Status, &[]);
const LENGTH_VARIANCE: DoubtColumn = ("variance", Doubtful::Variance, &[("m2", 1.0), ("mm2", 1e-6)]);

/// Returns the columns about doubt that a kind of sensor can have. None of them is required.
fn doubt_columns(sense: Sense) -> &'static [DoubtColumn] {
    match sense {
        Sense::Head | Sense::Echosounder => {
            &[CONFIDENCE, VALID, STATUS, ("sd", Doubtful::Sd, LENGTH), LENGTH_VARIANCE]
        }
        Sense::Depth => &[
            VALID,
            STATUS,
            ("sd", Doubtful::Sd, PRESSURE),
            ("variance", Doubtful::Variance, &[("Pa2", 1.0)]),
        ],
        Sense::Inertial => &[VALID, STATUS],
        Sense::Velocity => {
            &[VALID, STATUS, ("sd", Doubtful::Sd, SPEED), ("variance", Doubtful::Variance, &[("m2/s2", 1.0)])]
        }
        Sense::Tether => &[VALID, STATUS, ("sd", Doubtful::Sd, LENGTH), LENGTH_VARIANCE],
    }
}

/// Returns the quantities that a kind of sensor measures. A table must have one for each index.
fn quantities(sense: Sense) -> &'static [Quantity] {
    match sense {
        Sense::Head => &[("angle", 0, ANGLE), ("range", 1, LENGTH)],
        Sense::Echosounder => &[("range", 0, LENGTH)],
        Sense::Depth => &[("pressure", 0, PRESSURE), ("gauge_pressure", 0, PRESSURE), ("depth", 0, LENGTH)],
        Sense::Inertial => &[
            ("roll", 0, ANGLE),
            ("pitch", 1, ANGLE),
            ("yaw", 2, ANGLE),
            ("rate_x", 3, RATE),
            ("rate_y", 4, RATE),
            ("rate_z", 5, RATE),
            ("force_x", 6, FORCE),
            ("force_y", 7, FORCE),
            ("force_z", 8, FORCE),
        ],
        Sense::Velocity => &[("velocity_x", 0, SPEED), ("velocity_y", 1, SPEED), ("velocity_z", 2, SPEED)],
        Sense::Tether => &[("chainage", 0, LENGTH)],
    }
}

/// The CSV format of a table with a known header. Each stream has the id of its sensor as its name.
pub struct Csv {
    separator: char,
    /// Number of cells in a row of the table.
    cells: usize,
    time: (usize, TimeForm),
    /// Whether times without a stated zone are UTC.
    is_utc: bool,
    /// Whether the first row's time states its zone; `None` before the first row.
    is_zoned: Option<bool>,
    targets: Vec<Target>,
    header_passed: bool,
    /// Number of lost readings, by reason, in rows that already have a loss for another reading.
    further_losses: BTreeMap<&'static str, u64>,
}

/// Form of the times in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
enum TimeForm {
    /// Numbers of a unit with this many nanoseconds.
    Number(u128),
    /// Dates and times of ISO 8601.
    Iso8601,
}

/// A sensor, and the columns of the table that have the sensor's values.
struct Target {
    sensor: EmulatedSensor,
    /// For each of the sensor's values, its column; `None` for a value without a column.
    columns: [Option<Column>; SLOTS],
    doubts: Vec<(Doubtful, Column)>,
    /// Whether ranges are taken as true at the site's speed of sound, because the mapping states no other.
    has_assumed_speed: bool,
}

/// A column of the table, with the factor and the offset that convert its numbers to SI units.
#[derive(Debug, Clone, Copy)]
struct Column {
    at: usize,
    factor: f64,
    offset: f64,
}

impl Csv {
    /// Creates the format from a mapping, the sensors of a vehicle, and the table's first lines.
    ///
    /// Errors: a key has an invalid value, a sensor or column is unknown, some quantities of a sensor have no column, or
    /// the ranges of a head are the points of an echo.
    pub fn new(mapping: &Section<'_>, vehicle: &VehicleConfig, front: &str) -> Result<Self, ConfigError> {
        let separators = [(",", ','), (";", ';'), ("\t", '\t')];
        let separator = mapping.choice("separator", &separators)?.unwrap_or(',');
        // A byte order mark, which spreadsheets may write, isn't part of the header.
        let mut lines = front.trim_start_matches('\u{feff}').lines();
        let header = lines.next().unwrap_or_default();
        let names: Vec<&str> = header.trim().split(separator).map(cell).collect();
        let seconds = TimeForm::Number(1_000_000_000);
        let forms = [
            ("s", seconds),
            ("ms", TimeForm::Number(1_000_000)),
            ("us", TimeForm::Number(1000)),
            ("ns", TimeForm::Number(1)),
            ("iso8601", TimeForm::Iso8601),
        ];
        let form = mapping.choice("time_unit", &forms)?.unwrap_or(seconds);
        let time = (column(mapping, "time_column", &names)?, form);
        let is_utc = mapping.boolean("utc")?.unwrap_or(false);
        let mut targets: Vec<Target> = Vec::new();
        for section in mapping.sections("columns")? {
            let id = section.required("sensor", section.text("sensor")?)?;
            let known = targets.iter().position(|target| target.sensor.id == id);
            let number = known.unwrap_or(targets.len());
            if known.is_none() {
                targets.push(Target::new(EmulatedSensor::named(&section, vehicle, &id)?));
            }
            if let Some(target) = targets.get_mut(number) {
                target.read(&section, &names)?;
            }
            section.finish()?;
        }
        let rows: Vec<Vec<&str>> = lines.map(|row| row.split(separator).map(cell).collect()).collect();
        for target in &targets {
            target.check(mapping, time.0, &rows)?;
        }
        mapping.finish()?;
        Ok(Self {
            separator,
            cells: names.len(),
            time,
            is_utc,
            is_zoned: None,
            targets,
            header_passed: false,
            further_losses: BTreeMap::new(),
        })
    }

    fn row(&mut self, line: &str, out: &mut Vec<Entry>) -> Result<(), &'static str> {
        let cells: Vec<&str> = line.split(self.separator).map(cell).collect();
        // Extra cells at the end of a row are allowed if they are empty.
        if cells.get(self.cells..).is_none_or(|more| more.iter().any(|cell| !cell.is_empty())) {
            return Err(
                "rows with more or fewer cells than the header: cut short, or numbers contain the separator",
            );
        }
        let time = cells.get(self.time.0).copied().unwrap_or_default();
        let stamp_ns = self.stamp_ns(time)?;
        let mut first = Ok(());
        for target in &mut self.targets {
            let Err(why) = target.tell(stamp_ns, &cells, out) else { continue };
            if first.is_ok() {
                first = Err(why);
            } else {
                *self.further_losses.entry(why).or_default() += 1;
            }
        }
        first
    }

    fn stamp_ns(&mut self, time: &str) -> Result<u64, &'static str> {
        if let TimeForm::Number(unit_ns) = self.time.1 {
            return nanoseconds(time, unit_ns).ok_or("rows whose time isn't a number from 0 on");
        }
        let (stamp_ns, is_zoned) = iso_8601_ns(time)
            .ok_or("rows whose time isn't one of ISO 8601, such as 2026-05-04T12:30:00.5Z")?;
        if *self.is_zoned.get_or_insert(is_zoned) != is_zoned {
            return Err("rows that state a time zone, unlike the first row, or state none, unlike it");
        }
        Ok(stamp_ns)
    }
}

impl Format for Csv {
    fn clock(&self) -> Clock {
        match self.time.1 {
            _ if self.is_utc || self.is_zoned == Some(true) => Clock::Utc,
            TimeForm::Iso8601 => Clock::Local,
            TimeForm::Number(_) => Clock::Own,
        }
    }

    fn report(&self) -> ImportReport {
        let assumed = self.targets.iter().filter(|target| target.has_assumed_speed);
        let remarks = assumed.map(|target| target.sensor.assumed_speed()).collect();
        let further = self.further_losses.iter();
        let losses = further
            .map(|(why, count)| format!("{why}: {count} more, in rows with a loss for another sensor"))
            .collect();
        ImportReport { losses, remarks }
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        let (line, used) = match front.iter().take(LONGEST_LINE).position(|byte| *byte == b'\n') {
            Some(at) => (front.get(..at).unwrap_or_default(), at + 1),
            None if front.len() >= LONGEST_LINE => return Step::Lost(LONGEST_LINE, "no row within 64 KiB"),
            None if end => (front, front.len()),
            None => return Step::More,
        };
        let is_ended = line.len() < used;
        let line = line.trim_ascii();
        if !core::mem::replace(&mut self.header_passed, true) || line.is_empty() {
            return Step::Took(used);
        }
        if !is_ended {
            // The last number in the row may be truncated. It could then be read as a wrong number.
            return Step::Lost(used, "a last row without a line end: it may be cut short, and is skipped");
        }
        let Ok(line) = str::from_utf8(line) else { return Step::Lost(used, "rows that aren't UTF-8 text") };
        match self.row(line, out) {
            Ok(()) => Step::Took(used),
            Err(why) => Step::Lost(used, why),
        }
    }
}

fn cell(text: &str) -> &str {
    text.trim().trim_matches('"').trim()
}

fn column(section: &Section<'_>, key: &'static str, names: &[&str]) -> Result<usize, ConfigError> {
    let name = section.required(key, section.text(key)?)?;
    let found = names.iter().position(|column| *column == name);
    found
        .ok_or_else(|| section.invalid(key, &format!("isn't a column; expected one of {}", names.join(", "))))
}

impl Target {
    fn new(sensor: EmulatedSensor) -> Self {
        Self { sensor, columns: [None; SLOTS], doubts: Vec::new(), has_assumed_speed: false }
    }

    fn read(&mut self, section: &Section<'_>, names: &[&str]) -> Result<(), ConfigError> {
        let quantities = quantities(self.sensor.sense);
        let doubts = doubt_columns(self.sensor.sense);
        let all: Vec<(&str, &str)> = quantities
            .iter()
            .map(|it| it.0)
            .chain(doubts.iter().map(|it| it.0))
            .map(|name| (name, name))
            .collect();
        let name = section.required("quantity", section.choice("quantity", &all)?)?;
        let at = column(section, "column", names)?;
        if let Some((_, doubt, units)) = doubts.iter().find(|(doubt, ..)| *doubt == name) {
            let is_flag = units.is_empty();
            let [unit, factor] = if is_flag { [1.0; 2] } else { unit_and_factor(section, units)? };
            self.doubts.push((*doubt, Column { at, factor: unit * factor, offset: 0.0 }));
            return Ok(());
        }
        let Some((_, slot, units)) = quantities.iter().find(|(quantity, ..)| *quantity == name) else {
            return Ok(());
        };
        let place = self.place(section, name, at, unit_and_factor(section, units)?)?;
        if let Some(column) = self.columns.get_mut(*slot)
            && column.replace(place).is_some()
        {
            return Err(section.invalid("quantity", "already has a column for this sensor"));
        }
        Ok(())
    }

    /// Reads the keys that convert some quantities: the speed of sound of ranges, the offset of depths and pressures.
    fn place(
        &mut self,
        section: &Section<'_>,
        name: &str,
        at: usize,
        [unit, factor]: [f64; 2],
    ) -> Result<Column, ConfigError> {
        let site = self.sensor.site;
        let factor = unit * factor;
        if name == "range" {
            let mps = section.number("sound_speed_mps", SOUND_SPEED_MPS)?;
            self.has_assumed_speed = mps.is_none();
            let scale = mps.map_or(1.0, |mps| site.rescaled_range_m(1.0, mps));
            return Ok(Column { at, factor: factor * scale, offset: 0.0 });
        }
        if self.sensor.sense != Sense::Depth {
            return Ok(Column { at, factor, offset: 0.0 });
        }
        let (scale, zero_pa) = match name {
            "depth" => (site.density_kgpm3 * site.gravity_mps2, site.surface_pressure_pa),
            "gauge_pressure" => (1.0, site.surface_pressure_pa),
            _ => (1.0, 0.0),
        };
        let offset = section.number("offset", -1e9..=1e9)?.unwrap_or(0.0);
        // The mapping's factor applies to the table's numbers only, not to the offset.
        Ok(Column { at, factor: factor * scale, offset: zero_pa + offset * unit * scale })
    }

    /// Checks that no quantity lacks a column, and that a head's ranges in the table's first rows can be ranges.
    fn check(&self, mapping: &Section<'_>, time_at: usize, rows: &[Vec<&str>]) -> Result<(), ConfigError> {
        let id = &self.sensor.id;
        let missing = self.columns.iter().enumerate().filter(|(_, column)| column.is_none());
        let names = |slot: usize| {
            let all = quantities(self.sensor.sense).iter().filter(|it| it.1 == slot);
            all.map(|it| it.0).collect::<Vec<_>>().join(" or ")
        };
        let missing: Vec<String> =
            missing.map(|(slot, _)| names(slot)).filter(|names| !names.is_empty()).collect();
        if !missing.is_empty() {
            let missing = missing.join(", ");
            let problem = format!(
                "no column for {missing} of sensor {id:?}; every quantity of a sensor needs a column"
            );
            return Err(mapping.invalid("columns", &problem));
        }
        let [Some(angle), Some(range), ..] = self.columns else { return Ok(()) };
        let pings = rows
            .iter()
            .filter_map(|row| Some((*row.get(time_at)?, *row.get(angle.at)?, *row.get(range.at)?)));
        // Rows without a range of this head may lie between the points of an echo.
        let pings: Vec<_> =
            pings.filter(|(_, angle, range)| !angle.is_empty() && !range.is_empty()).collect();
        let is_one_ping = |rows: &[(&str, &str, &str)]| match rows {
            [one, two, three] => {
                (one.0, one.1) == (two.0, two.1)
                    && (two.0, two.1) == (three.0, three.1)
                    && one.2 != two.2
                    && two.2 != three.2
            }
            _ => false,
        };
        if self.sensor.is_head() && pings.windows(3).any(is_one_ping) {
            let problem = format!(
                "the table has three ranges of sensor {id:?} at one time and angle: the points of an echo, not \
                 ranges; a head has one range for each ping, so detect the wall in each echo first"
            );
            return Err(mapping.invalid("columns", &problem));
        }
        Ok(())
    }

    /// Encodes a row's values for one sensor as the bytes that the sensor would have sent. If all of the sensor's cells
    /// are empty, nothing is added.
    ///
    /// Errors: the reason, as text, if a cell can't be parsed or encoded, or states a doubt that can't be encoded.
    fn tell(&mut self, stamp_ns: u64, cells: &[&str], out: &mut Vec<Entry>) -> Result<(), &'static str> {
        let text = |place: &Option<Column>| {
            place.map(|column| cells.get(column.at).copied().unwrap_or_default()).unwrap_or_default()
        };
        if self.columns.iter().all(|place| text(place).is_empty()) {
            return Ok(());
        }
        let empty = |slot: usize| self.columns.get(slot).is_none_or(|place| text(place).is_empty());
        let has_no_echo = self.sensor.is_head() && empty(1);
        let doubt = self
            .doubt(cells, has_no_echo)
            .ok_or("rows whose confidence, validity, status, sd or variance is missing or not allowed")?;
        let mut values = [None; SLOTS];
        for (value, place) in values.iter_mut().zip(&self.columns) {
            let Some(Column { factor, offset, .. }) = place else { continue };
            let number = text(place).parse::<f64>().ok().map(|number| number * factor + offset);
            *value = number.filter(|number| number.is_finite());
        }
        let Some(value) = value(self.sensor.sense, values, has_no_echo) else {
            return Err("rows with a cell that isn't a number");
        };
        let (value, is_beyond) = self.sensor.within_reach(value);
        let stream = self.sensor.id.clone();
        let told = self.sensor.tell(MonoNs(stamp_ns), &value, &doubt, &mut |at, bytes| {
            out.push(Entry { stamp_ns: at.0, stream: stream.clone(), bytes: bytes.to_vec() });
        });
        match told {
            Ok(()) if is_beyond => Err(BEYOND),
            Ok(()) => Ok(()),
            Err(Unsent::Unencodable) => Err("rows with values that the sensor can't encode"),
            Err(Unsent::Doubtful(why)) => Err(why),
        }
    }

    /// Parses the doubt that a row states about the sensor's values. The worst of several statements counts.
    ///
    /// Confidence, sd and variance belong to a range. Without an echo, they are ignored.
    fn doubt(&self, cells: &[&str], has_no_echo: bool) -> Option<Doubt> {
        let mut doubt = Doubt::NONE;
        for (meaning, Column { at, factor, .. }) in &self.doubts {
            let is_flag = matches!(meaning, Doubtful::Valid | Doubtful::Status);
            if has_no_echo && !is_flag {
                continue;
            }
            let text = cells.get(*at).copied().unwrap_or_default();
            let number = match text.to_ascii_lowercase().as_str() {
                "true" if is_flag => 1.0,
                "false" if is_flag => 0.0,
                number => number.parse::<f64>().ok().filter(|number| number.is_finite())? * factor,
            };
            match meaning {
                Doubtful::Valid => doubt.is_valid &= number.abs() > 0.0,
                // A device's status has few bits. A greater number is a fault all the same.
                Doubtful::Status if number.abs() > 0.0 => {
                    let status = u8::try_from(math::round_to_i64(number)).unwrap_or(u8::MAX);
                    doubt.status = doubt.status.max(status.max(1));
                }
                Doubtful::Status => (),
                Doubtful::Confidence if (0.0..=1.0).contains(&number) => {
                    doubt.confidence = doubt.confidence.min(number);
                }
                Doubtful::Sd if number >= 0.0 => doubt.variance = doubt.variance.max(number * number),
                Doubtful::Variance if number >= 0.0 => doubt.variance = doubt.variance.max(number),
                _ => return None,
            }
        }
        Some(doubt)
    }
}

/// Reads the unit of a column, as its factor to SI units, and the factor that the mapping gives.
fn unit_and_factor(section: &Section<'_>, units: &[(&str, f64)]) -> Result<[f64; 2], ConfigError> {
    let unit = section.required("unit", section.choice("unit", units)?)?;
    Ok([unit, section.number("factor", -1e9..=1e9)?.unwrap_or(1.0)])
}

/// Builds a sensor's value from the numbers in a row; `None` if a number is missing.
///
/// A head with an angle and no range had no echo.
fn value(sense: Sense, values: [Option<f64>; SLOTS], no_range: bool) -> Option<Value> {
    let [a, b, c, d, e, f, g, h, i] = values;
    Some(match sense {
        Sense::Head => Value::Beam(a?, if no_range { None } else { Some(b?) }),
        Sense::Echosounder => Value::Range(Some(a?)),
        Sense::Depth => Value::Pressure(a?),
        Sense::Inertial => Value::Inertia(Rot::from_roll_pitch_yaw(a?, b?, c?), [d?, e?, f?], [g?, h?, i?]),
        Sense::Velocity => Value::Velocity([a?, b?, c?]),
        Sense::Tether => Value::Payout(a?),
    })
}

/// Parses a decimal number of time units as nanoseconds. The result is exact, but cut off to whole nanoseconds.
fn nanoseconds(text: &str, unit_ns: u128) -> Option<u64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    if whole.is_empty() || !whole.bytes().chain(fraction.bytes()).all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let fraction = fraction.get(..fraction.len().min(15))?;
    let scale = 10_u128.checked_pow(u32::try_from(fraction.len()).ok()?)?;
    let part = if fraction.is_empty() { 0 } else { fraction.parse::<u128>().ok()? };
    let ns = whole.parse::<u128>().ok()?.checked_mul(unit_ns)?.checked_add(part * unit_ns / scale)?;
    // Timestamps are limited to 2^62 ns, because emulators add delays to them.
    u64::try_from(ns).ok().filter(|ns| *ns < 1 << 62)
}

#[cfg(test)]
mod tests {
    use super::nanoseconds;

    #[test]
    fn table_times_are_parsed_to_the_nanosecond() {
        let seconds = 1_000_000_000;
        assert_eq!(nanoseconds("1700000000.123456789", seconds), Some(1_700_000_000_123_456_789));
        assert_eq!(nanoseconds("12", 1000), Some(12_000));
        assert_eq!(nanoseconds("0.5", 1000), Some(500));
        assert_eq!(nanoseconds("7.9", 1), Some(7));
        for text in ["", ".5", "-1", "1e3", "1.2.3", "nan", "99999999999999999999", "5000000000.0"] {
            assert_eq!(nanoseconds(text, seconds), None, "{text}");
        }
    }
}
