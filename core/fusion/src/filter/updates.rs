//! Scalar measurement updates of the filter from one sensor reading.

use super::context::Context;
use super::measure::{self, Beam, ScalarUpdate, with_quantum};
use super::sources::{Source, TETHER_PERIOD};
use super::state::State;
use super::window::{Waiting, Window};
use headrace_geometry::frames::{Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::{Level, Reading};

/// Returns the scalar measurement updates of a reading; none if the estimate cannot predict the reading.
pub(super) fn rows(
    state: &State,
    context: &Context,
    source: &Source,
    waiting: &Waiting,
    window: &Window,
) -> [Option<ScalarUpdate>; 3] {
    let Context { profile, site, settings, unit_at } = context;
    let mount = source.sensor.mount;
    let offset = mount.position + -*unit_at;
    let beam = |along: Vec3<Sensor>, first_rad: f64, unsure_rad: f64| {
        let along = mount.rotation * along;
        Beam { offset, along, first_rad, unsure_rad }
    };
    let one = |row: Option<ScalarUpdate>| [row, None, None];
    match (source.sensor.kind, waiting.reading) {
        (SensorKind::Echosounder { .. }, Reading::Echo(echo)) => one(echo.range_m.and_then(|range_m| {
            let range_m = site.rescaled_range_m(range_m, echo.sound_speed_mps);
            let beam = beam(Vec3::new(1.0, 0.0, 0.0), 0.0, settings.echo_beam_rad / 2.0);
            measure::range(state, profile, &beam, range_m, settings.echo_sd_m)
        })),
        (SensorKind::Head, Reading::Sonar(sonar)) => one(sonar.range_m.and_then(|range_m| {
            let range_m = site.rescaled_range_m(range_m, sonar.sound_speed_mps);
            let beam = beam(head_direction(sonar.angle_rad), settings.return_beam_rad / 2.0, 0.0);
            let sd_m = with_quantum(settings.return_sd_m, sonar.resolution_m);
            measure::range(state, profile, &beam, range_m, sd_m)
        })),
        (SensorKind::Depth, Reading::Pressure(water)) => {
            let height_m = site.surface_above_floor_m - site.depth_m(water.pressure_pa);
            let quantum_m = site.depth_m(site.surface_pressure_pa + water.resolution_pa);
            let sd_m = with_quantum(settings.depth_sd_m, quantum_m);
            one(Some(measure::height(state, offset, height_m, sd_m)))
        }
        (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) => {
            let step_m = source.count_step.step_m(length.resolution_m) * scale.abs();
            let way_m = state.velocity_mps.x() * TETHER_PERIOD.as_secs_f64();
            let looks = source.count_step.looks_at_an_error(waiting.at, TETHER_PERIOD, way_m, step_m);
            let sd_m = with_quantum(settings.tether_sd_m, step_m * math::sqrt(looks));
            let chainage_m = zero_at_m + scale * length.length_m;
            one(Some(measure::chainage(state, -*unit_at, chainage_m, sd_m)))
        }
        (SensorKind::Imu, Reading::Attitude(level)) => {
            let measured = in_tunnel(site, level) * mount.rotation.inverse();
            let (felt, _) = window.felt(waiting.at, waiting.at + DurNs(1));
            let seeing = felt.rate_radps.is_some() && felt.force_mps2.is_some();
            let tilt_sd = if seeing { settings.tilt_sd_rad } else { settings.attitude_sd_rad };
            measure::attitude(state, measured, tilt_sd, settings.heading_sd_rad).map(Some)
        }
        (SensorKind::VelocityLog, Reading::VelocityOverGround(moved)) => {
            let (felt, _) = window.felt(waiting.at, waiting.at + DurNs(1));
            let rate = felt.rate_radps.map_or_else(Vec3::zero, |rate| rate + -state.rate_bias_radps);
            let sensor = (offset, mount.rotation);
            measure::velocity(state, sensor, rate, moved, settings.velocity_sd_mps).map(Some)
        }
        _ => [None; 3],
    }
}

/// Rotates an inertial unit's attitude from the unit's level frame to the tunnel frame.
pub fn in_tunnel(site: &Site, level: Rot<Level, Sensor>) -> Rot<Tunnel, Sensor> {
    Rot::<Tunnel, Level>::from_roll_pitch_yaw(0.0, 0.0, -site.axis_yaw_rad) * level
}
