//! Tables of values (CSV) with one timestamp per row.
//!
//! The emulator of a sensor encodes the sensor's values as the bytes that the sensor would have sent, so that the
//! ordinary decoder can read them.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::Rot;
use headrace_geometry::math::PI;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use crate::emulated::{BEYOND, EmulatedSensor, Value};
use crate::entry::{Clock, Entry, Step};
use crate::format::Format;

/// Maximum number of values in a reading of a sensor.
const SLOTS: usize = 9;
const LONGEST_LINE: usize = 1 << 16;

/// A quantity that a sensor measures: name, index among the sensor's values, and allowed units with their factors to
/// SI units.
type Quantity = (&'static str, usize, &'static [(&'static str, f64)]);

const ANGLE: &[(&str, f64)] = &[("rad", 1.0), ("deg", PI / 180.0)];
const RATE: &[(&str, f64)] = &[("rad/s", 1.0), ("deg/s", PI / 180.0)];
const FORCE: &[(&str, f64)] = &[("m/s2", 1.0), ("g", 9.806_65)];
pub(super) const LENGTH: &[(&str, f64)] = &[("m", 1.0), ("cm", 0.01), ("mm", 0.001)];
const SPEED: &[(&str, f64)] = &[("m/s", 1.0)];
pub(super) const PRESSURE: &[(&str, f64)] =
    &[("Pa", 1.0), ("hPa", 100.0), ("mbar", 100.0), ("kPa", 1000.0), ("bar", 1e5)];

/// Returns the quantities that a kind of sensor measures. A table must have all these quantities.
fn quantities(sense: Sense) -> &'static [Quantity] {
    match sense {
        Sense::Head => &[("angle", 0, ANGLE), ("range", 1, LENGTH)],
        Sense::Echosounder => &[("range", 0, LENGTH)],
        Sense::Depth => &[("pressure", 0, PRESSURE)],
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
    time: (usize, u128),
    clock: Clock,
    targets: Vec<Target>,
    header_passed: bool,
}

/// A sensor, and the columns of the table that have the sensor's values.
struct Target {
    sensor: EmulatedSensor,
    /// For each of the sensor's values, its column in the table, and the factor that converts its unit to SI; `None`
    /// for a value without a column.
    columns: [Option<(usize, f64)>; SLOTS],
}

impl Csv {
    /// Creates the format from a mapping, the sensors of a vehicle, and the table's first line.
    ///
    /// Errors: a key has an invalid value, a sensor or column is unknown, or some quantities of a sensor have no
    /// column.
    pub fn new(mapping: &Section<'_>, vehicle: &VehicleConfig, header: &str) -> Result<Self, ConfigError> {
        let separators = [(",", ','), (";", ';'), ("\t", '\t')];
        let separator = mapping.choice("separator", &separators)?.unwrap_or(',');
        // A byte order mark, which spreadsheets may write, isn't part of the header.
        let header = header.trim_start_matches('\u{feff}');
        let names: Vec<&str> = header.trim().split(separator).map(cell).collect();
        let units = [("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1000), ("ns", 1)];
        let unit_ns = mapping.choice("time_unit", &units)?.unwrap_or(1_000_000_000);
        let time = (column(mapping, "time_column", &names)?, unit_ns);
        let clock = if mapping.boolean("utc")?.unwrap_or(false) { Clock::Utc } else { Clock::Own };
        let mut targets: Vec<Target> = Vec::new();
        for section in mapping.sections("columns")? {
            let id = section.required("sensor", section.text("sensor")?)?;
            let known = targets.iter().position(|target| target.sensor.id == id);
            let number = known.unwrap_or(targets.len());
            if known.is_none() {
                let sensor = EmulatedSensor::named(&section, vehicle, &id)?;
                targets.push(Target { sensor, columns: [None; SLOTS] });
            }
            if let Some(target) = targets.get_mut(number) {
                target.read(&section, &names)?;
            }
            section.finish()?;
        }
        for target in &targets {
            let all = quantities(target.sensor.sense).iter();
            let missing = all.filter(|(_, slot, _)| target.columns.get(*slot).is_some_and(Option::is_none));
            let missing: Vec<&str> = missing.map(|(name, ..)| *name).collect();
            if !missing.is_empty() {
                let (id, missing) = (&target.sensor.id, missing.join(", "));
                let problem = format!(
                    "no column for {missing} of sensor {id:?}; every quantity of a sensor needs a column"
                );
                return Err(mapping.invalid("columns", &problem));
            }
        }
        mapping.finish()?;
        Ok(Self { separator, cells: names.len(), time, clock, targets, header_passed: false })
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
        let stamp_ns = nanoseconds(time, self.time.1).ok_or("rows whose time isn't a number from 0 on")?;
        let mut whole = Ok(());
        for target in &mut self.targets {
            whole = whole.and(target.tell(stamp_ns, &cells, out));
        }
        whole
    }
}

impl Format for Csv {
    fn clock(&self) -> Clock {
        self.clock
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
    fn read(&mut self, section: &Section<'_>, names: &[&str]) -> Result<(), ConfigError> {
        let all: Vec<(&str, Quantity)> = quantities(self.sensor.sense).iter().map(|it| (it.0, *it)).collect();
        let (_, slot, units) = section.required("quantity", section.choice("quantity", &all)?)?;
        let unit = section.required("unit", section.choice("unit", units)?)?;
        let factor = section.number("factor", -1e9..=1e9)?.unwrap_or(1.0);
        let place = (column(section, "column", names)?, unit * factor);
        if let Some(column) = self.columns.get_mut(slot)
            && column.replace(place).is_some()
        {
            return Err(section.invalid("quantity", "already has a column for this sensor"));
        }
        Ok(())
    }

    /// Encodes a row's values for one sensor as the bytes that the sensor would have sent. If all of the sensor's cells
    /// are empty, nothing is added.
    ///
    /// Errors: the reason, as text, if a cell can't be parsed or encoded.
    fn tell(&mut self, stamp_ns: u64, cells: &[&str], out: &mut Vec<Entry>) -> Result<(), &'static str> {
        let text = |place: &Option<(usize, f64)>| {
            place.map(|(column, _)| cells.get(column).copied().unwrap_or_default()).unwrap_or_default()
        };
        if self.columns.iter().all(|place| text(place).is_empty()) {
            return Ok(());
        }
        let mut values = [None; SLOTS];
        for (value, place) in values.iter_mut().zip(&self.columns) {
            let unit = place.map_or(1.0, |(_, unit)| unit);
            let number = text(place).parse::<f64>().ok().map(|number| number * unit);
            *value = number.filter(|number| number.is_finite());
        }
        let empty = |slot: usize| self.columns.get(slot).is_none_or(|place| text(place).is_empty());
        let Some(value) = value(self.sensor.sense, values, empty(1)) else {
            return Err("rows with a cell that isn't a number");
        };
        let (value, is_beyond) = self.sensor.within_reach(value);
        let stream = self.sensor.id.clone();
        let is_encoded = self.sensor.tell(MonoNs(stamp_ns), &value, &mut |at, bytes| {
            out.push(Entry { stamp_ns: at.0, stream: stream.clone(), bytes: bytes.to_vec() });
        });
        match (is_encoded, is_beyond) {
            (true, true) => Err(BEYOND),
            (true, false) => Ok(()),
            (false, _) => Err("rows with values that the sensor can't encode"),
        }
    }
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
