//! Checks the messages of `--mavlink-out` as a ground station receives them. The decoder in this file was written from
//! the MAVLink guide, independently of headrace's decoder.

use std::collections::{BTreeMap, BTreeSet};
use std::net::UdpSocket;
use std::time::Duration;

use headrace_tests::{Folder, root};

/// Names of values that QGroundControl takes for values of the autopilot. headrace must not use them.
const RESERVED: [&str; 8] =
    ["TetherTrn", "RFTarget", "CamTilt", "Lights1", "Lights2", "PilotGain", "InputHold", "RollPitch"];

/// Checksum CRC-16/MCRF4XX. Source: MAVLink guide, "Packet Serialization".
fn checksum(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0xffff, |sum, byte| {
        let mut low = byte ^ (sum & 0xff) as u8;
        low ^= low << 4;
        let low = u16::from(low);
        (sum >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    })
}

struct Said {
    sequence: u8,
    id: u32,
    payload: Vec<u8>,
}

/// Decodes a datagram, which contains one MAVLink 2 frame.
fn said(datagram: &[u8]) -> Said {
    let length = usize::from(datagram[1]);
    assert_eq!((datagram[0], datagram[2], datagram.len()), (0xfd, 0, 12 + length), "{datagram:?}");
    assert_eq!(datagram[5..7], [7, 191], "system and component");
    let id = u32::from_le_bytes([datagram[7], datagram[8], datagram[9], 0]);
    // CRC_EXTRA (checksum seed) of the message, by message id. Only HEARTBEAT, NAMED_VALUE_FLOAT and STATUSTEXT may
    // occur.
    let extra =
        *BTreeMap::from([(0, 50), (251, 170), (253, 83)]).get(&id).unwrap_or_else(|| panic!("message {id}"));
    let summed = datagram[1..10 + length].iter().copied().chain([extra]);
    assert_eq!(checksum(summed).to_le_bytes(), datagram[10 + length..]);
    let mut payload = datagram[10..10 + length].to_vec();
    payload.resize(60, 0);
    Said { sequence: datagram[4], id, payload }
}

fn text_of(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8(bytes[..end].to_vec()).unwrap()
}

/// All MAVLink messages that a replay sends, and the digest of the replay's results.
fn heard(log: &str) -> (Vec<Said>, String) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    let to = format!("udpout:{}", socket.local_addr().unwrap());
    let (done, is_done) = std::sync::mpsc::channel();
    let listening = std::thread::spawn(move || {
        let (mut all, mut bytes) = (Vec::new(), [0; 512]);
        loop {
            match socket.recv(&mut bytes) {
                Ok(count) => all.push(said(&bytes[..count])),
                Err(_) if is_done.try_recv().is_ok() => return all,
                Err(_) => {}
            }
        }
    });
    let digest = replay(log, &to);
    done.send(()).unwrap();
    (listening.join().unwrap(), digest)
}

fn replay(log: &str, to: &str) -> String {
    let folder = Folder::new();
    let log = root().join(format!("tests/golden/{log}.mcap"));
    let arguments = [
        "replay",
        "-v",
        log.to_str().unwrap(),
        "--speed",
        "40x",
        "--mavlink-out",
        to,
        "--mavlink-system",
        "7",
    ];
    let answer = folder.headrace(&arguments);
    answer
        .stdout
        .lines()
        .find(|line| line.starts_with("digest "))
        .unwrap_or_else(|| panic!("{}", answer.stderr))
        .to_owned()
}

#[test]
fn ground_station_receives_heartbeats_values_and_each_alert_once() {
    let (all, digest) = heard("too-fast");
    let of = |id: u32| all.iter().filter(move |said| said.id == id);
    // Consecutive sequence numbers show that no frame is lost.
    let mut expected = 0_u8;
    for said in &all {
        assert_eq!(said.sequence, expected);
        expected = expected.wrapping_add(1);
    }
    // The heartbeat's type is an onboard computer, not an autopilot. The dive lasts 81 s, with about one heartbeat
    // per second.
    assert!(of(0).all(|said| said.payload[4..6] == [18, 8]));
    assert!((75..=90).contains(&of(0).count()), "{}", of(0).count());
    let name = |said: &Said| text_of(&said.payload[8..18]);
    let names: BTreeSet<String> = of(251).map(name).collect();
    assert!(
        names.iter().all(|name| name.starts_with("HR_") && !RESERVED.contains(&name.as_str())),
        "{names:?}"
    );
    let values = |of_name: &str| {
        let value = |said: &Said| f32::from_le_bytes(said.payload[4..8].try_into().unwrap());
        of(251).filter(|said| name(said) == of_name).map(value).collect::<Vec<_>>()
    };
    let (speeds, limits) = (values("HR_SPEED"), values("HR_VMAX"));
    assert!(
        speeds.iter().any(|mps| (0.4..0.5).contains(mps)) && speeds.iter().any(|mps| *mps < -0.15),
        "{speeds:?}"
    );
    assert!(limits.iter().any(|mps| (0.2..0.35).contains(mps)), "{limits:?}");
    assert!(values("HR_MISS_M").iter().any(|m| *m > 2.0));
    // STATUSTEXT messages with the parts of a long text have the same id. The test joins these parts.
    let mut texts: BTreeMap<(usize, u16), String> = BTreeMap::new();
    for (place, said) in of(253).enumerate() {
        let id = u16::from_le_bytes([said.payload[51], said.payload[52]]);
        let key = if id == 0 { (place, 0) } else { (0, id) };
        texts.entry(key).or_default().push_str(&text_of(&said.payload[1..51]));
    }
    let texts: Vec<String> = texts.into_values().collect();
    assert!(
        texts.iter().any(|text| text.starts_with("MISSED 0+005") && text.contains("inspect again from")),
        "{texts:#?}"
    );
    let different: BTreeSet<&String> = texts.iter().collect();
    assert_eq!(different.len(), texts.len(), "said twice: {texts:#?}");
    assert_eq!(replay("too-fast", "127.0.0.1:9"), digest, "no program listens there");
}

#[test]
fn invalid_address_error_lists_the_valid_forms() {
    let folder = Folder::with_dive();
    for to in ["14550", "nowhere", "tcp:127.0.0.1:5760"] {
        let answer = folder.headrace(&["replay", "dive.mcap", "--mavlink-out", to]);
        assert_eq!(answer.code, Some(2), "{to}: {}", answer.stderr);
        assert!(answer.stderr.contains("expected HOST:PORT"), "{}", answer.stderr);
    }
    let answer = folder.headrace(&["replay", "dive.mcap", "--foxglove", "0.0.0.0:8765"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    let why = if cfg!(feature = "foxglove") { "without a token" } else { "built without it" };
    assert!(answer.stderr.contains(why), "{}", answer.stderr);
}
