//! Motion of a head about its axis: the angle that it has swept, and the time that a whole turn still takes.

use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::MonoNs;

/// Largest share of a head's steps that may go against its sense of rotation if the head turns all the way round. Pings
/// out of order cause a few such steps. A head that sweeps a sector makes as many steps one way as the other.
const MOST_BACK: f64 = 0.1;

/// Angle swept by a head, from the angles of its pings in order of time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Sweep {
    /// Time and angle of the first and the latest ping. Angles are unwrapped, radians.
    ends: Option<[(MonoNs, f64); 2]>,
    /// Smallest and largest unwrapped angle, radians.
    span_rad: [f64; 2],
    /// Sum of the head's steps to larger angles, and sum of its steps to smaller angles, radians, both positive.
    ways_rad: [f64; 2],
    /// Number of steps between pings.
    steps: u32,
}

impl Sweep {
    /// Adds a ping at this angle in the frame of the head.
    pub(crate) fn add(&mut self, angle_rad: f64, at: MonoNs) {
        let Some([first, (_, latest_rad)]) = self.ends else {
            self.ends = Some([(at, angle_rad); 2]);
            self.span_rad = [angle_rad; 2];
            return;
        };
        let step_rad = math::wrap_signed(angle_rad - latest_rad, TAU);
        let angle_rad = latest_rad + step_rad;
        let [least_rad, most_rad] = self.span_rad;
        let [ahead_rad, back_rad] = self.ways_rad;
        self.ends = Some([first, (at, angle_rad)]);
        self.span_rad = [least_rad.min(angle_rad), most_rad.max(angle_rad)];
        self.ways_rad = [ahead_rad + step_rad.max(0.0), back_rad + (-step_rad).max(0.0)];
        self.steps += 1;
    }

    /// Difference between the smallest and the largest angle of a ping, radians.
    pub(crate) fn swept_rad(&self) -> f64 {
        let [least_rad, most_rad] = self.span_rad;
        most_rad - least_rad
    }

    /// Whether the head has pinged in all directions.
    ///
    /// The last ping of a turn is one step before the angle of the first ping. Half a step is added because angles are
    /// rounded.
    pub(crate) fn is_whole(&self) -> bool {
        self.swept_rad() + 1.5 * self.step_rad() >= TAU
    }

    /// Mean step between pings, radians.
    fn step_rad(&self) -> f64 {
        let [ahead_rad, back_rad] = self.ways_rad;
        (ahead_rad + back_rad) / f64::from(self.steps.max(1))
    }

    /// Time that the rest of a whole turn takes at the head's rate, s. `None` if the head sweeps a sector to and fro,
    /// or doesn't turn.
    pub(crate) fn missing_s(&self) -> Option<f64> {
        let [(from, _), (to, _)] = self.ends?;
        let [ahead_rad, back_rad] = self.ways_rad;
        let swept_rad = self.swept_rad();
        if ahead_rad.min(back_rad) > MOST_BACK * ahead_rad.max(back_rad) {
            return None;
        }
        let rate_radps = swept_rad / to.since(from).as_secs_f64();
        let missing_s = (TAU - swept_rad - self.step_rad()).max(0.0) / rate_radps;
        missing_s.is_finite().then_some(missing_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::time::DurNs;

    /// Sweep through these angles, degrees, with one ping each 0.1 s.
    fn sweep(angles_deg: impl IntoIterator<Item = f64>) -> Sweep {
        let mut sweep = Sweep::default();
        for (k, angle_deg) in angles_deg.into_iter().enumerate() {
            let angle_rad = math::wrap(angle_deg.to_radians(), TAU);
            sweep.add(angle_rad, MonoNs(5) + DurNs::from_millis(100 * k as i64));
        }
        sweep
    }

    /// Angles of pings every 2.4 degrees, as from an Imagenex 881 in its fastest mode.
    fn turn(pings: u32, sign: f64) -> impl Iterator<Item = f64> {
        (0..pings).map(move |k| 100.0 + sign * 2.4 * f64::from(k))
    }

    #[test]
    fn turn_is_complete_after_its_last_ping_in_either_direction() {
        for sign in [1.0, -1.0] {
            assert!(sweep(turn(150, sign)).is_whole());
            assert!(sweep(turn(400, sign)).is_whole());
            assert!(!sweep(turn(148, sign)).is_whole());
        }
        assert!(!sweep([]).is_whole());
    }

    #[test]
    fn turn_with_lost_pings_is_complete() {
        let some = turn(150, 1.0).enumerate().filter(|(k, _)| k % 7 != 3).map(|(_, angle_deg)| angle_deg);
        assert!(sweep(some).is_whole());
    }

    #[test]
    fn time_to_complete_a_turn_is_computed_from_the_rate() {
        // The 75 pings take 7.4 s at 24 degrees/s, so about half of the turn is missing.
        let missing_s = sweep(turn(75, -1.0)).missing_s().unwrap();
        assert!((missing_s - 7.5).abs() < 1e-6, "{missing_s}");
    }

    #[test]
    fn head_that_sweeps_a_sector_or_does_not_turn_never_completes_a_turn() {
        let to_and_fro = sweep(turn(80, 1.0).chain(turn(80, 1.0).collect::<Vec<_>>().into_iter().rev()));
        assert_eq!((to_and_fro.is_whole(), to_and_fro.missing_s()), (false, None));
        let stuck = sweep([30.0; 50]);
        assert_eq!((stuck.is_whole(), stuck.missing_s()), (false, None));
        assert_eq!(Sweep::default().missing_s(), None);
    }
}
