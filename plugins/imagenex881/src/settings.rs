//! A head's settings: the keys of its table in the vehicle file, the scan modes, and angle conversion.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::geometry::math::{self, TAU};
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::sampling::head::{Basis, HeadBody, HeadMode, Turn};

use crate::codec::{COUNTS_PER_TURN, Command, Points, RANGES_M, SOUND_SPEED_MPS, ZERO_COUNT};

/// A scan mode with its name, step and turn period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Name of the mode in vehicle files.
    pub name: &'static str,
    /// Step between pings in counts of 0.3 degrees.
    pub step_counts: u8,
    /// Turn period at a range setting of 10 m, ms.
    pub turn_ms: i64,
}

/// Scan modes. Source: Jorge et al. 2021, Table 2.
pub const MODES: [Mode; 5] = [
    Mode { name: "slow", step_counts: 1, turn_ms: 21_600 },
    Mode { name: "medium", step_counts: 2, turn_ms: 10_800 },
    Mode { name: "fast", step_counts: 3, turn_ms: 8_000 },
    Mode { name: "faster", step_counts: 4, turn_ms: 6_600 },
    Mode { name: "fastest", step_counts: 8, turn_ms: 4_800 },
];

/// Range setting for which the table of modes states turn periods, m.
const TABLE_RANGE_M: u8 = 10;

/// A turn period measured in one mode at one range setting.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MeasuredTurn {
    step_counts: u8,
    range_m: u8,
    period: DurNs,
}

/// Default size of a head's housing, measured from the beam. Source: radius from Jorge et al. 2021, §8.3. The
/// lengths are estimates.
const USUAL_BODY: HeadBody = HeadBody { radius_m: 0.04, ahead_m: 0.03, behind_m: 0.2 };

/// Checked settings of a head. Every command built from these settings can be encoded.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Command that requests a ping in mid-turn.
    pub command: Command,
    /// Step in counts of 0.3 degrees. It is one of the steps that the command supports.
    pub step_counts: u8,
    /// Time between two successive pings.
    pub ping_period: DurNs,
    /// +1 if device angles increase with the sensor frame's angles, else -1.
    pub angle_sign: f64,
    /// Angle in the sensor frame at device angle 0, radians.
    pub angle_offset_rad: f64,
    /// Size of the head's housing.
    pub body: HeadBody,
    measured: Vec<MeasuredTurn>,
}

impl Settings {
    /// Reads a head's keys.
    ///
    /// Errors: a key is missing or not allowed, or the latency isn't below the ping period.
    pub fn read(sensor: &SensorConfig, own: &Section<'_>) -> Result<Self, ConfigError> {
        let choices = MODES.map(|mode| (mode.name, mode));
        let known = own.required("mode", own.choice("mode", &choices)?);
        // If the key `mode` is missing, the other keys are still checked, with an arbitrary mode.
        let mode = *known.as_ref().unwrap_or(&MODES[0]);
        let command = command(mode, own)?;
        let measured = measured_turns(mode, command.range_m, own)?;
        let (turn, _) = turn_period(mode, command.range_m, &measured);
        let usual = USUAL_BODY;
        let length = |key, usual: f64| Ok(own.number(key, 0.0..=1.0)?.unwrap_or(usual));
        let settings = Self {
            command,
            step_counts: mode.step_counts,
            ping_period: DurNs(turn.0 / i64::from(pings_a_turn(mode))),
            angle_sign: own.choice("angle_sign", &[("normal", 1.0), ("inverted", -1.0)])?.unwrap_or(1.0),
            angle_offset_rad: own.number("angle_offset_deg", -360.0..=360.0)?.unwrap_or(0.0).to_radians(),
            body: HeadBody {
                radius_m: length("body_radius_m", usual.radius_m)?,
                ahead_m: length("body_ahead_m", usual.ahead_m)?,
                behind_m: length("body_behind_m", usual.behind_m)?,
            },
            measured,
        };
        known?;
        if sensor.latency >= settings.ping_period {
            let most = settings.ping_period.as_secs_f64() * 1000.0;
            let problem =
                format!("must be below the ping period of {most} ms: a head answers before the next command");
            return Err(own.invalid("latency_ms", &problem));
        }
        Ok(settings)
    }

    /// All modes at a range setting, each with the best known turn period.
    pub fn modes(&self, range_m: u8) -> Vec<HeadMode> {
        modes(range_m, &self.measured)
    }

    /// Full width of the beam at the configured frequency, radians.
    pub fn beam_rad(&self) -> f64 {
        beam_rad(self.command.frequency_khz)
    }

    /// Step between pings, radians.
    pub fn step_rad(&self) -> f64 {
        rad_of_counts(i32::from(self.step_counts))
    }

    /// Sensor-frame angle of a head position, radians.
    pub fn sensor_rad(&self, position: u16) -> f64 {
        self.angle_sign * rad_of_counts(i32::from(position) - ZERO_COUNT) + self.angle_offset_rad
    }

    /// Head position nearest to a sensor-frame angle, 0 to 1199.
    pub fn position(&self, sensor_rad: f64) -> i32 {
        let device_rad = self.angle_sign * (sensor_rad - self.angle_offset_rad);
        (counts_of_rad(device_rad) + ZERO_COUNT).rem_euclid(COUNTS_PER_TURN)
    }
}

/// Number of counts nearest to an angle in radians. Angles beyond a thousand turns are clamped.
pub(crate) fn counts_of_rad(angle_rad: f64) -> i32 {
    let most = i64::from(COUNTS_PER_TURN) * 1000;
    let counts = math::round_to_i64(angle_rad * f64::from(COUNTS_PER_TURN) / TAU).clamp(-most, most);
    i32::try_from(counts).unwrap_or(0)
}

/// Converts counts to radians.
fn rad_of_counts(counts: i32) -> f64 {
    f64::from(counts) * TAU / f64::from(COUNTS_PER_TURN)
}

/// Converts a range to the head's setting.
///
/// Errors: a text, if the head has no such setting.
pub fn range_setting(range_m: f64) -> Result<u8, String> {
    RANGES_M
        .into_iter()
        .find(|setting| (f64::from(*setting) - range_m).abs() < 1e-9)
        .ok_or_else(|| format!("{range_m} m is not a range setting of the head; it has {RANGES_M:?}"))
}

/// All modes at a range setting, for a head without measured turn periods.
pub fn usual_modes(range_m: u8) -> Vec<HeadMode> {
    modes(range_m, &[])
}

/// Full width of the profiling beam, radians: 2.4 degrees up to 600 kHz, falling linearly to 1.4 degrees at 1 MHz.
///
/// Source: Jorge et al. 2021, §6; the profiling head's model in LSTS DUNE.
pub fn beam_rad(frequency_khz: f64) -> f64 {
    let share = ((frequency_khz - 600.0) / 400.0).clamp(0.0, 1.0);
    f64::to_radians(2.4 - share)
}

fn modes(range_m: u8, measured: &[MeasuredTurn]) -> Vec<HeadMode> {
    let mode = |mode: &Mode| {
        let (period, basis) = turn_period(*mode, range_m, measured);
        let step_rad = rad_of_counts(i32::from(mode.step_counts));
        let turn = Turn::new(step_rad, period.as_secs_f64()).ok()?;
        Some(HeadMode { name: mode.name, turn, basis })
    };
    MODES.iter().filter_map(mode).collect()
}

fn pings_a_turn(mode: Mode) -> i32 {
    COUNTS_PER_TURN / i32::from(mode.step_counts)
}

/// Turn period at a range setting.
///
/// Known periods are the maker's table and the periods measured in this mode. At a known range, the period is the known
/// value. Between two known ranges, the period is interpolated linearly. Beyond the known ranges, it is extrapolated by
/// the two-way travel time per ping, because the rest of the ping period (stepping, line) doesn't depend on range.
fn turn_period(mode: Mode, range_m: u8, measured: &[MeasuredTurn]) -> (DurNs, Basis) {
    let table = MeasuredTurn {
        step_counts: mode.step_counts,
        range_m: TABLE_RANGE_M,
        period: DurNs(mode.turn_ms * 1_000_000),
    };
    let of_mode = || measured.iter().filter(|turn| turn.step_counts == mode.step_counts);
    let at_table = of_mode().any(|turn| turn.range_m == TABLE_RANGE_M);
    let known = || of_mode().chain((!at_table).then_some(&table));
    let basis = |turn: &MeasuredTurn| {
        if *turn == table && !at_table { Basis::Table } else { Basis::Measured }
    };
    let below = known().filter(|turn| turn.range_m <= range_m).max_by_key(|turn| turn.range_m);
    let above = known().filter(|turn| turn.range_m >= range_m).min_by_key(|turn| turn.range_m);
    let there_and_back = |from_m: u8| {
        let metres = f64::from(range_m) - f64::from(from_m);
        DurNs::from_secs_f64(2.0 * metres / SOUND_SPEED_MPS * f64::from(pings_a_turn(mode))).0
    };
    match (below, above) {
        (Some(known), _) | (_, Some(known)) if known.range_m == range_m => (known.period, basis(known)),
        (Some(below), Some(above)) => {
            let share = f64::from(range_m - below.range_m) / f64::from(above.range_m - below.range_m);
            let (near_s, far_s) = (below.period.as_secs_f64(), above.period.as_secs_f64());
            (DurNs::from_secs_f64(near_s + share * (far_s - near_s)), Basis::Estimated)
        }
        (Some(known), None) | (None, Some(known)) => {
            (DurNs(known.period.0 + there_and_back(known.range_m)), Basis::Estimated)
        }
        (None, None) => (table.period, Basis::Table),
    }
}

/// Measured turn periods of the vehicle file: `turn_period_s` for the configured mode and range, and the periods of the
/// `measured_turns` tables.
fn measured_turns(mode: Mode, range_m: u8, own: &Section<'_>) -> Result<Vec<MeasuredTurn>, ConfigError> {
    let mut measured = Vec::new();
    let possible = |step_counts: u8, range_m: u8, turn_s: f64| {
        // A turn takes at least the two-way travel time of each of its pings.
        let pings = f64::from(COUNTS_PER_TURN / i32::from(step_counts));
        let least_s = pings * 2.0 * f64::from(range_m) / SOUND_SPEED_MPS;
        if turn_s >= least_s {
            return Ok(());
        }
        Err(format!("is less than the {least_s:.2} s that the sound alone takes at a range of {range_m} m"))
    };
    if let Some(turn_s) = own.number("turn_period_s", TURN_S)? {
        possible(mode.step_counts, range_m, turn_s).map_err(|why| own.invalid("turn_period_s", &why))?;
        let period = DurNs::from_secs_f64(turn_s);
        measured.push(MeasuredTurn { step_counts: mode.step_counts, range_m, period });
    }
    for table in own.sections("measured_turns")? {
        let choices = MODES.map(|mode| (mode.name, mode.step_counts));
        let step_counts = table.required("mode", table.choice("mode", &choices)?)?;
        let range_m = table.required("range_m", table.integer("range_m", 1..=100)?)?;
        let range_m = u8::try_from(range_m).ok().filter(|range| RANGES_M.contains(range));
        let range_m =
            range_m.ok_or_else(|| table.invalid("range_m", "is not a range setting of the head"))?;
        let turn_s = table.required("turn_period_s", table.number("turn_period_s", TURN_S)?)?;
        possible(step_counts, range_m, turn_s).map_err(|why| table.invalid("turn_period_s", &why))?;
        if measured
            .iter()
            .any(|known: &MeasuredTurn| known.step_counts == step_counts && known.range_m == range_m)
        {
            return Err(table.invalid("range_m", "already has a turn period in this mode"));
        }
        measured.push(MeasuredTurn { step_counts, range_m, period: DurNs::from_secs_f64(turn_s) });
        table.finish()?;
    }
    Ok(measured)
}

/// Shortest and longest allowed turn period, seconds.
const TURN_S: core::ops::RangeInclusive<f64> = 0.1..=100.0;

fn command(mode: Mode, own: &Section<'_>) -> Result<Command, ConfigError> {
    let byte = |key, allowed, usual: u8| -> Result<u8, ConfigError> {
        Ok(own.integer(key, allowed)?.and_then(|value| u8::try_from(value).ok()).unwrap_or(usual))
    };
    let range_m = byte("range_m", 1..=100, 10)?;
    let frequency_khz = own.integer("frequency_khz", 600..=1000)?.unwrap_or(1000);
    if frequency_khz % 5 != 0 {
        return Err(own.invalid("frequency_khz", "must be a multiple of 5"));
    }
    // Absorption grows with frequency. Source: the settings usual for profiling heads of the family.
    let usual_absorption = if frequency_khz >= 800 { 0.6 } else { 0.2 };
    let logfs = [10, 20, 30, 40];
    let logf_db = byte("logf_db", 10..=40, 20)?;
    if !logfs.contains(&logf_db) {
        return Err(own.invalid("logf_db", "must be 10, 20, 30 or 40"));
    }
    let returns =
        [("profile", (true, Points::P250)), ("imx", (false, Points::P250)), ("igx", (false, Points::P500))];
    let (profile, points) = own.choice("returns", &returns)?.unwrap_or((true, Points::P250));
    let command = Command {
        // The largest head id is 252, because the byte 253 terminates a command.
        head_id: byte("head_id", 0..=252, 0x10)?,
        range_m,
        reverse: false,
        start_gain_db: f64::from(byte("gain_db", 0..=40, 20)?),
        logf_db: f64::from(logf_db),
        absorption_dbpm: own.number("absorption_dbpm", 0.0..=2.52)?.unwrap_or(usual_absorption),
        train_deg: 0.0,
        sector_deg: 360.0,
        step_deg: crate::codec::step_deg(mode.step_counts),
        pulse_us: own.number("pulse_us", 10.0..=2520.0)?.unwrap_or(usual_pulse_us(range_m)),
        min_range_m: own.number("min_range_m", 0.0..=25.0)?.unwrap_or(0.2),
        points,
        data_bits: 8,
        profile,
        calibrate: false,
        switch_delay_ms: 0.0,
        frequency_khz: frequency_khz as f64,
    };
    // All settings except the range are already checked against their keys' limits.
    command.encode().map_err(|error| own.invalid("range_m", &error.to_string()))?;
    Ok(command)
}

/// Default pulse length for a range setting. Source: the settings usual for profiling heads of the family.
pub(crate) fn usual_pulse_us(range_m: u8) -> f64 {
    const PULSES_US: [u16; RANGES_M.len()] = [20, 20, 20, 20, 60, 60, 100, 160, 220, 260, 320, 420, 540];
    let pulse = RANGES_M.into_iter().zip(PULSES_US).find(|(range, _)| *range == range_m);
    pulse.map_or(60.0, |(_, pulse_us)| f64::from(pulse_us))
}

#[cfg(test)]
pub(crate) mod tests {
    use headrace_sensor::config::Document;
    use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};

    use super::*;

    /// A forward-looking head without latency.
    pub(crate) fn sensor() -> SensorConfig {
        SensorConfig {
            id: "front".to_owned(),
            plugin: "imagenex881".to_owned(),
            connect: String::new(),
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            latency: DurNs::ZERO,
        }
    }

    /// Settings from the text of a vehicle file's table.
    pub(crate) fn settings(text: &str) -> Result<Settings, ConfigError> {
        let root = Document::new("v.toml", text).root()?;
        let settings = Settings::read(&sensor(), &root)?;
        root.finish()?;
        Ok(settings)
    }

    #[test]
    fn ping_periods_are_whole_nanoseconds() {
        let periods = [("slow", 18), ("medium", 18), ("fast", 20), ("faster", 22), ("fastest", 32)];
        for (mode, millis) in periods {
            let settings = settings(&format!("mode = \"{mode}\"")).unwrap();
            assert_eq!(settings.ping_period, DurNs::from_millis(millis), "{mode}");
        }
        let slower = settings("mode = \"fast\"\nturn_period_s = 8.4").unwrap();
        assert_eq!(slower.ping_period, DurNs::from_millis(21));
    }

    #[test]
    fn angles_use_sign_and_offset() {
        let settings = settings("mode = \"slow\"\nangle_sign = \"inverted\"\nangle_offset_deg = 90").unwrap();
        assert!((settings.sensor_rad(750) - math::PI / 4.0).abs() < 1e-12);
        for position in 0..1200u16 {
            assert_eq!(settings.position(settings.sensor_rad(position)), i32::from(position));
        }
        assert_eq!(settings.position(settings.sensor_rad(1200)), 0);
    }

    #[test]
    fn every_key_is_read() {
        let text = "mode = \"fastest\"\nrange_m = 20\nfrequency_khz = 600\nturn_period_s = 6\ngain_db = 12\n\
                    logf_db = 30\nabsorption_dbpm = 0.3\npulse_us = 80\nmin_range_m = 0.5\nreturns = \"igx\"\n\
                    head_id = 0x12\nangle_sign = \"normal\"\nangle_offset_deg = 3";
        let command = settings(text).unwrap().command;
        let expected = Command {
            head_id: 0x12,
            range_m: 20,
            reverse: false,
            start_gain_db: 12.0,
            logf_db: 30.0,
            absorption_dbpm: 0.3,
            train_deg: 0.0,
            sector_deg: 360.0,
            step_deg: 2.4,
            pulse_us: 80.0,
            min_range_m: 0.5,
            points: Points::P500,
            data_bits: 8,
            profile: false,
            calibrate: false,
            switch_delay_ms: 0.0,
            frequency_khz: 600.0,
        };
        assert_eq!(command, expected);
    }

    #[test]
    fn invalid_keys_are_refused_with_their_line() {
        let error = |text: &str| settings(text).unwrap_err().to_string();
        assert_eq!(error("range_m = 10"), "v.toml:1: mode: is missing");
        assert_eq!(
            error("mode = \"FAST\""),
            "v.toml:1: mode = \"FAST\": must be one of slow, medium, fast, faster, fastest; did you mean \"fast\"?"
        );
        assert!(
            error("mode = \"fast\"\nrange_m = 7")
                .starts_with("v.toml:2: range_m = 7: switch command: range of 7")
        );
        assert!(error("mode = \"fast\"\nfrequency_khz = 601").contains("must be a multiple of 5"));
        assert!(error("mode = \"fast\"\nlogf_db = 25").contains("must be 10, 20, 30 or 40"));
        assert!(error("mode = \"fast\"\nspeed = 1").contains("speed: is not a key here"));
    }

    #[test]
    fn latency_as_long_as_the_ping_period_is_refused() {
        let root = Document::new("v.toml", "mode = \"slow\"\nlatency_ms = 18").root().unwrap();
        let late = SensorConfig { latency: DurNs::from_millis(18), ..sensor() };
        let error = Settings::read(&late, &root).unwrap_err().to_string();
        assert!(
            error.starts_with("v.toml:2: latency_ms = 18: must be below the ping period of 18 ms"),
            "{error}"
        );
    }
}
