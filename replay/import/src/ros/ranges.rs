//! Interprets the ranges of ROS messages.

/// Interprets a range by REP 117; `None` without an echo.
///
/// The sender writes infinity if nothing was in range or the target was too near, and NaN if nothing was measured. A
/// range outside the stated limits is invalid, unless the limits themselves are invalid.
pub(super) fn heard(range_m: f64, least_m: f64, most_m: f64) -> Option<f64> {
    let limited = most_m > 0.0 && least_m <= most_m;
    let within = !limited || (least_m..=most_m).contains(&range_m);
    (range_m.is_finite() && range_m > 0.0 && within).then_some(range_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_interpreted_by_rep_117() {
        assert_eq!(heard(2.0, 0.5, 5.0), Some(2.0));
        for none in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 0.4, 5.1, 0.0, -1.0] {
            assert_eq!(heard(none, 0.5, 5.0), None, "{none}");
        }
        assert_eq!(heard(7.0, 0.0, 0.0), Some(7.0), "limits of zero mean no limits");
        assert_eq!(heard(7.0, 0.0, f64::INFINITY), Some(7.0));
        assert_eq!(heard(7.0, f64::NAN, f64::NAN), Some(7.0));
    }
}
