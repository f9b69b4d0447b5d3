//! Speed of sound during the dive, from the temperature of a depth sensor. Sonar readings are corrected for this speed.

use bevy_ecs::prelude::Resource;

use headrace_geometry::site::fresh_water_sound_speed_mps;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::{Decoded, Reading, SourceId};

/// Plausible water temperatures, degrees Celsius. Outside this range the sensor is faulty or not in the
/// water.
const WATER_DEGC: core::ops::RangeInclusive<f64> = 0.0..=40.0;
/// Plausible absolute pressures, Pa: from half an atmosphere to water 2 km deep. Outside this range the sensor is faulty.
const WATER_PA: core::ops::RangeInclusive<f64> = 5.0e4..=2.0e7;
/// Time constant of the low-pass filter of the speed of sound, s. Faster changes are sensor noise.
const SLOWNESS_S: f64 = 60.0;

/// The current speed of sound, measured or assumed.
#[derive(Debug, Clone, Resource)]
pub(crate) struct SoundSpeed {
    /// Depth sensor that supplies the speed of sound; `None` if the site's speed applies.
    source: Option<SourceId>,
    site_mps: f64,
    now_mps: f64,
    heard: Option<MonoNs>,
    /// Minimum and maximum speed of sound used so far, m/s.
    span_mps: [f64; 2],
}

stateful!(SoundSpeed { state: now_mps, heard, span_mps; fixed: source, site_mps; });

impl SoundSpeed {
    /// Creates the state with the site's speed of sound, which applies until `source` supplies another.
    pub(crate) fn new(site_mps: f64, source: Option<SourceId>) -> Self {
        Self { source, site_mps, now_mps: site_mps, heard: None, span_mps: [site_mps; 2] }
    }

    /// Minimum and maximum speed of sound used for ranges, m/s.
    pub(crate) fn span_mps(&self) -> [f64; 2] {
        self.span_mps
    }

    /// Updates the speed of sound from a depth sensor, and corrects sonar readings.
    ///
    /// Later stages rescale each range to the site's speed of sound. The speed stated by the device is therefore
    /// multiplied by the ratio of the site's speed to the current speed.
    pub(super) fn pass(&mut self, source: SourceId, decoded: &mut Decoded) {
        match &mut decoded.reading {
            Reading::Pressure(water)
                if self.source == Some(source)
                    && WATER_DEGC.contains(&water.temperature_degc)
                    && WATER_PA.contains(&water.pressure_pa) =>
            {
                let measured_mps = fresh_water_sound_speed_mps(water.temperature_degc, water.pressure_pa);
                self.hear(decoded.valid_at, measured_mps);
            }
            Reading::Sonar(sonar) => sonar.sound_speed_mps = self.corrected(sonar.sound_speed_mps),
            Reading::Echo(echo) => echo.sound_speed_mps = self.corrected(echo.sound_speed_mps),
            _ => (),
        }
    }

    fn hear(&mut self, at: MonoNs, measured_mps: f64) {
        match self.heard {
            None => {
                self.now_mps = measured_mps;
                self.span_mps = [measured_mps; 2];
            }
            Some(last) => {
                let elapsed_s = at.since(last).as_secs_f64().max(0.0);
                self.now_mps += (measured_mps - self.now_mps) * (elapsed_s / (elapsed_s + SLOWNESS_S));
            }
        }
        self.heard = Some(self.heard.map_or(at, |last| last.max(at)));
        let [least, most] = self.span_mps;
        self.span_mps = [least.min(self.now_mps), most.max(self.now_mps)];
    }

    fn corrected(&self, device_mps: f64) -> f64 {
        // Without a measured speed of sound the reading is unchanged, bit for bit.
        if self.heard.is_none() { device_mps } else { device_mps * (self.site_mps / self.now_mps) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::site::Site;
    use headrace_geometry::time::DurNs;
    use headrace_sensor::reading::{EchoRange, WaterPressure};

    const DEPTH: SourceId = SourceId(3);

    fn depth(at_s: f64, temperature_degc: f64) -> Decoded {
        water(at_s, temperature_degc, 101_325.0)
    }

    fn water(at_s: f64, temperature_degc: f64, pressure_pa: f64) -> Decoded {
        let water = WaterPressure { pressure_pa, resolution_pa: 300.0, temperature_degc };
        Decoded { valid_at: MonoNs(0) + DurNs::from_secs_f64(at_s), reading: Reading::Pressure(water) }
    }

    /// Corrected range, m, of a device that assumes 1500 m/s and reports 4 m.
    fn metres(sound: &mut SoundSpeed, site: &Site) -> f64 {
        let echo = EchoRange { range_m: Some(4.0), confidence: 1.0, sound_speed_mps: 1500.0 };
        let mut decoded = Decoded { valid_at: MonoNs(0), reading: Reading::Echo(echo) };
        sound.pass(SourceId(0), &mut decoded);
        let Reading::Echo(echo) = decoded.reading else { panic!("{decoded:?}") };
        site.rescaled_range_m(4.0, echo.sound_speed_mps)
    }

    #[test]
    fn ranges_are_corrected_to_the_measured_speed_of_sound() {
        let site = Site::default();
        let mut sound = SoundSpeed::new(site.sound_speed_mps, Some(DEPTH));
        assert!((metres(&mut sound, &site) - 4.0 * 1447.0 / 1500.0).abs() < 1e-12);
        // Other sensors and implausible temperatures and pressures are ignored.
        sound.pass(SourceId(2), &mut depth(1.0, 20.0));
        sound.pass(DEPTH, &mut depth(1.0, 85.0));
        for pressure_pa in [0.0, 1.0e9, f64::NAN, f64::INFINITY] {
            sound.pass(DEPTH, &mut water(1.0, 20.0, pressure_pa));
        }
        assert!((metres(&mut sound, &site) - 4.0 * 1447.0 / 1500.0).abs() < 1e-12);
        sound.pass(DEPTH, &mut depth(1.0, 20.0));
        assert!((metres(&mut sound, &site) - 4.0 * 1482.34 / 1500.0).abs() < 1e-3);
        assert!((sound.span_mps()[0] - 1482.34).abs() < 0.1);
    }

    #[test]
    fn temperature_noise_is_smoothed_and_a_lasting_change_is_followed() {
        let site = Site::default();
        let mut sound = SoundSpeed::new(site.sound_speed_mps, Some(DEPTH));
        for tick in 0..20_000 {
            let noise = if tick % 2 == 0 { 0.5 } else { -0.5 };
            sound.pass(DEPTH, &mut depth(f64::from(tick) * 0.05, 10.0 + noise));
        }
        assert!((sound.now_mps - 1447.3).abs() < 0.1, "{}", sound.now_mps);
        for tick in 0..12_000 {
            sound.pass(DEPTH, &mut depth(1000.0 + f64::from(tick) * 0.05, 5.0));
        }
        assert!((sound.now_mps - 1426.16).abs() < 0.1, "{}", sound.now_mps);
    }
}
