//! Odd logs. Every deviation is reported together with its treatment, and nothing is accepted silently.

use std::fs::File;

use headrace_tests::{Answer, Folder, VEHICLE, raw_messages, write_log};
use mcap::WriteOptions;

const WITH_VEHICLE: [&str; 2] = ["--vehicle", "vehicle.toml"];
/// UTC time at which the tests' clock is 0, ns since 1970. It is in autumn 2026.
const UTC_OF_OUR_ZERO_NS: u64 = 1_790_000_000_000_000_000;

fn replay(folder: &Folder, log: &str) -> Answer {
    folder.headrace(&[&["replay", log], &WITH_VEHICLE[..]].concat())
}

/// Lines of a replay's output that state losses ("LOST") or are notes about the log.
fn loss_lines(answer: &Answer) -> String {
    let odd = answer.stdout.lines().filter(|line| line.contains("LOST") || line.contains("note"));
    odd.fold(String::new(), |all, line| all + line.trim() + "\n")
}

#[test]
fn messages_of_another_clock_are_skipped_and_reported() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in &mut messages {
        if message.channel.topic == "/raw/depth" {
            message.log_time += UTC_OF_OUR_ZERO_NS;
        }
    }
    write_log(&folder.path("mixed.mcap"), WriteOptions::new(), None, &messages);
    let answer = replay(&folder, "mixed.mcap");
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    insta::assert_snapshot!(loss_lines(&answer), @r#"LOST: 406 messages of source "depth" left out: their timestamps are 56.8 years after those of most messages"#);

    // The majority of messages decides which clock is right. The result is therefore the same if the messages with
    // times of the wrong clock come first.
    for message in &mut messages {
        message.log_time = match message.channel.topic.as_str() {
            "/raw/depth" => message.log_time - UTC_OF_OUR_ZERO_NS,
            _ => message.log_time + UTC_OF_OUR_ZERO_NS,
        };
    }
    write_log(&folder.path("mixed.mcap"), WriteOptions::new(), None, &messages);
    let answer = replay(&folder, "mixed.mcap");
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    insta::assert_snapshot!(loss_lines(&answer), @r#"LOST: 406 messages of source "depth" left out: their timestamps are 56.8 years before those of most messages"#);
}

#[test]
fn topic_on_two_channels_is_reported() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in messages.iter_mut().skip(1).step_by(2) {
        let mut channel = (*message.channel).clone();
        channel.id += 100;
        channel.metadata = [("recorder".to_owned(), "started again".to_owned())].into();
        message.channel = channel.into();
    }
    messages.retain(|message| message.channel.topic == "/raw/sonar_0" || message.channel.id < 100);
    write_log(&folder.path("doubled.mcap"), WriteOptions::new(), None, &messages);
    let answer = replay(&folder, "doubled.mcap");
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    insta::assert_snapshot!(loss_lines(&answer), @r#"note: channels 1, 101 are all called "/raw/sonar_0": read as one"#);
}

#[test]
fn messages_too_late_to_be_ordered_are_counted() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let options = WriteOptions::new().chunk_size(Some(20_000));
    write_log(&folder.path("lying.mcap"), options, None, &raw_messages(&dive));
    let mut bytes = folder.read("lying.mcap");
    let chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    let (one, later) = (&chunks[chunks.len() / 2], &chunks[chunks.len() / 2 + 2]);
    // Changes the start time in the chunk's header to a time later than the true one.
    let place = usize::try_from(one.chunk_start_offset).unwrap() + 9;
    bytes[place..][..8].copy_from_slice(&later.message_start_time.to_le_bytes());
    bytes[place + 8..][..8].copy_from_slice(&later.message_end_time.to_le_bytes());
    folder.write("lying.mcap", bytes);
    let answer = replay(&folder, "lying.mcap");
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    insta::assert_snapshot!(loss_lines(&answer), @"LOST: 419 messages too far out of order to be sorted, delivered in file order");
}

#[test]
fn attached_vehicle_file_with_an_unknown_plugin_is_refused() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let vehicle = VEHICLE.replace("plugin = \"bar100\"", "plugin = \"bar300\"");
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), Some(&vehicle), &raw_messages(&dive));
    let answer = folder.headrace(&["replay", "foreign.mcap"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    insta::assert_snapshot!(answer.stderr, @r#"headrace: foreign.mcap/vehicle.toml:51: sensors[6].plugin = "bar300": must be one of imagenex881, ping1d, bar100, imu_can, tether_hid, mavlink, a50; did you mean "bar100"?"#);
    // If another vehicle file is given, the log can be read although its channels name an unknown plugin.
    assert_eq!(replay(&folder, "foreign.mcap").code, Some(0));
}

#[test]
fn replay_refuses_a_log_format_newer_than_this_program() {
    let folder = Folder::with_dive();
    let mut writer = mcap::Writer::new(File::create(folder.path("later.mcap")).unwrap()).unwrap();
    // Digest of the words "headrace", "format" and "2", with each word's length before it.
    let digest = "5f4cd66e8dd4654ec3c05024c8cca16d3efe0230a90901805f639cd21db7270c";
    let metadata = [("format", "2"), ("sha256", digest)].map(|(k, v)| (k.to_owned(), v.to_owned()));
    let record = mcap::records::Metadata { name: "headrace".to_owned(), metadata: metadata.into() };
    writer.write_metadata(&record).unwrap();
    writer.finish().unwrap();
    let answer = replay(&folder, "later.mcap");
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    insta::assert_snapshot!(answer.stderr, @"headrace: later.mcap is a log of format 2; this program reads formats up to 1");
}
