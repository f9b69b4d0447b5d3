//! Logs from any MCAP writer replay to the same digest as the headrace log of the same dive.
//!
//! Such a log has only the devices' data on /raw/ channels, with any compression, chunk size and order of messages. It
//! has no vehicle file, no metadata, no ticks and no /sent/ channels.

use std::io::Write as _;
use std::process::{Command, Stdio};

use headrace_tests::{Folder, VEHICLE, raw_messages, write_log};
use mcap::{Compression, WriteOptions};

const WITH_VEHICLE: [&str; 2] = ["--vehicle", "vehicle.toml"];

/// A random integer from 0 to below `n`, from a Lehmer generator.
fn draw(state: &mut u64, n: usize) -> usize {
    *state = *state * 48_271 % 2_147_483_647;
    usize::try_from(*state).unwrap() % n
}

#[test]
fn storage_options_do_not_change_the_digest() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let messages = raw_messages(&dive);
    let plain = || WriteOptions::new().compression(None).profile("").library("somebody's recorder");
    for (name, options) in [
        ("unchunked", plain().use_chunks(false)),
        ("chunked, not compressed", plain()),
        ("lz4", plain().compression(Some(Compression::Lz4))),
        ("zstd", plain().compression(Some(Compression::Zstd))),
        ("many small chunks", plain().compression(Some(Compression::Zstd)).chunk_size(Some(1000))),
        ("without a summary", plain().emit_summary_records(false).emit_message_indexes(false)),
        ("without checksums", plain().calculate_chunk_crcs(false).calculate_data_section_crc(false)),
    ] {
        write_log(&folder.path("foreign.mcap"), options, None, &messages);
        assert_eq!(folder.digest("foreign.mcap", &WITH_VEHICLE), expected, "{name}");
    }
}

#[test]
fn unordered_messages_are_read_in_order_of_time() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    let check = |name: &str, messages: &[mcap::Message<'_>]| {
        for (how, options) in [
            ("unchunked", WriteOptions::new().use_chunks(false)),
            ("chunked", WriteOptions::new().chunk_size(Some(20_000))),
        ] {
            write_log(&folder.path("foreign.mcap"), options, None, messages);
            assert_eq!(folder.digest("foreign.mcap", &WITH_VEHICLE), expected, "{name}, {how}");
        }
    };

    messages.sort_by_key(|message| (message.channel.id, message.log_time, message.sequence));
    check("a channel after the other", &messages);

    messages.reverse();
    check("last first", &messages);

    let mut state = 20_260_101;
    for last in (1..messages.len()).rev() {
        messages.swap(last, draw(&mut state, last + 1));
    }
    check("shuffled", &messages);
}

#[test]
fn sequence_numbers_publish_times_and_channel_ids_do_not_change_the_digest() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in &mut messages {
        let mut channel = (*message.channel).clone();
        channel.id = 900 - channel.id;
        channel.metadata.clear();
        channel.message_encoding = String::new();
        message.channel = channel.into();
        message.sequence = 0;
        message.publish_time = 0;
    }
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), None, &messages);
    assert_eq!(folder.digest("foreign.mcap", &WITH_VEHICLE), expected);
}

#[test]
fn channels_without_device_data_are_skipped() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let mut messages = Vec::new();
    for message in raw_messages(&dive) {
        let mut channel = (*message.channel).clone();
        channel.id += 100;
        channel.topic = format!("/camera{}", channel.topic);
        messages.push(mcap::Message { channel: channel.into(), ..message.clone() });
        messages.push(message);
    }
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), None, &messages);
    assert_eq!(folder.digest("foreign.mcap", &WITH_VEHICLE), expected);
}

#[test]
fn topic_on_two_channels_is_one_source() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in messages.iter_mut().skip(1).step_by(2) {
        let mut channel = (*message.channel).clone();
        channel.id += 100;
        channel.metadata = [("recorder".to_owned(), "started again".to_owned())].into();
        message.channel = channel.into();
    }
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), None, &messages);
    assert_eq!(folder.digest("foreign.mcap", &WITH_VEHICLE), expected);
}

#[test]
fn clock_offset_does_not_change_the_sections() {
    const UTC_OF_OUR_ZERO_NS: u64 = 1_790_000_000_123_456_789;
    let folder = Folder::with_dive();
    let (_, expected) = folder.replay("dive.mcap", &[]);
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in &mut messages {
        message.log_time += UTC_OF_OUR_ZERO_NS;
        message.publish_time = message.log_time;
    }
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), None, &messages);
    let (code, report) = folder.replay("foreign.mcap", &WITH_VEHICLE);
    assert_eq!(code, Some(0));
    assert_eq!(report["summary"], expected["summary"]);
    for (got, wanted) in
        report["sections"].as_array().unwrap().iter().zip(expected["sections"].as_array().unwrap())
    {
        for key in ["start_m", "hole_m", "hole_clock", "t_x", "t_y", "samples", "verdict"] {
            assert_eq!(got[key], wanted[key], "{key}");
        }
        assert_eq!(got["cause"]["cause"], wanted["cause"]["cause"]);
    }
}

/// Copies the devices' messages with Python's `mcap` package, which reads them in time order.
const COPY: &str = r#"
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

for name, compression in [("lz4", CompressionType.LZ4), ("zstd", CompressionType.ZSTD), ("none", CompressionType.NONE)]:
    with open("dive.mcap", "rb") as source, open(f"python-{name}.mcap", "wb") as target:
        writer = Writer(target, chunk_size=50_000, compression=compression)
        writer.start()
        channels = {}
        for _, channel, message in make_reader(source).iter_messages():
            if not channel.topic.startswith("/raw/"):
                continue
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(channel.topic, "application/octet-stream", 0)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()
"#;

#[test]
fn log_copied_with_python_has_the_same_digest() {
    let folder = Folder::with_dive();
    let python = |arguments: &[&str], input: &str| {
        let mut child = Command::new("python3")
            .args(arguments)
            .current_dir(folder.path(""))
            .stdin(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .ok()?;
        child.stdin.take().unwrap().write_all(input.as_bytes()).ok()?;
        Some(child.wait().unwrap().success())
    };
    if python(&["-"], "import importlib.util, sys; sys.exit(importlib.util.find_spec('mcap') is None)")
        != Some(true)
    {
        headrace_tests::skipped("python3 with the package mcap is not there");
        return;
    }
    assert_eq!(python(&["-"], COPY), Some(true), "copying with Python");
    let expected = folder.digest("dive.mcap", &[]);
    for name in ["lz4", "zstd", "none"] {
        let log = format!("python-{name}.mcap");
        assert_eq!(folder.digest(&log, &WITH_VEHICLE), expected, "{log}");
    }
}

#[test]
fn vehicle_file_attached_by_other_software_is_used() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    write_log(&folder.path("foreign.mcap"), WriteOptions::new(), Some(VEHICLE), &raw_messages(&dive));
    assert_eq!(folder.digest("foreign.mcap", &[]), folder.digest("dive.mcap", &[]));
}
