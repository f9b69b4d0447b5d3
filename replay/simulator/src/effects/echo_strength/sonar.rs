//! The sonar equation of a profiling head in a tunnel.

use headrace_geometry::math;

/// Range at which the mean echo of rough rock, perpendicular to the beam, is just detected, m.
///
/// The range is the head's largest range setting for profiling. It applies to the frequency, absorption and pulse in
/// the constants below. Frequency, absorption and pulse are those that DUNE uses at that setting. No source states the
/// head's source level, noise or threshold.
///
/// Source: the 881L's data sheet and switch command (range settings to 100 m; 675 kHz and 0.2 dB/m above 5 m; 540 us at
/// 100 m).
const HEARD_M: f64 = 100.0;
const HEARD_AT_KHZ: f64 = 675.0;
const HEARD_DBPM: f64 = 0.2;
const HEARD_PULSE_S: f64 = 540e-6;
/// Level of the echo of rough rock at 1 m, in dB above the threshold, at a gain of 20 dB.
///
/// This is an assumption, since the maker states no threshold. With the usual gains, a wall's echo is then above the
/// threshold if the absorption setting matches the water's absorption.
const ABOVE_THRESHOLD_DB: f64 = 20.0;
const USUAL_GAIN_DB: f64 = 20.0;
/// Density of silt (quartz) divided by the density of water.
const GRAIN_DENSITY: f64 = 2.65;
/// Kinematic viscosity of water at 10 degrees, m^2/s.
const VISCOSITY_M2PS: f64 = 1.307e-6;
/// Number of decibels per neper.
const DB_PER_NEPER: f64 = 8.685_889_638_065_037;

/// Acoustic properties of a head, its water and its wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sonar {
    /// Full width of the head's beam, radians.
    pub(crate) beam_rad: f64,
    /// Length of the head's sound pulse, s.
    pub(crate) pulse_s: f64,
    /// Speed of sound in the water, m/s.
    pub(crate) sound_mps: f64,
    /// Absorption of sound by water and silt, one way, dB/m.
    pub(crate) absorbed_dbpm: f64,
    /// Backscatter of the wall relative to rough rock, dB.
    pub(crate) wall_db: f64,
    /// Gain at 1 m, dB. `log_gain_db` is the gain that each factor of ten in range adds, dB. `made_up_dbpm` is the
    /// one-way absorption that the gain compensates, dB/m.
    pub(crate) gain_db: f64,
    pub(crate) log_gain_db: f64,
    pub(crate) made_up_dbpm: f64,
}

/// Silt in the water.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Silt {
    /// Mass of silt grains in the water, grams per litre.
    pub(crate) gpl: f64,
    /// Radius of the silt grains, m.
    pub(crate) grain_m: f64,
}

impl Sonar {
    /// Probability that a head detects the echo of a wall at `range_m`. `square` is the cosine of the beam's angle of
    /// incidence.
    pub(crate) fn detected(&self, range_m: f64, square: f64) -> f64 {
        let echo_db = self.echo_db(range_m.max(0.01), square);
        let noise_db = 10.0 * log10(HEARD_PULSE_S / self.pulse_s);
        let over_noise_db = echo_db - noise_db - heard_db();
        let near = Self { absorbed_dbpm: 0.0, wall_db: 0.0, ..*self };
        let amplified_db = self.gain_db - USUAL_GAIN_DB
            + self.log_gain_db * log10(range_m.max(0.01))
            + 2.0 * self.made_up_dbpm * range_m;
        let over_threshold_db = echo_db - near.echo_db(1.0, 1.0) + amplified_db + ABOVE_THRESHOLD_DB;
        let mean = math::exp(over_noise_db.min(over_threshold_db) * core::f64::consts::LN_10 / 10.0);
        math::exp(-1.0 / mean)
    }

    /// Mean power of an echo, dB relative to a square metre of rough rock that faces the beam at 1 m.
    fn echo_db(&self, range_m: f64, square: f64) -> f64 {
        // Lambert's law: both the incident and the returned sound are proportional to the cosine.
        let scattered_db = self.wall_db + 20.0 * log10(square.max(1e-6));
        10.0 * log10(self.insonified_m2(range_m, square))
            - 40.0 * log10(range_m)
            - 2.0 * self.absorbed_dbpm * range_m
            + scattered_db
    }

    /// Area of wall whose echo arrives at one time, m^2. This is the whole footprint of the beam, or a strip if the
    /// footprint is longer than the pulse.
    fn insonified_m2(&self, range_m: f64, square: f64) -> f64 {
        let wide_m = self.beam_rad * range_m;
        let within_beam_m2 = core::f64::consts::FRAC_PI_4 * wide_m * wide_m / square.max(1e-6);
        let sine = math::sqrt((1.0 - square * square).max(0.0));
        let within_pulse_m2 = wide_m * self.sound_mps * self.pulse_s / 2.0 / sine.max(1e-9);
        within_beam_m2.min(within_pulse_m2)
    }
}

/// Power of the echo that is just detected at the range [`HEARD_M`], dB relative to the same reference as in
/// [`Sonar::echo_db`].
fn heard_db() -> f64 {
    let wide_m = f64::to_radians(2.4 - (HEARD_AT_KHZ - 600.0) / 400.0) * HEARD_M;
    10.0 * log10(core::f64::consts::FRAC_PI_4 * wide_m * wide_m)
        - 40.0 * log10(HEARD_M)
        - 2.0 * HEARD_DBPM * HEARD_M
}

/// Frequency of a head whose beam has the full width `beam_rad`, kHz. The width is 2.4 degrees at 600 kHz and 1.4 at 1
/// MHz.
///
/// Source: the 881L's data sheet, beam widths.
pub(crate) fn frequency_of_khz(beam_rad: f64) -> f64 {
    (600.0 + (2.4 - beam_rad.to_degrees()) * 400.0).clamp(600.0, 1000.0)
}

/// Usual setting of the absorption that the head compensates, dB/m: one value for 1 MHz, one for 675 kHz.
///
/// Source: the switch command as DUNE's driver sets it. The function switches between the two values halfway between
/// the frequencies.
pub(super) fn usual_absorption_dbpm(frequency_khz: f64) -> f64 {
    if frequency_khz > 837.0 { 0.6 } else { 0.2 }
}

/// Length of the pulse at a range setting, microseconds.
///
/// Source: the switch command, field 14.
pub(crate) fn pulse_of_us(range_m: f64) -> f64 {
    const UP_TO: [(f64, f64); 8] = [
        (4.0, 20.0),
        (10.0, 60.0),
        (20.0, 100.0),
        (30.0, 160.0),
        (40.0, 220.0),
        (50.0, 260.0),
        (60.0, 320.0),
        (80.0, 420.0),
    ];
    UP_TO.iter().find(|(up_to_m, _)| range_m <= *up_to_m).map_or(540.0, |(_, us)| *us)
}

/// Absorption of sound by fresh water, one way, dB/m.
///
/// Source: Francois and Garrison 1982, J. Acoust. Soc. Am. 72, 1879, the term for pure water.
pub(crate) fn water_absorption_dbpm(frequency_khz: f64, t_degc: f64) -> f64 {
    let db_per_km_khz2 = if t_degc <= 20.0 {
        4.937e-4 + t_degc * (-2.59e-5 + t_degc * (9.11e-7 + t_degc * -1.50e-8))
    } else {
        3.964e-4 + t_degc * (-1.146e-5 + t_degc * (1.45e-7 + t_degc * -6.5e-10))
    };
    db_per_km_khz2 * frequency_khz * frequency_khz / 1000.0
}

impl Silt {
    /// Absorption of sound by the grains, one way, dB/m. The causes are scattering, and friction of the water around
    /// the grains.
    ///
    /// Source: Urick 1948, J. Acoust. Soc. Am. 20, 283.
    pub(crate) fn absorption_dbpm(&self, frequency_khz: f64, sound_mps: f64) -> f64 {
        let volume = self.gpl / (1000.0 * GRAIN_DENSITY);
        let omega = math::TAU * frequency_khz * 1000.0;
        let k = omega / sound_mps;
        let ba = self.grain_m * math::sqrt(omega / (2.0 * VISCOSITY_M2PS));
        let s = 9.0 / (4.0 * ba) * (1.0 + 1.0 / ba);
        let tau = 0.5 + 9.0 / (4.0 * ba);
        let denser = GRAIN_DENSITY - 1.0;
        let friction = k * denser * denser * s / (s * s + (GRAIN_DENSITY + tau) * (GRAIN_DENSITY + tau));
        let scattering = k * k * k * k * self.grain_m * self.grain_m * self.grain_m / 3.0;
        // Both terms are absorption of power. Nepers refer to amplitude, so the sum is halved.
        volume * (friction + scattering) / 2.0 * DB_PER_NEPER
    }
}

fn log10(x: f64) -> f64 {
    math::ln(x) / core::f64::consts::LN_10
}
