//! `[navigation]` of a vehicle file: navigation method and noise settings.

use core::ops::RangeInclusive;

use headrace_config::{ConfigError, Section};
use headrace_fusion::Navigation;
use headrace_fusion::direct::DirectNavigation;
use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::filter::settings::Settings;
use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::{CounterSpec, InertialNoise};

/// One degree, radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// Allowed values of noise settings.
///
/// Zero is excluded, because the filter would rely only on the sensor without noise. The mount error may be zero.
const DEGREES: RangeInclusive<f64> = 1e-4..=90.0;
const METRES: RangeInclusive<f64> = 1e-4..=100.0;
const MOUNT_DEGREES: RangeInclusive<f64> = 0.0..=5.0;
const SMALL: RangeInclusive<f64> = 1e-9..=10.0;
const SECONDS: RangeInclusive<f64> = 0.1..=1e9;
/// Allowed lengths of a filter epoch and of the reordering window, s. The filter's buffers suffice for all of them.
///
/// With epochs of 0.5 s, the estimated position of a field dive was wrong by metres. With 0.2 s, the error was no
/// larger than with 0.1 s (trade-off "Navigation" of `headrace cost`).
const EPOCH_S: RangeInclusive<f64> = 0.02..=0.2;
const WINDOW_S: RangeInclusive<f64> = 0.1..=1.0;

/// Navigation method of a vehicle: the `[navigation]` table of its file.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one of it")]
pub enum NavigationConfig {
    /// The navigation filter with its settings.
    Filter(Settings),
    /// Direct navigation, without a filter.
    Direct,
}

impl NavigationConfig {
    /// Reads the `[navigation]` table. The default method is the filter.
    ///
    /// Missing keys get their defaults. But if the inertial unit's `noise` or the cable `counter` is known, the missing
    /// keys that concern it are taken from it.
    ///
    /// Errors: the first key that is unknown or out of range.
    pub fn parse(
        section: Option<Section<'_>>,
        noise: Option<InertialNoise>,
        counter: Option<CounterSpec>,
    ) -> Result<Self, ConfigError> {
        let usual = Settings::default();
        let mut usual = noise.map_or(usual, |noise| usual.with_inertial(&noise));
        usual.tether_sd_m = counter.and_then(|counter| counter.sd_m).unwrap_or(usual.tether_sd_m);
        let Some(section) = section else { return Ok(Self::Filter(usual)) };
        let by_filter = section.choice("way", &[("filter", true), ("direct", false)])?.unwrap_or(true);
        let settings = settings(&section, &usual)?;
        section.finish()?;
        Ok(if by_filter { Self::Filter(settings) } else { Self::Direct })
    }

    /// Returns the settings of the filter. Direct navigation has none, so its settings are the defaults.
    pub fn settings(&self) -> Settings {
        match self {
            Self::Filter(settings) => *settings,
            Self::Direct => Settings::default(),
        }
    }

    /// Creates the navigation with its initial state.
    pub fn begin(&self, profile: &Profile, site: Site) -> Box<dyn Navigation> {
        match self {
            Self::Filter(settings) => Box::new(FilterNavigation::new(profile.clone(), site, *settings)),
            Self::Direct => Box::new(DirectNavigation::new(profile.clone(), site)),
        }
    }
}

/// Reads the noise settings of the `[navigation]` table. Missing keys keep the values of `usual`.
///
/// Errors: the first key whose value is out of range.
fn settings(section: &Section<'_>, usual: &Settings) -> Result<Settings, ConfigError> {
    let mut settings = *usual;
    let keys: [(&'static str, RangeInclusive<f64>, f64, &mut f64); 10] = [
        ("gyro_bias_degps", DEGREES, DEGREE, &mut settings.rate_bias.reach),
        ("gyro_bias_time_s", SECONDS, 1.0, &mut settings.rate_bias.time_s),
        ("accel_bias_mps2", SMALL, 1.0, &mut settings.force_bias.reach),
        ("accel_bias_time_s", SECONDS, 1.0, &mut settings.force_bias.time_s),
        ("slack_sd_m", METRES, 1.0, &mut settings.slack.reach),
        ("slack_time_s", SECONDS, 1.0, &mut settings.slack.time_s),
        ("deviation_deg", DEGREES, DEGREE, &mut settings.heading.reach),
        ("deviation_time_s", SECONDS, 1.0, &mut settings.heading.time_s),
        ("gyro_noise_degps_rthz", SMALL, DEGREE, &mut settings.rate_noise),
        ("accel_noise_mps2_rthz", SMALL, 1.0, &mut settings.force_noise),
    ];
    read(section, keys)?;
    let keys: [(&'static str, RangeInclusive<f64>, f64, &mut f64); 13] = [
        ("tether_sd_m", METRES, 1.0, &mut settings.tether_sd_m),
        ("tether_scale_sd", SMALL, 1.0, &mut settings.scale_sd),
        ("depth_sd_m", METRES, 1.0, &mut settings.depth_sd_m),
        ("depth_offset_sd_m", METRES, 1.0, &mut settings.depth_offset_sd_m),
        ("heading_sd_deg", DEGREES, DEGREE, &mut settings.heading_sd_rad),
        ("tilt_sd_deg", DEGREES, DEGREE, &mut settings.tilt_sd_rad),
        ("attitude_sd_deg", DEGREES, DEGREE, &mut settings.attitude_sd_rad),
        ("echo_sd_m", METRES, 1.0, &mut settings.echo_sd_m),
        ("echo_beam_deg", DEGREES, DEGREE, &mut settings.echo_beam_rad),
        ("return_sd_m", METRES, 1.0, &mut settings.return_sd_m),
        ("return_beam_deg", DEGREES, DEGREE, &mut settings.return_beam_rad),
        ("velocity_sd_mps", SMALL, 1.0, &mut settings.velocity_sd_mps),
        ("mount_sd_deg", MOUNT_DEGREES, DEGREE, &mut settings.mount_sd_rad),
    ];
    read(section, keys)?;
    let keys = [("epoch_s", EPOCH_S, &mut settings.epoch), ("window_s", WINDOW_S, &mut settings.window)];
    for (key, range, slot) in keys {
        if let Some(seconds) = section.number(key, range)? {
            *slot = DurNs::from_secs_f64(seconds);
        }
    }
    Ok(settings)
}

fn read<const N: usize>(
    section: &Section<'_>,
    keys: [(&'static str, RangeInclusive<f64>, f64, &mut f64); N],
) -> Result<(), ConfigError> {
    for (key, range, unit, slot) in keys {
        if let Some(value) = section.number(key, range)? {
            *slot = value * unit;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_config::Document;

    fn parsed(text: &str) -> Result<Settings, String> {
        let root = Document::new("vehicle.toml", text).root().unwrap();
        let section = root.section("navigation").unwrap();
        match NavigationConfig::parse(section, None, None).map_err(|why| why.to_string())? {
            NavigationConfig::Filter(settings) => Ok(settings),
            NavigationConfig::Direct => Err("direct".to_owned()),
        }
    }

    #[test]
    fn filter_epoch_and_window_come_from_the_vehicle_file() {
        assert_eq!(parsed("[navigation]\n").unwrap(), Settings::default());
        assert_eq!(
            parsed("[navigation]\nepoch_s = 0.1\nwindow_s = 0.2\n").unwrap(),
            Settings::default(),
            "the defaults are those of docs/reference/vehicle-file.md"
        );
        let settings = parsed("[navigation]\nepoch_s = 0.02\nwindow_s = 1\n").unwrap();
        assert_eq!((settings.epoch, settings.window), (DurNs::from_millis(20), DurNs::from_millis(1000)));
        for (wrong, range) in [("epoch_s = 0.5", "0.02 to 0.2"), ("window_s = 0.05", "0.1 to 1")] {
            let why = parsed(&format!("[navigation]\n{wrong}\n")).unwrap_err();
            let said = format!("vehicle.toml:2: navigation.{wrong}: must be a number from {range}");
            assert!(why.contains(&said), "{why}");
        }
    }
}
