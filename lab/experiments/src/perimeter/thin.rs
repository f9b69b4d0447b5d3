//! Thinning and pruning of binary images.

use super::image::Image;

/// Thins every line from both sides to a middle line about one pixel wide.
///
/// Source: Zhang, Suen, "A fast parallel algorithm for thinning digital patterns", 1984.
pub(super) fn zhang_suen(image: &mut Image) {
    let mut pixels = image.pixels();
    loop {
        let before = pixels.len();
        for first_half in [true, false] {
            let taken: Vec<usize> =
                pixels.iter().copied().filter(|p| removable(image, *p, first_half)).collect();
            for pixel in taken {
                image.set[pixel] = false;
            }
            pixels.retain(|p| image.set[*p]);
        }
        if pixels.len() == before {
            return;
        }
    }
}

fn removable(image: &Image, pixel: usize, first_half: bool) -> bool {
    let ring = image.round(pixel).map(|k| image.set[k]);
    let set = ring.iter().filter(|s| **s).count();
    let [north, _, east, _, south, _, west, _] = ring;
    let open =
        if first_half { !(east && south && (north || west)) } else { !(north && west && (east || south)) };
    (2..=6).contains(&set) && rises(ring) == 1 && open
}

/// Number of transitions from clear to set around the ring of neighbours.
fn rises(ring: [bool; 8]) -> usize {
    (0..8).filter(|k| !ring[*k] && ring[(k + 1) % 8]).count()
}

/// Prunes and thins the image until neither step changes it, so that only single lines remain.
///
/// One pass may not be enough. Where a spur ends in two pixels, neither is removed while the other is there. A removed
/// spur may leave a filled corner.
pub(super) fn clean(image: &mut Image) {
    loop {
        let before = image.pixels().len();
        to_single(image);
        prune(image);
        if image.pixels().len() == before {
            return;
        }
    }
}

/// Removes, one by one, pixels that are neither ends of a line nor needed for a connection.
///
/// The remaining lines have no filled corners, and no pixel has more neighbours than the line's shape requires.
fn to_single(image: &mut Image) {
    loop {
        let mut changed = false;
        for pixel in image.pixels() {
            if image.neighbours(pixel) >= 2 && needless(image, pixel) {
                image.set[pixel] = false;
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// Whether the neighbours of an edge pixel stay connected if the pixel is removed.
fn needless(image: &Image, pixel: usize) -> bool {
    let ring = image.round(pixel).map(|k| image.set[k]);
    // Yokoi's connectivity number for eight neighbours: the number of runs of clear sides that set corners separate.
    let pieces: usize =
        [0, 2, 4, 6].into_iter().filter(|k| !ring[*k] && (ring[k + 1] || ring[(k + 2) % 8])).count();
    pieces == 1
}

/// Removes ends until none are left. Closed lines, and lines that connect them, remain.
fn prune(image: &mut Image) {
    let mut stack = image.pixels();
    while let Some(pixel) = stack.pop() {
        if image.set[pixel] && image.neighbours(pixel) <= 1 {
            image.set[pixel] = false;
            stack.extend(image.round(pixel).into_iter().filter(|k| image.set[*k]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(rows: &[&str]) -> Image {
        let side = rows.len();
        let mut image = Image::empty(side);
        for (row, line) in rows.iter().enumerate() {
            for (column, mark) in line.chars().enumerate() {
                image.set[row * side + column] = mark == '#';
            }
        }
        image
    }

    #[test]
    fn bar_is_thinned_to_its_middle_line() {
        let mut image = drawn(&[
            "...........",
            "...........",
            "...........",
            "...........",
            ".#########.",
            ".#########.",
            ".#########.",
            "...........",
            "...........",
            "...........",
            "...........",
        ]);
        zhang_suen(&mut image);
        let rows: Vec<usize> = image.pixels().iter().map(|k| k / 11).collect();
        assert!(rows.len() >= 5 && rows.iter().all(|row| *row == 5), "{rows:?}");
    }

    #[test]
    fn spurs_are_removed_but_rings_remain() {
        let mut image = drawn(&[
            "...........",
            ".#.........",
            "..#........",
            "...###.....",
            "...#.#.....",
            "...#.####..",
            "...###..#..",
            ".....#.....",
            ".....#.....",
            "...........",
            "...........",
        ]);
        clean(&mut image);
        // The remaining closed line is around row 5, column 4. It may be one pixel off at the removed spur.
        let pixels = image.pixels();
        assert!((6..=8).contains(&pixels.len()), "{pixels:?}");
        assert!(pixels.iter().all(|k| image.neighbours(*k) == 2), "{pixels:?}");
        assert!(pixels.iter().all(|k| (k / 11).abs_diff(5) <= 2 && (k % 11).abs_diff(4) <= 2), "{pixels:?}");
    }

    #[test]
    fn staircase_loses_its_filled_corners_and_stays_closed() {
        let mut image = drawn(&[
            "..........",
            "..####....",
            "..#..##...",
            "..#...##..",
            "..#....#..",
            "..#....#..",
            "..##..##..",
            "...####...",
            "..........",
            "..........",
        ]);
        to_single(&mut image);
        assert!(image.pixels().iter().all(|k| image.neighbours(*k) == 2), "{:?}", image.pixels());
        assert!(image.pixels().len() >= 14);
    }

    #[test]
    fn yokoi_number_agrees_with_counted_components() {
        for mask in 0..256_u32 {
            let mut image = Image::empty(5);
            let ring = image.round(12);
            for (bit, pixel) in ring.into_iter().enumerate() {
                image.set[pixel] = mask >> bit & 1 == 1;
            }
            let sides_open = [0, 2, 4, 6].iter().any(|k| mask >> k & 1 == 0);
            let mut left: Vec<usize> = ring.into_iter().filter(|k| image.set[*k]).collect();
            let mut pieces = 0;
            while let Some(first) = left.pop() {
                pieces += 1;
                let mut stack = vec![first];
                while let Some(a) = stack.pop() {
                    let touch = |b: &usize| (a / 5).abs_diff(b / 5) <= 1 && (a % 5).abs_diff(b % 5) <= 1;
                    stack.extend(left.iter().copied().filter(touch));
                    left.retain(|b| !touch(b));
                }
            }
            assert_eq!(needless(&image, 12), pieces == 1 && sides_open, "{mask:08b}");
        }
    }
}
