//! Places labels beside markers so that they cover neither markers nor one another.

use headrace_deliver::pictures::canvas::{Letters, Side, width_px};
use headrace_deliver::pictures::polyline::{Frame, Px};

/// Space between a marker and its label, pixels.
const APART_PX: f64 = 9.0;

/// Distance beyond which a line connects a label to its marker, pixels.
const FAR_PX: f64 = 14.0;

/// A placed label.
pub(super) struct Placed {
    pub(super) place: Px,
    pub(super) side: Side,
    /// Start of the line from the label to its marker; `None` if the label is right beside the marker.
    pub(super) led_from: Option<Px>,
}

/// Areas of a drawing that markers and labels already occupy.
#[derive(Default)]
pub(super) struct Taken(Vec<Frame>);

impl Taken {
    /// Marks the area of a marker as occupied.
    pub(super) fn marker(&mut self, [x, y]: Px) {
        const HALF_PX: f64 = 6.0;
        self.0.push(Frame { left: x - HALF_PX, top: y - HALF_PX, right: x + HALF_PX, bottom: y + HALF_PX });
    }

    /// Finds a free place for a label beside a marker, within a frame, and marks it as occupied; `None` if
    /// there is no room.
    pub(super) fn label(
        &mut self,
        [x, y]: Px,
        text: &str,
        letters: Letters,
        within: &Frame,
    ) -> Option<Placed> {
        let up_px = letters.size_px + 2.0;
        for step in [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0] {
            for side in [Side::Right, Side::Left, Side::Middle] {
                let by_px = match side {
                    Side::Right => APART_PX,
                    Side::Left => -APART_PX,
                    // A horizontally centred label can only be directly above or below its marker.
                    Side::Middle if step == 0.0 => continue,
                    Side::Middle => 0.0,
                };
                let place = [x + by_px, y + step * up_px];
                let frame = frame(place, side, width_px(text, letters), up_px);
                let fits = frame.left >= within.left
                    && frame.right <= within.right
                    && frame.top >= within.top
                    && frame.bottom <= within.bottom;
                if fits && !self.0.iter().any(|taken| overlap(taken, &frame)) {
                    self.0.push(frame);
                    let nearest = [x.clamp(frame.left, frame.right), y.clamp(frame.top, frame.bottom)];
                    let is_far = (nearest[0] - x).abs().max((nearest[1] - y).abs()) > FAR_PX;
                    return Some(Placed { place, side, led_from: is_far.then_some(nearest) });
                }
            }
        }
        None
    }
}

fn frame([x, y]: Px, side: Side, width: f64, height: f64) -> Frame {
    let left = match side {
        Side::Right => x,
        Side::Left => x - width,
        Side::Middle => x - width / 2.0,
    };
    Frame { left, top: y - height / 2.0, right: left + width, bottom: y + height / 2.0 }
}

fn overlap(a: &Frame, b: &Frame) -> bool {
    a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_deliver::pictures::canvas::SMALL;

    const SHEET: Frame = Frame { left: 0.0, top: 0.0, right: 400.0, bottom: 200.0 };

    #[test]
    fn labels_of_crowded_markers_do_not_overlap() {
        let mut taken = Taken::default();
        let markers: Vec<Px> = (0..10).map(|k| [100.0 + 4.0 * f64::from(k), 100.0]).collect();
        for at in &markers {
            taken.marker(*at);
        }
        let placed: Vec<Placed> =
            markers.iter().filter_map(|at| taken.label(*at, "0.05 m", SMALL, &SHEET)).collect();
        assert_eq!(placed.len(), 10);
        let led = placed.iter().filter(|placed| placed.led_from.is_some()).count();
        assert!((1..10).contains(&led), "some labels are beside their markers, some are not: {led}");
        for (k, a) in taken.0.iter().enumerate().skip(10) {
            assert!(!taken.0.iter().take(k).any(|b| overlap(a, b)), "{a:?}");
        }
    }

    #[test]
    fn label_without_room_is_not_drawn() {
        let narrow = Frame { left: 0.0, top: 0.0, right: 30.0, bottom: 30.0 };
        assert!(Taken::default().label([15.0, 15.0], "much too long", SMALL, &narrow).is_none());
    }
}
