//! A binary image of a cross-section, with the head in its centre.

use headrace_geometry::math::{self, TAU};

use super::echo::Echoes;
use super::settings::Settings;

/// A square image. Pixels on the border are never set, so every set pixel has eight neighbours.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    pub(super) side: usize,
    pub(super) set: Vec<bool>,
}

impl Image {
    /// An image with no pixel set.
    pub(super) fn empty(side: usize) -> Self {
        Self { side, set: vec![false; side * side] }
    }

    /// Sets the pixels at whose centre the echo reaches the threshold. Columns run to the left, rows up.
    pub(super) fn of(echoes: &Echoes, settings: &Settings) -> Self {
        let half = math::floor_to_i64(settings.range_max_m / settings.pixel_m) + 2 + settings.grow_px as i64;
        let mut image = Self::empty(crate::index(2 * half + 1));
        let mut pixel = 0;
        for row in -half..=half {
            for column in -half..=half {
                let (y, z) = (column as f64 * settings.pixel_m, row as f64 * settings.pixel_m);
                let range_m = math::hypot(y, z);
                if range_m < settings.range_max_m {
                    let angle = math::wrap(math::atan2(y, -z), TAU);
                    image.set[pixel] = echoes.at(angle, range_m) >= settings.threshold;
                }
                pixel += 1;
            }
        }
        image
    }

    /// The eight neighbours of a pixel that isn't on the border, in circular order from the one above.
    pub(super) fn round(&self, pixel: usize) -> [usize; 8] {
        let (p, s) = (pixel, self.side);
        [p + s, p + s + 1, p + 1, p - s + 1, p - s, p - s - 1, p - 1, p + s - 1]
    }

    /// Number of set neighbours of a pixel.
    pub(super) fn neighbours(&self, pixel: usize) -> usize {
        self.round(pixel).into_iter().filter(|k| self.set[*k]).count()
    }

    /// Set pixels, row by row.
    pub(super) fn pixels(&self) -> Vec<usize> {
        (0..self.set.len()).filter(|k| self.set[*k]).collect()
    }

    /// Dilates the image: sets all pixels within `by` pixels of a set pixel. The border stays clear.
    pub(super) fn grow(&mut self, by: usize) {
        if by == 0 {
            return;
        }
        let by = by as i64;
        let offsets: Vec<(i64, i64)> = (-by..=by)
            .flat_map(|i| (-by..=by).map(move |j| (i, j)))
            .filter(|(i, j)| i * i + j * j <= by * by)
            .collect();
        let side = self.side as i64;
        for pixel in self.pixels() {
            let (row, column) = (pixel as i64 / side, pixel as i64 % side);
            for (i, j) in &offsets {
                let (row, column) = (row + i, column + j);
                if (1..side - 1).contains(&row) && (1..side - 1).contains(&column) {
                    self.set[crate::index(row * side + column)] = true;
                }
            }
        }
    }

    /// The set pixels that bound the clear area around the centre; `None` if that area reaches the border.
    ///
    /// Specks within the clear area bound it too, so only the largest component is returned.
    pub(super) fn round_the_middle(&self) -> Option<Self> {
        let middle = self.side / 2 * self.side + self.side / 2;
        let mut seen = vec![false; self.set.len()];
        let mut bounding = Self::empty(self.side);
        let mut stack = vec![middle];
        while let Some(pixel) = stack.pop() {
            if seen[pixel] {
                continue;
            }
            seen[pixel] = true;
            if self.on_border(pixel) {
                return None;
            }
            for next in [pixel + 1, pixel - 1, pixel + self.side, pixel - self.side] {
                if self.set[next] {
                    bounding.set[next] = true;
                } else {
                    stack.push(next);
                }
            }
        }
        bounding.largest_piece()
    }

    fn on_border(&self, pixel: usize) -> bool {
        let (row, column) = (pixel / self.side, pixel % self.side);
        row == 0 || column == 0 || row == self.side - 1 || column == self.side - 1
    }

    /// The largest 8-connected component. Among equally large components, the first one is returned.
    fn largest_piece(&self) -> Option<Self> {
        let mut left = self.clone();
        let mut largest: Vec<usize> = Vec::new();
        for pixel in self.pixels() {
            let piece = left.take_piece(pixel);
            if piece.len() > largest.len() {
                largest = piece;
            }
        }
        let mut image = Self::empty(self.side);
        for pixel in &largest {
            image.set[*pixel] = true;
        }
        (!largest.is_empty()).then_some(image)
    }

    /// Clears a pixel's component and returns its pixels.
    fn take_piece(&mut self, from: usize) -> Vec<usize> {
        let (mut piece, mut stack) = (Vec::new(), vec![from]);
        while let Some(pixel) = stack.pop() {
            if core::mem::replace(&mut self.set[pixel], false) {
                piece.push(pixel);
                stack.extend(self.round(pixel));
            }
        }
        piece
    }
}
