//! Probes for a Ping device: requests version and identity from all device ids.

use headrace_sensor::codec::Codec as _;
use headrace_sensor::driver::Probe;

use crate::codec::{Addressed, DeviceInformation, Message, PingCodec, ProtocolVersion, id};

/// Broadcast device id. Source: Ping protocol, device ids.
const EVERYONE: u8 = 255;
/// Device type of Ping1D and Ping2. Source: Ping protocol, `device_information`.
const ECHOSOUNDER: u8 = 1;

/// Requests the identity by broadcast and accepts the first answer.
#[derive(Debug, Clone, Default)]
pub struct PingProbe {
    codec: PingCodec,
    protocol: Option<ProtocolVersion>,
    found: Option<(u8, DeviceInformation)>,
}

impl Probe for PingProbe {
    /// The protocol version is requested first, so that it is known when the identity arrives.
    fn questions(&self) -> Vec<Vec<u8>> {
        let asked = [id::PROTOCOL_VERSION, id::DEVICE_INFORMATION].into_iter().filter_map(|about| {
            let message = Message::GeneralRequest(about);
            Addressed { source: 0, destination: EVERYONE, message }.encode().ok()
        });
        vec![asked.flat_map(|bytes| bytes.as_slice().to_vec()).collect()]
    }

    fn heard(&mut self, bytes: &[u8]) {
        let Self { codec, protocol, found } = self;
        codec.push(bytes, &mut |Addressed { source, message, .. }| match message {
            Message::ProtocolVersion(version) => *protocol = Some(version),
            Message::DeviceInformation(device) => *found = found.or(Some((source, device))),
            _ => (),
        });
    }

    fn identity(&self) -> Option<String> {
        let (device_id, device) = self.found?;
        let DeviceInformation {
            device_type, revision, firmware_major, firmware_minor, firmware_patch, ..
        } = device;
        let kind = match device_type {
            ECHOSOUNDER => "Ping echosounder (Ping1D, Ping2)".to_owned(),
            2 => "Ping360, not an echosounder".to_owned(),
            other => format!("Ping device of type {other}, not an echosounder"),
        };
        let version = self
            .protocol
            .map(|ProtocolVersion { major, minor, patch, .. }| format!(", protocol {major}.{minor}.{patch}"));
        Some(format!(
            "{kind}, device_id = {device_id}, revision {revision}, firmware {firmware_major}.{firmware_minor}.{firmware_patch}{}",
            version.unwrap_or_default()
        ))
    }

    fn is_of_kind(&self) -> bool {
        self.found.is_some_and(|(_, device)| device.device_type == ECHOSOUNDER)
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::device::{Emulator as _, EmulatorSetup};
    use headrace_sensor::geometry::site::Site;
    use headrace_sensor::geometry::time::{DurNs, MonoNs};

    use super::*;
    use crate::emulator::PingEmulator;
    use crate::settings::tests::settings;

    #[test]
    fn probe_identifies_an_echosounder_with_any_id() {
        let setup = EmulatorSetup { start: MonoNs(0), head: None, site: Site::default(), polled: false };
        let mut device = PingEmulator::new(settings("device_id = 7").unwrap(), DurNs(0), &setup);
        let mut probe = PingProbe::default();
        let mut answers = Vec::new();
        for question in probe.questions() {
            device.hear(MonoNs(1), &question, &mut |_, _, bytes| answers.extend_from_slice(bytes));
        }
        for piece in answers.chunks(3) {
            assert_eq!(probe.identity(), None);
            probe.heard(piece);
        }
        assert_eq!(
            probe.identity().unwrap(),
            "Ping echosounder (Ping1D, Ping2), device_id = 7, revision 1, firmware 3.29.0, protocol 1.0.0"
        );
        assert!(probe.is_of_kind());
    }

    #[test]
    fn probe_distinguishes_a_ping360() {
        let device = DeviceInformation {
            device_type: 2,
            revision: 1,
            firmware_major: 3,
            firmware_minor: 1,
            firmware_patch: 1,
            reserved: 0,
        };
        let message = Message::DeviceInformation(device);
        let answer = Addressed { source: 2, destination: 0, message }.encode().unwrap();
        let mut probe = PingProbe::default();
        probe.heard(answer.as_slice());
        assert!(probe.identity().unwrap().starts_with("Ping360, not an echosounder, device_id = 2"));
        assert!(!probe.is_of_kind());
    }
}
