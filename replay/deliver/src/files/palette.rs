//! Colours of deviations: blue inwards, white on the design, orange outwards, grey where the wall was not measured.

/// Blue and vermilion of Okabe and Ito, which most colour-blind people can distinguish.
const INWARDS: [f64; 3] = [0.0, 114.0, 178.0];
const OUTWARDS: [f64; 3] = [213.0, 94.0, 0.0];
const WHITE: f64 = 247.0;
/// Colour of wall that was not measured.
pub const NOT_MEASURED: [u8; 3] = [128, 128, 128];

/// Index of the colour of a deviation: 0 where there is no deviation, else 1 (`limit_m` or more inwards) to 255
/// (outwards).
#[expect(clippy::cast_possible_truncation, reason = "it is within 1 and 255")]
pub fn index(deviation_m: Option<f64>, limit_m: f64) -> u8 {
    deviation_m.map_or(0, |deviation| (128.0 + 127.0 * (deviation / limit_m).clamp(-1.0, 1.0)).round() as u8)
}

/// Colour at an index.
#[expect(clippy::cast_possible_truncation, reason = "it is within 0 and 255")]
pub fn colour(index: u8) -> [u8; 3] {
    if index == 0 {
        return NOT_MEASURED;
    }
    let share = (f64::from(index) - 128.0) / 127.0;
    let end = if share < 0.0 { INWARDS } else { OUTWARDS };
    end.map(|channel| (WHITE + (channel - WHITE) * share.abs()).round() as u8)
}
