//! Labels at the ends of curves, moved apart where they would cover each other.

use super::canvas::{Canvas, Letters, NORMAL, Side, width_px};
use super::look::{LEADER, Look};
use super::polyline::Frame;
use super::polyline::Px;

/// Height of a line of text, pixels.
const LINE_PX: f64 = 16.0;
/// Gap between a frame and its labels, pixels.
const APART_PX: f64 = 12.0;

/// The label at the end of a curve.
#[derive(Debug, Clone)]
pub struct Label {
    /// Position of the curve's end.
    pub place: Px,
    /// Text of the label, line by line.
    pub lines: Vec<String>,
    /// Look of the curve, whose colour the label has.
    pub look: Look,
    /// Whether the label is bold.
    pub bold: bool,
}

impl Label {
    fn letters(&self) -> Letters {
        Letters { colour: self.look.colour, bold: self.bold, ..NORMAL }
    }

    fn size_px(&self) -> Px {
        let widths = self.lines.iter().map(|line| width_px(line, self.letters()));
        [widths.fold(0.0, f64::max), LINE_PX * self.lines.len() as f64 + 3.0]
    }
}

/// Draws labels to the right of a frame, beside the ends of their curves. Overlapping labels are moved apart.
pub fn at_right(canvas: &Canvas, frame: &Frame, labels: &[Label]) {
    let mut labels: Vec<&Label> = labels.iter().collect();
    labels.sort_by(|a, b| a.place[1].total_cmp(&b.place[1]));
    let wanted: Vec<_> = labels.iter().map(|label| (label.place[1], label.size_px()[1])).collect();
    let x = frame.right + APART_PX;
    for (label, y) in labels.iter().zip(moved_apart(&wanted, frame.top, frame.bottom + LINE_PX)) {
        canvas.line(&[label.place, [x - 3.0, y]], &LEADER);
        let first = y - LINE_PX * (label.lines.len() as f64 - 1.0) / 2.0;
        for (k, line) in label.lines.iter().enumerate() {
            canvas.text([x, first + LINE_PX * k as f64], line, Side::Right, label.letters());
        }
    }
}

/// Draws one-line labels above a frame.
pub fn above(canvas: &Canvas, frame: &Frame, labels: &[Label]) {
    let mut labels: Vec<&Label> = labels.iter().collect();
    labels.sort_by(|a, b| a.place[0].total_cmp(&b.place[0]));
    let wanted: Vec<_> = labels.iter().map(|label| (label.place[0], label.size_px()[0] + 8.0)).collect();
    for (label, x) in labels.iter().zip(moved_apart(&wanted, frame.left, frame.right)) {
        let y = frame.top - APART_PX;
        canvas.line(&[label.place, [x, y + 6.0]], &LEADER);
        for line in &label.lines {
            canvas.text([x, y], line, Side::Middle, label.letters());
        }
    }
}

/// Moves overlapping intervals apart until they touch, and returns the middles of all intervals.
///
/// `wanted` has the middle and the length of each interval. The intervals keep their order, and lie between `from` and
/// `to` if they fit.
fn moved_apart(wanted: &[(f64, f64)], from: f64, to: f64) -> Vec<f64> {
    let mut middles: Vec<f64> = Vec::with_capacity(wanted.len());
    let mut free = from;
    for (place, length) in wanted {
        let middle = place.max(free + length / 2.0);
        free = middle + length / 2.0;
        middles.push(middle);
    }
    let mut free = to;
    for (middle, (_, length)) in middles.iter_mut().zip(wanted).rev() {
        *middle = middle.min(free - length / 2.0);
        free = *middle - length / 2.0;
    }
    middles
}

#[cfg(test)]
mod tests {
    use super::moved_apart;

    #[test]
    fn overlapping_labels_move_until_they_touch() {
        assert_eq!(moved_apart(&[(10.0, 4.0), (20.0, 4.0)], 0.0, 30.0), [10.0, 20.0]);
        assert_eq!(moved_apart(&[(10.0, 4.0), (11.0, 4.0), (12.0, 4.0)], 0.0, 30.0), [10.0, 14.0, 18.0]);
        assert_eq!(moved_apart(&[(28.0, 4.0), (30.0, 4.0)], 0.0, 30.0), [24.0, 28.0]);
        assert!(moved_apart(&[], 0.0, 1.0).is_empty());
    }
}
