//! Chainage as engineers write it: 1+240.50 for 1240.5 m.

/// Kilometres, then metres with two decimals.
pub(crate) fn station(chainage_m: f64) -> String {
    let sign = if chainage_m < -0.005 { "-" } else { "" };
    let centimetres = (chainage_m.abs() * 100.0).round();
    let kilometres = (centimetres / 100_000.0).floor();
    let metres = (centimetres - kilometres * 100_000.0) / 100.0;
    format!("{sign}{kilometres:.0}+{metres:06.2}")
}

#[cfg(test)]
mod tests {
    use super::station;

    #[test]
    fn stationing_as_engineers_write_it() {
        for (chainage_m, text) in [
            (0.0, "0+000.00"),
            (1240.5, "1+240.50"),
            (999.996, "1+000.00"),
            (-0.25, "-0+000.25"),
            (7012.0, "7+012.00"),
        ] {
            assert_eq!(station(chainage_m), text);
        }
    }
}
