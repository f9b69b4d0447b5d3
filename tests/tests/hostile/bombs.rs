//! Bombs: files whose claimed or unpacked size is far larger than the file.
//!
//! Every command that reads a bomb ends, takes less than 200 MiB, and reports the skipped parts.

use std::io::{Cursor, Read, Result, Seek, SeekFrom};

use headrace_replay::log::{DiveLog, LogReader};
use headrace_tests::{Folder, VEHICLE};

use crate::bomb_logs::{Bomb, all};
use crate::run::run;

/// Largest memory that a command may use for any log, MiB.
const MOST_MIB: u64 = 200;

#[test]
fn log_bombs_take_little_memory_and_are_reported() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    println!("| bomb | bytes | replay MiB | s | verify MiB | s | recover MiB | s |");
    let mut wrong = Vec::new();
    for Bomb { name, bytes, expected_text } in all() {
        folder.write("bomb.mcap", &bytes);
        let ran = [
            &["replay", "bomb.mcap", "--vehicle", "vehicle.toml"][..],
            &["verify", "bomb.mcap", "--vehicle", "vehicle.toml"],
            &["recover", "bomb.mcap", "-o", "recovered.mcap", "--force"],
        ]
        .map(|arguments| run(&folder, arguments));
        let cells = ran.each_ref().map(|ran| format!("{} | {:.2}", ran.most_mib, ran.took_s)).join(" | ");
        println!("| {name} | {} | {cells} |", bytes.len());
        if ran.iter().any(|ran| ran.most_mib >= MOST_MIB) {
            wrong.push(format!("{name}: over {MOST_MIB} MiB"));
        }
        let [replayed, _, recovered] = ran;
        if expected_text.is_empty() {
            continue;
        }
        for ran in [replayed, recovered] {
            let is_reported = expected_text.split('|').any(|words| ran.stdout.contains(words));
            // Some bombs skip only records that contain no packets of devices. Their replay ends with exit code 0.
            if (ran.code, is_reported) != (Some(3), true)
                && !(expected_text.contains("over 4096") && ran.code == Some(0))
            {
                let start: String = ran.stdout.chars().take(400).collect();
                wrong.push(format!("{name}: {:?} {start} {}", ran.code, ran.stderr));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A log in memory. It counts the bytes that are read from it.
struct Counted<'a> {
    log: Cursor<&'a [u8]>,
    read: u64,
}

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        let count = self.log.read(into)?;
        self.read += count as u64;
        Ok(count)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.log.seek(to)
    }
}

#[test]
fn bytes_read_of_a_bomb_are_proportional_to_its_length() {
    for Bomb { name, bytes, .. } in all() {
        let mut counted = Counted { log: Cursor::new(&bytes), read: 0 };
        let mut messages = 0_u64;
        let mut log = DiveLog::of(LogReader::new(&mut counted, name.to_owned()).unwrap());
        while log.next().unwrap().is_some() {
            messages += 1;
        }
        assert!(log.losses().len() <= 1200, "{name}: {} losses", log.losses().len());
        drop(log);
        let len = bytes.len() as u64;
        println!("{name}: {len} bytes, {} read, {messages} messages", counted.read);
        // The limit is larger than the log, because the reader fills its buffer again after each seek, and so reads
        // some bytes several times.
        assert!(counted.read <= (1 << 20) + 16 * len, "{name}: {} of {len}", counted.read);
        assert!(messages <= len / 31 + 100, "{name}: {messages} of {len} bytes");
    }
}
