//! Homing of a head to the start of its scan program.

use headrace_sensor::sampling::head::HeadProgram;

use crate::codec::{COUNTS_PER_TURN, Command, step_at_most, step_deg};
use crate::settings::{Settings, usual_pulse_us};

/// Range setting while homing, m: the shortest one. It must differ from the configured setting, so that returns of
/// homing can be distinguished from samples.
const RANGE_M: u8 = 1;

/// Position and stepping direction of a head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Angle in the sensor frame, radians.
    pub angle_rad: f64,
    /// Whether the next step increases the angle in the sensor frame.
    pub growing: bool,
}

/// Commands that move a head the short way to the start of its scan program and leave it stepping in the program's
/// direction.
///
/// A head pings with every command. While homing, the range setting differs from the configured one, so that the
/// returns of these pings don't count as samples. If the stepping direction is wrong at the end, a final command
/// reverses it without a step.
pub fn commands(settings: &Settings, now: Standing, program: &HeadProgram) -> Vec<Command> {
    let normal = settings.angle_sign > 0.0;
    let half = COUNTS_PER_TURN / 2;
    let from = settings.position(now.angle_rad);
    let way = (settings.position(program.start_rad) - from + half).rem_euclid(COUNTS_PER_TURN) - half;
    let (mut growing, wanted) = (now.growing == normal, program.growing == normal);
    let mut commands = Vec::new();
    let mut command = |step_counts: u8, towards: bool| {
        let reverse = growing != towards;
        growing = towards;
        commands.push(Command {
            range_m: RANGE_M,
            pulse_us: usual_pulse_us(RANGE_M),
            reverse,
            step_deg: step_deg(step_counts),
            ..settings.command
        });
    };
    let mut left = way.abs();
    while left > 0 {
        let step = step_at_most(left);
        command(step, way > 0);
        left -= i32::from(step);
    }
    let last = if way == 0 { now.growing == normal } else { way > 0 };
    if last != wanted {
        command(0, wanted);
    }
    commands
}

#[cfg(test)]
mod tests {
    use headrace_sensor::geometry::math::{self, TAU};

    use super::*;
    use crate::settings::tests::settings;
    use crate::stepping::Head;

    /// Checks that an emulated head executes the homing commands, and then the first command of its scan program.
    #[test]
    fn homed_head_continues_with_its_scan_program() {
        for text in ["mode = \"fast\"", "mode = \"slow\"\nangle_sign = \"inverted\"\nangle_offset_deg = 40"] {
            let settings = settings(text).unwrap();
            for (from, start) in [(0.3, 5.0), (5.0, 0.3), (1.0, 1.0), (1.0, 1.0052), (0.0, 3.1), (6.2, 0.01)]
            {
                for (growing, wanted) in [(true, true), (true, false), (false, true), (false, false)] {
                    let program = HeadProgram { start_rad: start, growing: wanted, sector: None };
                    let normal = settings.angle_sign > 0.0;
                    let mut head = Head::new(settings.position(from), growing == normal);
                    let commands = commands(&settings, Standing { angle_rad: from, growing }, &program);
                    assert!(commands.len() <= 80, "{}", commands.len());
                    for command in &commands {
                        command.encode().unwrap();
                        assert_ne!(command.range_m, settings.command.range_m);
                        head.obey(command);
                    }
                    let first = head.obey(&settings.command);
                    let second = head.obey(&settings.command);
                    let (at, then) =
                        (settings.sensor_rad(first.position), settings.sensor_rad(second.position));
                    let miss = math::wrap_signed(at - start, TAU);
                    assert!(miss.abs() <= f64::to_radians(0.151), "{text}: {from} to {start}: {miss}");
                    assert_eq!(math::wrap_signed(then - at, TAU) > 0.0, wanted, "{text}: {from} to {start}");
                }
            }
        }
    }
}
