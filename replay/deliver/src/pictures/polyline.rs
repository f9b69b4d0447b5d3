//! Clips polylines to a frame, and simplifies them.

use headrace_geometry::math;

/// A position on the sheet: pixels to the right, and pixels down.
pub type Px = [f64; 2];

/// Maximum distance between a line and its simplified form, pixels.
const THINNED_PX: f64 = 0.1;

/// A rectangle on the sheet, in pixels from the sheet's left and upper edges.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Left side.
    pub left: f64,
    /// Upper side.
    pub top: f64,
    /// Right side.
    pub right: f64,
    /// Lower side.
    pub bottom: f64,
}

impl Frame {
    /// Returns the pieces of a polyline that lie within the frame.
    pub fn cut(&self, line: &[Px]) -> Vec<Vec<Px>> {
        let mut pieces: Vec<Vec<Px>> = Vec::new();
        for pair in line.windows(2) {
            let [from, to] = pair else { continue };
            let Some([begin, end]) = self.cut_segment(*from, *to) else { continue };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&begin) => piece.push(end),
                _ => pieces.push(vec![begin, end]),
            }
        }
        pieces
    }

    /// Returns the part of a segment within the frame. Source: Liang and Barsky 1984.
    fn cut_segment(&self, from: Px, to: Px) -> Option<[Px; 2]> {
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        let sides = [
            (-dx, from[0] - self.left),
            (dx, self.right - from[0]),
            (-dy, from[1] - self.top),
            (dy, self.bottom - from[1]),
        ];
        for (outwards, room) in sides {
            if outwards < 0.0 {
                first = first.max(room / outwards);
            } else if outwards > 0.0 {
                last = last.min(room / outwards);
            } else if room < 0.0 {
                return None;
            }
        }
        let along = |share: f64| [from[0] + share * dx, from[1] + share * dy];
        // An end of the segment that isn't clipped stays bit-identical, so that adjacent pieces can be joined.
        let begin = if first > 0.0 { along(first) } else { from };
        let end = if last < 1.0 { along(last) } else { to };
        (first <= last).then_some([begin, end])
    }

    /// Whether a position is within the frame.
    pub fn has(&self, place: Px) -> bool {
        (self.left..=self.right).contains(&place[0]) && (self.top..=self.bottom).contains(&place[1])
    }
}

/// Connects two positions on an unrolled wall by line segments. Positions are (x, arc length), m.
///
/// The connection is one segment or, if the shorter path crosses the seam, two segments that end at the seam.
pub fn over_seam(perimeter_m: f64, from: [f64; 2], to: [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let around_m = math::wrap_signed(to[1] - from[1], perimeter_m);
    if (to[1] - from[1] - around_m).abs() < 1e-9 {
        return vec![[from, to]];
    }
    let (leaving_m, entering_m) = if around_m > 0.0 { (perimeter_m, 0.0) } else { (0.0, perimeter_m) };
    let share = (leaving_m - from[1]) / around_m;
    let x_m = from[0] + share * (to[0] - from[0]);
    vec![[from, [x_m, leaving_m]], [[x_m, entering_m], to]]
}

/// Returns a simplified line. Source: Douglas and Peucker 1973.
pub fn thinned(line: &[Px]) -> Vec<Px> {
    let mut keep = vec![false; line.len()];
    if let Some(end) = keep.first_mut() {
        *end = true;
    }
    if let Some(end) = keep.last_mut() {
        *end = true;
    }
    let mut open = vec![(0, line.len().saturating_sub(1))];
    while let Some((first, last)) = open.pop() {
        if let Some(middle) = farthest(line, first, last) {
            if let Some(kept) = keep.get_mut(middle) {
                *kept = true;
            }
            open.extend([(first, middle), (middle, last)]);
        }
    }
    line.iter().zip(keep).filter(|(_, kept)| *kept).map(|(point, _)| *point).collect()
}

/// Returns the index of the point that is farthest from the chord between `first` and `last`; `None` if every point is
/// within the tolerance of the chord.
fn farthest(line: &[Px], first: usize, last: usize) -> Option<usize> {
    let (from, to) = (*line.get(first)?, *line.get(last)?);
    let between = line.iter().enumerate().take(last).skip(first + 1);
    let most =
        between.map(|(k, point)| (k, off_chord_px(*point, from, to))).max_by(|a, b| a.1.total_cmp(&b.1));
    most.filter(|(_, off_px)| *off_px > THINNED_PX).map(|(k, _)| k)
}

fn off_chord_px(point: Px, from: Px, to: Px) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let here = [point[0] - from[0], point[1] - from[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let share = if length2 > 0.0 { (here[0] * along[0] + here[1] * along[1]) / length2 } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    math::hypot(here[0] - share * along[0], here[1] - share * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Frame = Frame { left: 0.0, top: 0.0, right: 1.0, bottom: 1.0 };

    #[test]
    fn line_is_clipped_at_the_frame() {
        let over = [[-1.0, 0.5], [0.5, 0.5], [0.5, 3.0], [0.75, 3.0], [0.75, 0.5]];
        let pieces = UNIT.cut(&over);
        assert_eq!(pieces, [vec![[0.0, 0.5], [0.5, 0.5], [0.5, 1.0]], vec![[0.75, 1.0], [0.75, 0.5]]]);
        assert!(UNIT.cut(&[[-1.0, 2.0], [2.0, 2.0]]).is_empty() && UNIT.cut(&[[0.5, 0.5]]).is_empty());
        assert!(UNIT.has([1.0, 0.0]) && !UNIT.has([1.1, 0.0]));
    }

    #[test]
    fn simplified_line_keeps_corners_and_drops_points_between_them() {
        let line: Vec<Px> = (0..=100).map(|k| [f64::from(k), f64::from((k - 50_i32).abs())]).collect();
        assert_eq!(thinned(&line), [[0.0, 50.0], [50.0, 0.0], [100.0, 50.0]]);
        assert!(thinned(&[]).is_empty());
        assert_eq!(thinned(&[[1.0, 1.0]]), [[1.0, 1.0]]);
    }
}
