//! Compares estimates with the vehicle file's values, and lists the lines to change.

use headrace_sampling::head::faces_aft;
use headrace_vehicle::VehicleConfig;

use crate::calibrate::estimate::{Estimate, NotEstimated};
use crate::calibrate::findings::Findings;
use crate::calibrate::heads::Head;
use crate::calibrate::zero::Zero;

/// Largest relative excess of all ranges at which the estimates of mounts and zeros are still valid.
///
/// The limit is three times the error of tabulated speeds of sound.
const MOST_SCALE: f64 = 0.01;

/// Value of a quantity in the vehicle file and as estimated, in the quantity's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Value {
    /// A quantity that is a number.
    Number {
        /// Value in the vehicle file.
        file: f64,
        /// Estimated value.
        found: Estimate,
    },
    /// Direction in which a head faces.
    Facing {
        /// Direction in the vehicle file.
        file: &'static str,
        /// Estimated direction.
        found: &'static str,
    },
}

/// An estimated quantity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found {
    /// Id of the sensor, or table of the vehicle file.
    pub(crate) of: String,
    /// Name of the quantity.
    pub(crate) what: &'static str,
    /// Unit of the quantity; empty if it has none.
    pub(crate) unit: &'static str,
    /// Number of decimals to print.
    pub(crate) decimals: usize,
    /// Value in the vehicle file, and the estimate.
    pub(crate) value: Value,
}

/// A quantity that the log doesn't determine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Open {
    /// Id of the sensor, or table of the vehicle file.
    pub(crate) of: String,
    /// Name of the quantity.
    pub(crate) what: &'static str,
    /// Reason why the log doesn't determine the quantity.
    pub(crate) why: NotEstimated,
}

/// All estimates compared with a vehicle file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Table {
    /// Estimated quantities.
    pub(crate) found: Vec<Found>,
    /// Quantities that the log doesn't determine.
    pub(crate) open: Vec<Open>,
    /// Tables of the vehicle file, each with its changed lines.
    pub(crate) lines: Vec<(String, Vec<String>)>,
}

impl Found {
    /// Whether an estimate differs so much from the vehicle file that the file should be changed.
    pub(crate) fn differs(&self) -> bool {
        match self.value {
            Value::Number { file, found } => found.differs_from(file),
            Value::Facing { file, found } => file != found,
        }
    }
}

impl Table {
    /// Compares the estimates with the file's values.
    pub(crate) fn of(vehicle: &VehicleConfig, findings: &Findings) -> Self {
        let mut table = Self::default();
        table.water(vehicle, findings);
        match &findings.heads {
            Ok(heads) => heads.heads.iter().for_each(|head| table.head(vehicle, head)),
            Err(why) => table.open("heads", "mounts", *why),
        }
        table.tethers(vehicle, findings);
        table.lags(vehicle, findings);
        table.scale(vehicle, findings);
        table
    }

    /// If ranges don't fit the profile's size, lists the speed of sound and removes all other lines.
    ///
    /// All other estimates were then fitted to a wall of the wrong size, so the file must keep its values.
    fn scale(&mut self, vehicle: &VehicleConfig, findings: &Findings) {
        let Ok(heads) = &findings.heads else { return };
        let Estimate { value, sd } = heads.scale;
        if value.abs() > MOST_SCALE && value.abs() > 3.0 * sd {
            self.lines.clear();
            let sound_mps = vehicle.site.sound_speed_mps / (1.0 + value);
            self.open("water", "speed of sound", NotEstimated::Scaled { long_pct: value * 100.0, sound_mps });
        }
    }

    /// Whether there is an error that no changed line of the vehicle file corrects.
    pub(crate) fn is_amiss(&self) -> bool {
        let amiss = |why: &NotEstimated| {
            matches!(
                why,
                NotEstimated::Later { .. } | NotEstimated::Slow { .. } | NotEstimated::Scaled { .. }
            )
        };
        self.open.iter().any(|open| amiss(&open.why))
    }

    fn open(&mut self, of: &str, what: &'static str, why: NotEstimated) {
        self.open.push(Open { of: of.to_owned(), what, why });
    }

    /// Adds a row with an estimated number, or the reason why there is none. Returns whether the vehicle file should be
    /// changed.
    fn number(
        &mut self,
        of: &str,
        (what, unit, decimals): (&'static str, &'static str, usize),
        file: f64,
        found: Result<Estimate, NotEstimated>,
    ) -> bool {
        match found {
            Ok(found) => {
                let value = Value::Number { file, found };
                let found = Found { of: of.to_owned(), what, unit, decimals, value };
                let differs = found.differs();
                self.found.push(found);
                differs
            }
            Err(why) => {
                self.open(of, what, why);
                false
            }
        }
    }

    fn line(&mut self, of: &str, line: String) {
        match self.lines.iter_mut().find(|(table, _)| table == of) {
            Some((_, lines)) => lines.push(line),
            None => self.lines.push((of.to_owned(), vec![line])),
        }
    }

    fn water(&mut self, vehicle: &VehicleConfig, findings: &Findings) {
        let found =
            |zero: &Result<Zero, NotEstimated>| zero.as_ref().map(|zero| zero.found).map_err(|why| *why);
        let surface = found(&findings.surface);
        let form = ("pressure at the surface", "Pa", 0);
        if self.number("water", form, vehicle.site.surface_pressure_pa, surface) {
            let pa = surface.map_or(0.0, |found| found.value);
            self.line("water", format!("surface_pressure_pa = {}", number(pa, 0)));
        }
        let level = found(&findings.level);
        let form = ("surface above the floor here", "m", 3);
        if self.number("water", form, vehicle.site.surface_above_floor_m, level) {
            let metres = level.map_or(0.0, |found| found.value);
            self.line("water", format!("surface_above_floor_m = {}", number(metres, 3)));
        }
    }

    fn head(&mut self, vehicle: &VehicleConfig, head: &Head) {
        let id = id(vehicle, head.source);
        let facing = |is_aft: bool| if is_aft { "aft" } else { "forward" };
        let filed_aft = faces_aft(head.filed.rotation);
        let mut turns = false;
        match head.is_mirrored {
            Ok(is_mirrored) => {
                turns = is_mirrored;
                let value =
                    Value::Facing { file: facing(filed_aft), found: facing(filed_aft != is_mirrored) };
                self.found.push(Found { of: id.clone(), what: "faces", unit: "", decimals: 0, value });
            }
            Err(why) => self.open(&id, "facing direction", why),
        }
        let (roll, ..) = head.filed.rotation.roll_pitch_yaw();
        let degrees = |of: Estimate| Estimate {
            value: roll.to_degrees() + of.value.to_degrees(),
            sd: of.sd.to_degrees(),
        };
        let form = ("angle about its axis", "deg", 2);
        turns |= self.number(&id, form, roll.to_degrees(), head.angle_rad.map(degrees));
        if turns {
            let (roll, pitch, yaw) = head.found.rotation.roll_pitch_yaw();
            self.line(
                &sensor(&id),
                format!("angles_deg = {}", triple([roll, pitch, yaw].map(f64::to_degrees), 2)),
            );
        }
        let at = head.filed.position;
        let from = |file: f64| move |of: Estimate| Estimate { value: file + of.value, sd: of.sd };
        let left = self.number(&id, ("left", "m", 3), at.y(), head.left_m.map(from(at.y())));
        let up = self.number(&id, ("up", "m", 3), at.z(), head.up_m.map(from(at.z())));
        if left || up {
            // A coordinate that doesn't differ from the estimate stays as written in the file.
            let y_m = if left { head.found.position.y() } else { at.y() };
            let z_m = if up { head.found.position.z() } else { at.z() };
            self.line(&sensor(&id), format!("position_m = {}", triple([at.x(), y_m, z_m], 3)));
        }
    }

    fn tethers(&mut self, vehicle: &VehicleConfig, findings: &Findings) {
        let zeros = match &findings.tethers {
            Ok(zeros) => zeros,
            Err(why) => return self.open("cable counters", "chainage at zero", *why),
        };
        for (zero, file_m) in zeros {
            let id = id(vehicle, zero.source);
            let found = zero.found;
            self.number(&id, ("chainage at zero", "m", 3), *file_m, Ok(found));
            // The line is listed even if the file's value agrees with the estimate. A surveyed position is better than
            // the file's value, even with the uncertainty that the cable's slack leaves.
            self.line(&sensor(&id), format!("zero_at_m = {}", number(found.value, 3)));
        }
    }

    fn lags(&mut self, vehicle: &VehicleConfig, findings: &Findings) {
        let lags = match &findings.lags {
            Ok(lags) => lags,
            Err(why) => return self.open("times", "time offsets", *why),
        };
        for lag in lags {
            let id = id(vehicle, lag.source);
            let latency = vehicle.sensor_configs.get(lag.source).map(|sensor| sensor.latency);
            let file_ms = latency.map_or(0.0, |latency| latency.as_secs_f64() * 1e3);
            let found = lag.offset_s.map(|of| Estimate { value: file_ms + of.value * 1e3, sd: of.sd * 1e3 });
            self.number(&id, ("latency", "ms", 1), file_ms, found);
            // A vehicle file can only have a positive latency.
            if let Ok(found) = found
                && found.value > 0.0
                && found.differs_from(file_ms)
            {
                self.line(&sensor(&id), format!("latency_ms = {}", number(found.value, 1)));
            }
        }
    }
}

fn id(vehicle: &VehicleConfig, source: usize) -> String {
    vehicle.sensor_configs.get(source).map_or_else(|| source.to_string(), |sensor| sensor.id.clone())
}

fn sensor(id: &str) -> String {
    format!("sensors.{id}")
}

/// A number with only the decimals that it needs, and without a negative zero.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn triple(values: [f64; 3], decimals: usize) -> String {
    let [a, b, c] = values.map(|value| number(value, decimals));
    format!("[{a}, {b}, {c}]")
}

#[cfg(test)]
mod tests {
    use super::{number, triple};

    #[test]
    fn numbers_have_no_trailing_zeros_or_negative_zero() {
        assert_eq!(triple([0.551, -0.000_2, 2.0], 3), "[0.551, 0, 2]");
        assert_eq!((number(101_300.4, 0), number(-2.10, 2)), ("101300".to_owned(), "-2.1".to_owned()));
    }
}
