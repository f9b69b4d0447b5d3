//! Single keys of a terminal as commands of playback.

use crossbeam::channel::Sender;
use headrace_geometry::time::DurNs;
use headrace_replay::playback::PlaybackCommand;

use crate::cli::KEYS;
use crate::failure::Failure;
use crate::keyboard::{INTERRUPT, Keyboard};
use crate::output::aside;

/// Length of a jump in time by the left or right arrow key. `FAR` is the length by the up or down arrow key.
const STEP: DurNs = DurNs::from_millis(10_000);
const FAR: DurNs = DurNs::from_millis(60_000);
/// Slowest speed of playback, relative to real time. `FASTEST` is the fastest speed; the next faster one is unlimited.
const SLOWEST: f64 = 0.125;
const FASTEST: f64 = 1024.0;

/// A key that controls playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    Space,
    Left,
    Right,
    Up,
    Down,
    Faster,
    Slower,
    Tick,
    Leave,
    Help,
}

/// Reads the terminal's keys until the returned value is dropped, and sends their commands to `to`. `speed` is the
/// present playback speed.
///
/// Errors: the terminal's settings can't be read or changed.
pub(super) fn listen(to: Sender<PlaybackCommand>, speed: Option<f64>) -> Result<Keyboard, Failure> {
    let mut hand = Hand::new(speed, aside);
    let keyboard = Keyboard::listen(move |bytes| {
        let mut commands = keys(bytes).into_iter().filter_map(|key| hand.command(key));
        commands.all(|command| to.send(command).is_ok() && command != PlaybackCommand::End)
    })?;
    aside(&format!("KEYS     {KEYS}"));
    Ok(keyboard)
}

/// Playback speed and pause as set by the keys.
pub(crate) struct Hand {
    speed: Option<f64>,
    paused: bool,
    /// Function that shows the answer to a key.
    say: fn(&str),
}

impl Hand {
    pub(crate) fn new(speed: Option<f64>, say: fn(&str)) -> Self {
        Self { speed, paused: false, say }
    }

    /// Speed of playback; `None` if unlimited.
    pub(crate) fn speed(&self) -> Option<f64> {
        self.speed
    }

    /// Whether the keys have paused playback.
    pub(crate) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Command for a key, if the key has one.
    pub(crate) fn command(&mut self, key: Key) -> Option<PlaybackCommand> {
        Some(match key {
            Key::Space => {
                self.paused = !self.paused;
                if self.paused { PlaybackCommand::Pause } else { PlaybackCommand::Go }
            }
            Key::Left => PlaybackCommand::Skip(DurNs(-STEP.0)),
            Key::Right => PlaybackCommand::Skip(STEP),
            Key::Down => PlaybackCommand::Skip(DurNs(-FAR.0)),
            Key::Up => PlaybackCommand::Skip(FAR),
            Key::Faster => self.go_at(self.speed.map(|speed| speed * 2.0).filter(|speed| *speed <= FASTEST)),
            Key::Slower => self.go_at(Some(self.speed.map_or(FASTEST, |speed| (speed / 2.0).max(SLOWEST)))),
            Key::Tick => {
                self.paused = true;
                PlaybackCommand::Step(1)
            }
            Key::Leave => PlaybackCommand::End,
            Key::Help => {
                (self.say)(&format!("KEYS     {KEYS}"));
                return None;
            }
        })
    }

    fn go_at(&mut self, speed: Option<f64>) -> PlaybackCommand {
        self.speed = speed;
        (self.say)(&speed.map_or_else(|| "SPEED    max".to_owned(), |speed| format!("SPEED    {speed}x")));
        PlaybackCommand::Speed(speed)
    }
}

/// Keys that some bytes represent. Unknown keys are ignored. A terminal sends all bytes of a key at once.
fn keys(mut bytes: &[u8]) -> Vec<Key> {
    let arrows = [(b'A', Key::Up), (b'B', Key::Down), (b'C', Key::Right), (b'D', Key::Left)];
    let mut keys = Vec::new();
    while let [first, rest @ ..] = bytes {
        bytes = rest;
        match (first, rest) {
            (0x1b, [b'[' | b'O', code, after @ ..]) => {
                keys.extend(arrows.iter().find(|(arrow, _)| arrow == code).map(|(_, key)| *key));
                bytes = after;
            }
            (b' ', _) => keys.push(Key::Space),
            (b'+' | b'=', _) => keys.push(Key::Faster),
            (b'-' | b'_', _) => keys.push(Key::Slower),
            (b'.', _) => keys.push(Key::Tick),
            // Ctrl-C and Ctrl-D also end playback.
            (b'q' | b'Q' | &INTERRUPT | 0x04, _) => keys.push(Key::Leave),
            (b'?' | b'h', _) => keys.push(Key::Help),
            _ => {}
        }
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_a_terminal_are_decoded_to_playback_keys() {
        assert_eq!(
            keys(b" \x1b[D\x1bOC\x1b[A\x1b[B+-.?"),
            [
                Key::Space,
                Key::Left,
                Key::Right,
                Key::Up,
                Key::Down,
                Key::Faster,
                Key::Slower,
                Key::Tick,
                Key::Help
            ]
        );
        assert_eq!([keys(b"q"), keys(b"\x03"), keys(b"\x04")], [[Key::Leave]; 3]);
        assert_eq!(keys(b"end\n\x1b\x1b[Z"), []);
    }

    #[test]
    fn keys_give_their_playback_commands() {
        let mut hand = Hand::new(None, |_| {});
        let mut press = |key| hand.command(key).unwrap();
        assert_eq!(press(Key::Space), PlaybackCommand::Pause);
        assert_eq!(press(Key::Space), PlaybackCommand::Go);
        assert_eq!(press(Key::Left), PlaybackCommand::Skip(DurNs(-10_000_000_000)));
        assert_eq!(press(Key::Slower), PlaybackCommand::Speed(Some(1024.0)));
        assert_eq!(press(Key::Slower), PlaybackCommand::Speed(Some(512.0)));
        assert_eq!(press(Key::Faster), PlaybackCommand::Speed(Some(1024.0)));
        assert_eq!(press(Key::Faster), PlaybackCommand::Speed(None));
        assert_eq!(press(Key::Tick), PlaybackCommand::Step(1));
        assert_eq!(press(Key::Space), PlaybackCommand::Go, "a single tick pauses playback");
    }
}
