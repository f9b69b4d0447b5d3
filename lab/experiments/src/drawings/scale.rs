//! A colour scale from pale to dark. Larger values are darker, also in greyscale print and for colour-blind readers.

use headrace_geometry::math;
use headrace_deliver::pictures::canvas::{Canvas, NORMAL, SMALL, Side};
use headrace_deliver::pictures::look::Colour;
use headrace_deliver::pictures::polyline::Px;

/// Colours at equal intervals, from the pale end. Source: Nuñez, Anderton, Renslow, "Optimizing colormaps with
/// consideration for color vision deficiency", 2018 (cividis).
const STOPS: [[u8; 3]; 9] = [
    [254, 232, 56],
    [228, 206, 83],
    [199, 183, 102],
    [168, 159, 114],
    [140, 136, 120],
    [112, 113, 115],
    [81, 89, 108],
    [40, 63, 109],
    [0, 34, 78],
];
/// Number of colours.
pub(super) const LEVELS: usize = 16;

/// The colour of a level, from 0 to one below [`LEVELS`].
pub(super) fn colour(level: usize) -> Colour {
    let at = (STOPS.len() - 1) as f64 * level.min(LEVELS - 1) as f64 / (LEVELS - 1) as f64;
    let below = usize::try_from(math::floor_to_i64(at)).unwrap_or(0);
    let share = at - below as f64;
    let stop = |k: usize| STOPS.get(k).or(STOPS.last()).copied().unwrap_or_default();
    let (from, to) = (stop(below), stop(below + 1));
    let part = |k: fn([u8; 3]) -> u8| {
        let (from, to) = (f64::from(k(from)), f64::from(k(to)));
        u8::try_from(math::round_to_i64(from + share * (to - from))).unwrap_or(u8::MAX)
    };
    Colour(part(|[red, _, _]| red), part(|[_, green, _]| green), part(|[_, _, blue]| blue))
}

/// The colour level of a value on a scale from zero to `most`. Values above `most` have the highest level.
pub(super) fn level(value: f64, most: f64) -> usize {
    let level = math::floor_to_i64(value / most * LEVELS as f64).max(0);
    usize::try_from(level).unwrap_or(0).min(LEVELS - 1)
}

/// Draws a strip of all colours, with numbers from zero to `most` below the strip and text above.
pub(super) fn legend(canvas: &Canvas, [left, top]: Px, [width, height]: Px, words: &str, most: f64) {
    canvas.text([left, top - 11.0], words, Side::Right, NORMAL);
    let step_px = width / LEVELS as f64;
    for level in 0..LEVELS {
        canvas.areas(&[([left + step_px * level as f64, top], [step_px, height])], colour(level));
    }
    for quarter in 0..=4 {
        let share = f64::from(quarter) / 4.0;
        let over = if quarter == 4 { " and more" } else { "" };
        let x = left + share * width;
        canvas.line(&[[x, top + height], [x, top + height + 4.0]], &headrace_deliver::pictures::look::AXIS);
        let words = format!("{:.0}{over}", share * most);
        canvas.text([x - 4.0, top + height + 13.0], &words, Side::Right, SMALL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_values_are_darker() {
        let light = |level: usize| {
            let Colour(red, green, blue) = colour(level);
            2 * u32::from(red) + 5 * u32::from(green) + u32::from(blue)
        };
        assert!((1..LEVELS).all(|level| light(level) < light(level - 1)));
        assert_eq!([level(0.0, 4.0), level(3.99, 4.0), level(9.0, 4.0)], [0, LEVELS - 1, LEVELS - 1]);
    }
}
