//! The length of a closed chain of pixels.

use core::f64::consts::SQRT_2;

use super::error::PerimeterError;
use super::image::Image;

/// A closed line of pixels around the head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Chain {
    /// Steps to a pixel sharing a side.
    pub straight: usize,
    /// Steps to a pixel sharing only a corner.
    pub diagonal: usize,
    /// Changes of direction from one step to the next.
    pub corners: usize,
    /// Length with steps of 1 and sqrt 2 pixels (Freeman), m. On average over all directions it is 5 % too long.
    pub steps_m: f64,
    /// Length of the chain, m, with weights 0.980 for straight steps, 1.406 for diagonal steps and -0.091 for corners.
    ///
    /// For long lines, this length is unbiased on average over all directions. Source: Vossepoel, Smeulders 1982.
    pub corrected_m: f64,
}

/// Traces a closed line in which each pixel has two neighbours.
///
/// Errors: a pixel without exactly two neighbours, or a line in several pieces.
pub(super) fn trace(ring: &Image, pixel_m: f64) -> Result<Chain, PerimeterError> {
    let pixels = ring.pixels();
    let forks = pixels.iter().filter(|p| ring.neighbours(**p) != 2).count();
    if forks > 0 {
        return Err(PerimeterError::Forked { forks });
    }
    let directions = walk(ring, pixels.first().copied().ok_or(PerimeterError::NotClosed)?);
    if directions.len() != pixels.len() {
        return Err(PerimeterError::NotClosed);
    }
    let straight = directions.iter().filter(|d| *d % 2 == 0).count();
    let diagonal = directions.len() - straight;
    let turned = directions.iter().zip(directions.iter().cycle().skip(1));
    let corners = turned.filter(|(a, b)| a != b).count();
    let (s, d, c) = (straight as f64, diagonal as f64, corners as f64);
    Ok(Chain {
        straight,
        diagonal,
        corners,
        steps_m: (s + SQRT_2 * d) * pixel_m,
        corrected_m: (0.980 * s + 1.406 * d - 0.091 * c) * pixel_m,
    })
}

/// Directions of the steps along the line until it returns to the first pixel. Even directions are straight.
fn walk(ring: &Image, first: usize) -> Vec<usize> {
    let (mut directions, mut at, mut before) = (Vec::new(), first, None);
    loop {
        let round = ring.round(at);
        let step = (0..8).find(|k| ring.set[round[*k]] && Some(round[*k]) != before);
        let Some(step) = step else { return directions };
        directions.push(step);
        (before, at) = (Some(at), round[step]);
        if at == first || directions.len() > ring.set.len() {
            return directions;
        }
    }
}
