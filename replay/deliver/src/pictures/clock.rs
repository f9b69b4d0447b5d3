//! Positions on the wall as clock hours.

use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

use super::canvas::{NORMAL, Side};
use super::chart::Chart;
use super::look::AXIS;

/// A position on the perimeter with its clock hour.
#[derive(Debug, Clone, PartialEq)]
pub struct Hour {
    /// Arc length of the position, m.
    pub arc_m: f64,
    /// The clock hour, such as `7:30`.
    pub clock: String,
    /// Name of the place on the wall, such as `crown`; empty between the named places.
    pub place: &'static str,
}

impl Hour {
    /// Returns the clock hour, followed by the name of the place.
    pub fn words(&self) -> String {
        format!("{} {}", self.clock, self.place).trim_end().to_owned()
    }
}

/// Returns a position for every hour and a half, once around the perimeter from floor to floor.
///
/// The clock is centred on the profile's reference point and read while looking along the tunnel.
pub fn hours(profile: &Profile) -> Vec<Hour> {
    const NAMES: [(&str, &str); 9] = [
        ("6:00", "floor"),
        ("7:30", ""),
        ("9:00", "left"),
        ("10:30", ""),
        ("12:00", "crown"),
        ("1:30", ""),
        ("3:00", "right"),
        ("4:30", ""),
        ("6:00", "floor"),
    ];
    let [y_m, z_m] = profile.reference();
    let hour = |(k, (clock, place)): (u32, (&str, &'static str))| {
        let (sine, cosine) = math::sin_cos(math::TAU * f64::from(k) / 8.0);
        let arc_m = match k {
            // The first and last positions are both at the seam, where arc length begins again. They are set exactly,
            // because rounding could put either of them at the wrong end of the perimeter.
            0 => 0.0,
            8 => profile.perimeter_m(),
            _ => profile.arc_of([y_m + sine, z_m - cosine]),
        };
        Hour { arc_m, clock: clock.to_owned(), place }
    };
    (0..).zip(NAMES).map(hour).collect()
}

/// Draws clock hours to the right of a chart that has arc length on its y axis.
pub fn at_right(chart: &Chart<'_>, profile: &Profile) {
    for hour in hours(profile) {
        let y = chart.px([0.0, hour.arc_m])[1];
        let x = chart.frame.right;
        chart.canvas.line(&[[x, y], [x + 4.0, y]], &AXIS);
        chart.canvas.text([x + 7.0, y], &hour.words(), Side::Right, NORMAL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;

    #[test]
    fn clock_hours_match_those_of_the_profile() {
        for profile in
            [shapes::ceran().unwrap(), shapes::rectangle(3.0, 4.0).unwrap(), shapes::circle(0.5).unwrap()]
        {
            let hours = hours(&profile);
            assert!(hours.windows(2).all(|pair| pair[0].arc_m < pair[1].arc_m), "{hours:?}");
            assert!(hours.iter().all(|hour| profile.clock(hour.arc_m) == hour.clock), "{hours:?}");
        }
    }
}
