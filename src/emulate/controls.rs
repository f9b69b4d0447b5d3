//! Controls of a rehearsal: keys of a terminal, or lines on standard input.

use std::io::{BufRead as _, IsTerminal as _};

use crossbeam::channel::{Receiver, Sender, unbounded};
use headrace_geometry::time::DurNs;

use crate::cli::{FAULT_COMMANDS, FAULT_KEYS, time};
use crate::failure::Failure;
use crate::keyboard::{self, Keyboard};
use crate::output::say;

/// Longest delay of data. Later data would no longer belong to the rehearsal.
const MAX_DELAY: DurNs = DurNs(60_000_000_000);

/// Input from the person who runs the rehearsal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Input {
    /// Bytes of typed keys.
    Keys(Vec<u8>),
    /// A line with a command.
    Line(String),
}

/// A change of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    Unplug,
    Plug,
    /// The device neither hears nor answers.
    Stall,
    Resume,
    /// The device's data arrive late by this duration.
    Delay(DurNs),
    /// The device is switched off and on.
    Restart,
}

/// A command of the rehearsal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Changes the device with this number.
    Device(usize, Change),
    /// Freezes the cable counters, or releases them.
    Freeze(bool),
    /// Holds back the data of all devices for this duration, and then sends them at once, as after a stall of the
    /// computer.
    Hold(DurNs),
    End,
}

/// Reads keys or lines on a separate thread, and shows the list of them. Dropping the returned `Keyboard` releases the
/// keys.
///
/// Errors: the terminal's settings can't be changed.
pub(super) fn listen() -> Result<(Receiver<Input>, Option<Keyboard>), Failure> {
    let (sender, inputs) = unbounded();
    if keyboard::is_ours() {
        let keyboard = Keyboard::listen(move |bytes| {
            bytes.is_empty() || sender.send(Input::Keys(bytes.to_vec())).is_ok()
        })?;
        say_keys();
        return Ok((inputs, Some(keyboard)));
    }
    // The system would stop a background job that reads its terminal.
    if !std::io::stdin().is_terminal() {
        say(&format!("commands by lines on standard input: {FAULT_COMMANDS}"));
        read_lines(sender);
    }
    Ok((inputs, None))
}

/// Shows the keys.
pub(super) fn say_keys() {
    say(&format!("KEYS     {FAULT_KEYS}"));
}

fn read_lines(to: Sender<Input>) {
    std::thread::spawn(move || {
        let lines = std::io::stdin().lock().lines().map_while(Result::ok);
        for line in lines {
            if to.send(Input::Line(line)).is_err() {
                return;
            }
        }
    });
}

/// Parses a command. `ids` are the ids of the devices, in the order of their numbers.
pub(super) fn order(line: &str, ids: &[&str]) -> Result<Order, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let device = |id: &str| {
        let number = ids.iter().position(|known| *known == id);
        number.ok_or_else(|| {
            format!("{:?}: no device {id:?}; expected one of: {}", line.trim(), ids.join(", "))
        })
    };
    let duration = |text: &str| match time(text)? {
        duration if duration > MAX_DELAY => Err(format!("{:?}: a delay must be at most 60s", line.trim())),
        duration => Ok(duration),
    };
    let change = match *words.as_slice() {
        ["end" | "quit"] => return Ok(Order::End),
        ["freeze"] => return Ok(Order::Freeze(true)),
        ["release"] => return Ok(Order::Freeze(false)),
        ["hold", text] => return duration(text).map(Order::Hold),
        ["unplug", id] => (id, Change::Unplug),
        ["plug", id] => (id, Change::Plug),
        ["stall", id] => (id, Change::Stall),
        ["resume", id] => (id, Change::Resume),
        ["restart", id] => (id, Change::Restart),
        ["delay", id, text] => (id, Change::Delay(duration(text)?)),
        _ => return Err(format!("{:?} isn't a command; expected one of: {FAULT_COMMANDS}", line.trim())),
    };
    Ok(Order::Device(device(change.0)?, change.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rehearsal_commands_are_parsed_and_errors_list_the_allowed_values() {
        let order = |line| order(line, &["imu", "tether"]);
        assert_eq!(order(" unplug tether "), Ok(Order::Device(1, Change::Unplug)));
        assert_eq!(order("delay imu 0.5s"), Ok(Order::Device(0, Change::Delay(DurNs(500_000_000)))));
        assert_eq!(order("freeze"), Ok(Order::Freeze(true)));
        assert_eq!(order("hold 1.3s"), Ok(Order::Hold(DurNs(1_300_000_000))));
        assert_eq!(order("quit"), Ok(Order::End));
        for line in [
            "",
            "stall",
            "stall imu tether",
            "delay imu",
            "delay imu 61s",
            "delay imu soon",
            "freeze imu",
            "hold",
            "hold 61s",
        ] {
            assert!(order(line).is_err(), "{line:?}");
        }
        insta::assert_snapshot!(order("plug dvl").unwrap_err(), @r#""plug dvl": no device "dvl"; expected one of: imu, tether"#);
    }
}
