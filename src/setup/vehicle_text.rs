//! Text of the vehicle file that `headrace setup` writes.

use headrace_config::plain::one_line;
use headrace_fusion::filter::settings::Settings;
use headrace_geometry::site::Site;
use headrace_vehicle::TunnelConfig;

use super::devices::FoundDevice;
use crate::output::append;
use crate::tunnel_option;

/// Range setting of a head relative to the distance from the tunnel's middle to its farthest wall. It leaves room for a
/// vehicle that is off the middle.
const RANGE_MARGIN: f64 = 1.5;
/// Longest range setting that is tried, m.
const LONGEST_RANGE_M: f64 = 100.0;
/// Column in which the comments of the vehicle file begin.
const COMMENTS: usize = 34;

/// Answers that the vehicle file needs besides the devices.
pub(super) struct Answers {
    /// The tunnel as in `--tunnel`, and parsed.
    pub(super) tunnel: (String, TunnelConfig),
    pub(super) length_m: f64,
    pub(super) target_m: f64,
    /// Position, m, and roll, pitch and yaw, degrees, of each device; `None` at the vehicle's origin, looking ahead.
    pub(super) mounts: Vec<Option<[[f64; 3]; 2]>>,
}

/// Text of the vehicle file. `mode` is the heads' mode, and `planned_mps` the planned speed.
pub(super) fn text(
    answers: &Answers,
    devices: &[FoundDevice],
    mode: &str,
    planned_mps: Option<f64>,
) -> String {
    let mut text =
        "# Written by headrace setup; edit it. docs/reference/vehicle-file.md lists all keys.\n".to_owned();
    let mut line = |key: &str, comment: &str| {
        if comment.is_empty() {
            append(&mut text, format_args!("{key}\n"));
        } else {
            append(&mut text, format_args!("{key:<COMMENTS$} # {comment}\n"));
        }
    };
    let site = Site::default();
    line("name = \"vehicle\"", "shown on screens and in reports");
    line(&format!("target_m = {}", answers.target_m), "largest hole that passes, m");
    line("\n[tunnel]", "");
    let keys = tunnel_option::table(&answers.tunnel.0);
    keys.lines().filter(|key| !key.starts_with(tunnel_option::LENGTH)).for_each(|key| line(key, ""));
    line(&format!("length_m = {}", answers.length_m), "from the portal");
    line("\n[water]", "");
    line(&format!("sound_speed_mps = {}", site.sound_speed_mps), "fresh water at 10 degrees");
    let level = format!("surface_above_floor_m = {}", site.surface_above_floor_m);
    line(&level, "water level above the floor at the portal: set it before each dive");
    if devices.iter().any(|device| device.plugin == "tether_hid") {
        let slack = Settings::default().slack;
        line("\n[navigation]", "");
        line(&format!("slack_sd_m = {}", slack.reach), "slack of the cable (sd): less for a taut cable");
        line(&format!("slack_time_s = {}", slack.time_s), "a sixth of the period of the cable's swing");
    }
    if let Some(planned_mps) = planned_mps {
        line("\n[heads]", "");
        line(&format!("planned_speed_mps = {planned_mps}"), "largest speed for the target, less a margin");
    }
    for (device, mount) in devices.iter().zip(&answers.mounts) {
        line("\n[[sensors]]", "");
        line(&format!("id = {:?}", device.id), one_line(&device.identity).as_ref());
        line(&format!("plugin = {:?}", device.plugin), "");
        line(&format!("connect = {:?}", device.connect.to_string()), "");
        let [position, angles] = mount.unwrap_or_default();
        line(&format!("position_m = {position:?}"), "forward, left, up from the vehicle's origin");
        let lacks_angles = mount.is_none() && has_direction(device);
        let note = if lacks_angles { ": NOT GIVEN, write its direction" } else { "" };
        line(&format!("angles_deg = {angles:?}"), &format!("roll, pitch, yaw{note}"));
        device.keys.lines().for_each(|key| line(key, ""));
        if is_head(device) {
            let [mode_key, range_key] = head_keys(device, &answers.tunnel.1, mode);
            if let Some(key) = mode_key {
                line(&key, mode_comment(devices));
            }
            let farthest_m = farthest_m(&answers.tunnel.1);
            let comment = format!("the wall is up to {farthest_m:.1} m from the middle of the tunnel");
            if let Some(key) = range_key {
                line(&key, &comment);
            }
        }
    }
    text
}

/// Whether a device is a profiling head.
pub(super) fn is_head(device: &FoundDevice) -> bool {
    device.plugin == "imagenex881"
}

/// Whether readings of a device are useless if its direction is wrong, although it is no sonar.
pub(super) fn has_direction(device: &FoundDevice) -> bool {
    ["imu_can", "a50"].contains(&device.plugin)
}

/// Reason for the mode of a head that has no given mode.
fn mode_comment(devices: &[FoundDevice]) -> &'static str {
    let is_given = devices.iter().any(|device| is_head(device) && device.has("mode"));
    if is_given { "the same as other heads" } else { "the mode with the largest speed for the target" }
}

/// Keys of a head for mode and range setting, unless the user has given them.
fn head_keys(device: &FoundDevice, tunnel: &TunnelConfig, mode: &str) -> [Option<String>; 2] {
    let mode = (!device.has("mode")).then(|| format!("mode = {mode:?}"));
    let mut range_m = (farthest_m(tunnel) * RANGE_MARGIN).ceil();
    let is_allowed = |range_m: f64| {
        let mode = mode.as_deref().unwrap_or_default();
        device.configured(&format!("{mode}\nrange_m = {range_m}\n")).is_ok()
    };
    while range_m < LONGEST_RANGE_M && !is_allowed(range_m) {
        range_m += 1.0;
    }
    [mode.clone(), (!device.has("range_m")).then(|| format!("range_m = {range_m}"))]
}

/// Distance from the middle of the tunnel to its farthest wall, m.
fn farthest_m(tunnel: &TunnelConfig) -> f64 {
    tunnel.profile.farthest_m(tunnel.profile.reference())
}
