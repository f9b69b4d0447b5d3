//! Finds the effects in a scene's text, removes one, and sets the number of rays.

use crate::error::CostError;

/// Every effect that can be combined with the others, with typical parameters.
///
/// Heads turn all round, so `sector_end_slowing` doesn't apply.
pub(super) const ALL: &str = "[effects]
start_phase_error = { max_deg = 20 }
skipped_steps = { per_thousand = 0.2 }
head_stalls = { per_hour = 20, seconds = [1, 5] }
motion_within_turn = {}
beam_cone = { sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }
occlusion = {}
multipath = { share = 0.1, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }
side_lobes = { share = 0.02, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }
interference = { share = 0.01 }
missing_returns = { share = 0.05, mean_run = 3 }
outliers = { share = 0.02 }
stuck_range = { range_m = 0.55, to_s = 20, sensors = [\"sonar_0\"] }
sound_speed_error = { share = 0.005 }
range_noise = { sd_m = 0.01 }
range_quantisation = { points = 500, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }
current = { speed_mps = -0.02, gust_sd_mps = 0.01 }
pilot_drift = { across_m = 0.5, up_m = 0.3, yaw_deg = 5 }
depth_steps = {}
imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.2 }
imu_bias = { gyro_degps = 0.05 }
magnetic_disturbance = { per_100m = 4 }
tether_slack = {}
tether_slip = { per_100m = 1 }
late_winding = { hold_m = 0.2 }
tether_quantum = {}
device_faults = { kind = \"stick\", from_s = 5, for_s = 5, sensors = [\"ping_left\"] }
clock_drift = { sd_ppm = 20 }
line_delay = { jitter_ms = 2 }
byte_errors = { flipped_per_million = 20 }
";

/// Name of the effect that a line of a scene file defines: a line in `[effects]`, or the header of the effect's own
/// table.
fn effect_of(line: &str, in_effects: bool) -> Option<&str> {
    if line.starts_with('[') {
        return line.trim_matches(['[', ']']).strip_prefix("effects.");
    }
    let (name, _) = line.split_once('=').filter(|_| in_effects)?;
    Some(name.trim())
}

/// Each line of a text with the effect to which it belongs, if any.
fn lines(text: &str) -> impl Iterator<Item = (&str, Option<&str>)> {
    let (mut in_effects, mut table) = (false, None);
    text.lines().map(move |line| {
        if line.starts_with('[') {
            in_effects = line == "[effects]";
            table = effect_of(line, false);
        }
        (line, table.or_else(|| effect_of(line, in_effects)))
    })
}

/// The effects that a scene names, in order, each once.
pub(super) fn named(text: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in lines(text).filter_map(|(_, effect)| effect) {
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// Removes an effect from a scene's text.
///
/// Errors: the scene does not name the effect.
pub(super) fn without(text: &str, effect: &str) -> Result<String, CostError> {
    let kept = lines(text).filter(|(_, of)| *of != Some(effect)).map(|(line, _)| format!("{line}\n"));
    let kept: String = kept.collect();
    if kept.lines().count() == text.lines().count() {
        let why = format!("the scene names no effect {effect:?}");
        return Err(CostError::Figure { what: "a scene without an effect".to_owned(), why });
    }
    Ok(kept)
}

/// Sets the number of rays per beam in a scene's text.
///
/// Errors: the scene does not name `beam_cone` in a line of its own.
pub(super) fn with_rays(text: &str, rays: u32) -> Result<String, CostError> {
    let plain = text.replace("beam_cone = {}", &format!("beam_cone = {{ rays = {rays} }}"));
    let changed = plain.replace("beam_cone = { sensors", &format!("beam_cone = {{ rays = {rays}, sensors"));
    let changed =
        changed.replace("beam_cone = { frequency", &format!("beam_cone = {{ rays = {rays}, frequency"));
    if changed == text {
        let why = "the scene has no line `beam_cone = { ... }` of a known form".to_owned();
        return Err(CostError::Figure { what: "a scene with other rays".to_owned(), why });
    }
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "seed = 1\n[trajectory]\nstart_m = 1\n[effects]\na = {}\nb = { x = 1 }\n[effects.c]\ny = 2\n\
        [[effects.d]]\nz = 1\n\n[[effects.d]]\nz = 2\n";

    #[test]
    fn effects_are_found_in_every_toml_notation() {
        assert_eq!(named(TEXT), ["a", "b", "c", "d"]);
        assert_eq!(named("[trajectory]\na = 1\n"), [""; 0]);
    }

    #[test]
    fn leaving_out_an_effect_removes_only_that_effect() {
        for effect in ["a", "b", "c", "d"] {
            let rest: Vec<String> = named(TEXT).into_iter().filter(|name| name != effect).collect();
            let text = without(TEXT, effect).unwrap();
            assert_eq!(named(&text), rest);
            assert!(text.contains("start_m = 1\n") && text.starts_with("seed = 1\n"), "{text}");
        }
        assert!(!without(TEXT, "d").unwrap().contains("z = "));
        assert!(without(TEXT, "start_m").unwrap_err().to_string().contains("names no effect \"start_m\""));
    }

    #[test]
    fn ray_count_is_set_in_every_notation_of_the_beam_effect() {
        for (beam, with) in [
            ("beam_cone = {}", "beam_cone = { rays = 4 }"),
            ("beam_cone = { sensors = [\"a\"] }", "beam_cone = { rays = 4, sensors = [\"a\"] }"),
            ("beam_cone = { frequency_khz = 9 }", "beam_cone = { rays = 4, frequency_khz = 9 }"),
        ] {
            assert_eq!(with_rays(beam, 4).unwrap(), with);
        }
        assert!(with_rays("occlusion = {}", 4).is_err());
    }
}
