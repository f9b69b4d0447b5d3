//! Probes a line for a head, with one short ping that doesn't step the head.

use headrace_sensor::codec::Codec as _;
use headrace_sensor::driver::Probe;

use crate::codec::{Command, Header, Model, Points, ReturnCodec, ZERO_COUNT};

/// Probed head ids: the default, and the usual ids of further heads on an RS-485 line.
pub(crate) const HEAD_IDS: [u8; 4] = [0x10, 0x11, 0x12, 0x13];

/// Degrees per count of a head's position.
const DEGREES_A_COUNT: f64 = 0.3;

/// Polls a head id, and accepts the first whole return with this id as the answer.
#[derive(Debug, Clone)]
pub struct HeadProbe {
    head_id: u8,
    codec: ReturnCodec,
    found: Option<Header>,
}

impl HeadProbe {
    /// Creates a probe for the head with this id.
    pub fn new(head_id: u8) -> Self {
        Self { head_id, codec: ReturnCodec::default(), found: None }
    }
}

/// Command for a ping at minimum range and gain, without a step.
fn standing_still(head_id: u8) -> Command {
    Command {
        head_id,
        range_m: 1,
        reverse: false,
        start_gain_db: 0.0,
        logf_db: 20.0,
        absorption_dbpm: 0.6,
        train_deg: 0.0,
        sector_deg: 360.0,
        step_deg: 0.0,
        pulse_us: 10.0,
        min_range_m: 0.0,
        points: Points::P250,
        data_bits: 8,
        profile: true,
        calibrate: false,
        switch_delay_ms: 0.0,
        frequency_khz: 1000.0,
    }
}

impl Probe for HeadProbe {
    fn questions(&self) -> Vec<Vec<u8>> {
        standing_still(self.head_id).encode().iter().map(|bytes| bytes.to_vec()).collect()
    }

    fn heard(&mut self, bytes: &[u8]) {
        let Self { head_id, codec, found } = self;
        codec.push(bytes, &mut |answer| {
            *found = found.or(Some(answer.header).filter(|header| header.head_id == *head_id));
        });
    }

    fn identity(&self) -> Option<String> {
        let Header { tag, head_id, status, position, .. } = self.found?;
        // An echosounder may have this head id, too, but its position has no meaning.
        if Model::of_head_id(head_id) == Model::Sounder852 {
            return Some(format!("Imagenex 881 family or 852 sounder, head_id = {head_id:#04x}"));
        }
        let model = if tag.is_gs() { "881 with attitude sensors (GS)" } else { "881 family" };
        let degrees = f64::from(i32::from(position) - ZERO_COUNT) * DEGREES_A_COUNT;
        let refuses = if status.accepted() { "" } else { ", refuses the settings" };
        Some(format!("Imagenex {model}, head_id = {head_id:#04x}, at {degrees:.1} degrees{refuses}"))
    }

    fn is_of_kind(&self) -> bool {
        self.found.is_some_and(|header| Model::of_head_id(header.head_id) == Model::Head881)
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::device::{Direction, Emulator as _, EmulatorSetup};
    use headrace_sensor::geometry::site::Site;
    use headrace_sensor::geometry::time::{DurNs, MonoNs};

    use super::*;
    use crate::codec::CommandCodec;
    use crate::emulator::HeadEmulator;
    use crate::settings::tests::settings;
    use crate::stepping::Head;

    fn questions() -> Vec<Vec<u8>> {
        HEAD_IDS.iter().flat_map(|id| HeadProbe::new(*id).questions()).collect()
    }

    /// Returns the answers of a head configured with these keys to all probe requests, in order.
    fn answers(keys: &str) -> Vec<Vec<u8>> {
        let setup = EmulatorSetup { start: MonoNs(0), head: None, site: Site::default(), polled: false };
        let mut head = HeadEmulator::new(settings(keys).unwrap(), DurNs(0), &setup);
        let (mut due, mut answers) = (Vec::new(), Vec::new());
        for (number, question) in questions().iter().enumerate() {
            let at = MonoNs(1_000_000_000 * (number as u64 + 1));
            head.hear(at, question, &mut |_, _, _| ());
            head.begin(at + DurNs(1), &mut due);
            for sounding in due.drain(..) {
                head.tell(&sounding, &mut |direction, _, bytes| {
                    assert_eq!(direction, Direction::Received);
                    answers.push(bytes.to_vec());
                });
            }
        }
        answers
    }

    #[test]
    fn probe_reports_head_id_and_position() {
        let mut probe = HeadProbe::new(0x10);
        assert_eq!(probe.identity(), None);
        let answers = answers("mode = \"slow\"");
        assert_eq!(answers.len(), 1, "the head answers only the question with its id");
        let (first, second) = answers[0].split_at(5);
        probe.heard(b"noise");
        probe.heard(first);
        assert_eq!(probe.identity(), None, "half a return identifies no head");
        probe.heard(second);
        assert_eq!(probe.identity().unwrap(), "Imagenex 881 family, head_id = 0x10, at 0.0 degrees");
        assert!(probe.is_of_kind());
    }

    #[test]
    fn only_the_probe_of_its_id_finds_a_head() {
        let [mut probe, mut other] = [0x13, 0x12].map(HeadProbe::new);
        for answer in answers("mode = \"slow\"\nhead_id = 0x13") {
            probe.heard(&answer);
            other.heard(&answer);
        }
        assert!(probe.identity().unwrap().contains("head_id = 0x13"));
        assert!(!probe.is_of_kind(), "it may be an 852 sounder");
        assert_eq!(other.identity(), None);
    }

    #[test]
    fn probe_never_moves_a_head() {
        let mut head = Head::new(700, true);
        let mut asked = 0;
        let mut codec = CommandCodec::default();
        for question in questions() {
            codec.push(&question, &mut |command| {
                head.obey(&command);
                asked += 1;
                assert!(!command.calibrate);
            });
        }
        assert_eq!((asked, head.position(), head.growing()), (HEAD_IDS.len(), 700, true));
    }
}
