//! The renderer's thread receives frames and keys. When it has drawn a frame, it requests the next one.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, RecvTimeoutError};
use headrace_geometry::time::DurNs;
use headrace_monitor::console::MAX_NOTE_BYTES;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::alerts::Desk;
use super::draw::{Page, Playing};
use super::keys::Key;
use super::message::Message;
use super::mode::Mode;
use super::screen_buffer::Palette;
use super::terminal_guard::{self, TerminalGuard};
use crate::logging;
use crate::play::{Hand, Key as PlaybackKey};

/// Minimum interval between two draws of the screen.
const EVERY: Duration = Duration::from_millis(100);
/// Time without a new frame after which a live dive's screen is shown as stale. It equals the constant `OLD_AFTER` of
/// the live state.
const OLD_AFTER: Duration = Duration::from_secs(2);

/// Draws frames and handles keys.
pub(super) struct Renderer {
    hold: TerminalGuard,
    desk: Desk,
    page: Page,
    hand: Option<Hand>,
    /// Sender of playback commands.
    commands: Option<crossbeam::channel::Sender<headrace_replay::playback::PlaybackCommand>>,
    is_live: bool,
    wanted: Arc<AtomicBool>,
    keys_end: Arc<AtomicBool>,
    /// Time at which the last frame arrived.
    came: Option<Instant>,
}

type Screen = Terminal<CrosstermBackend<BufWriter<File>>>;

impl Renderer {
    pub(super) fn new(
        hold: TerminalGuard,
        mode: Mode,
        desk: Desk,
        wanted: Arc<AtomicBool>,
        keys_end: Arc<AtomicBool>,
    ) -> Self {
        let is_live = matches!(mode, Mode::Live);
        let name = match mode {
            Mode::Live => "LIVE",
            Mode::Demo => "SIMULATED",
            Mode::Source | Mode::Replay(..) => "REPLAY",
        };
        let (commands, hand) = match mode {
            Mode::Replay(commands, speed) => (Some(commands), Some(Hand::new(speed, |_| {}))),
            _ => (None, None),
        };
        let page = Page::new(name, Palette::of_stdout());
        Self { hold, desk, page, hand, commands, is_live, wanted, keys_end, came: None }
    }

    /// Draws until the end of the dive, then releases the terminal.
    pub(super) fn draw_until_the_end(mut self, messages: &Receiver<Message>) {
        let mut screen: Option<(Screen, (u16, u16))> = None;
        let mut drawn: Option<Instant> = None;
        while !terminal_guard::is_leaving() {
            let waiting = drawn.map_or(Duration::ZERO, |drawn| EVERY.saturating_sub(drawn.elapsed()));
            match messages.recv_timeout(waiting) {
                Ok(Message::End) | Err(RecvTimeoutError::Disconnected) => break,
                // A key is handled and its effect drawn at once, so that the operator sees it without delay.
                Ok(Message::Key(key)) => {
                    self.key(key);
                    drawn = None;
                    continue;
                }
                Ok(message) => {
                    self.take(message);
                    continue;
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            self.refresh();
            // After an error the terminal is tried again at the next draw.
            if let Err(error) = self.draw(&mut screen) {
                tracing::debug!(%error, "the screen isn't drawn");
                screen = None;
            }
            drawn = Some(now());
            self.wanted.store(true, Ordering::Relaxed);
        }
        self.keys_end.store(true, Ordering::Relaxed);
        drop(screen);
        terminal_guard::restore();
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::ScreenFrame(shot) => {
                self.page.take(*shot);
                self.came = Some(now());
            }
            Message::Interrupted => {
                self.page.say("ending the dive; Ctrl-C again ends the program at once, without a report");
                if let Some(commands) = &self.commands {
                    commands.send(headrace_replay::playback::PlaybackCommand::End).ok();
                }
            }
            Message::Key(_) | Message::End => {}
        }
    }

    fn refresh(&mut self) {
        while let Some(line) = logging::next_held() {
            self.page.log(line);
        }
        let late = self.came.map(|came| came.elapsed()).filter(|late| self.is_live && *late > OLD_AFTER);
        self.page.late = late.map(|late| DurNs::from_secs_f64(late.as_secs_f64()));
        self.page.playing =
            self.hand.as_ref().map(|hand| Playing { speed: hand.speed(), paused: hand.is_paused() });
    }

    fn draw(&mut self, screen: &mut Option<(Screen, (u16, u16))>) -> std::io::Result<()> {
        let size = self.hold.size();
        if screen.as_ref().is_none_or(|(_, before)| *before != size) {
            let mut out = self.hold.out()?;
            out.write_all(b"\x1b[0m\x1b[2J")?;
            let viewport = Viewport::Fixed(Rect::new(0, 0, size.0, size.1));
            let backend = CrosstermBackend::new(BufWriter::with_capacity(1 << 16, out));
            *screen = Some((Terminal::with_options(backend, TerminalOptions { viewport })?, size));
        }
        if let Some((screen, _)) = screen {
            screen.draw(|frame| self.page.draw(frame.buffer_mut()))?;
        }
        Ok(())
    }

    fn key(&mut self, key: Key) {
        if self.page.note.is_some() {
            return self.write(key);
        }
        if let (Some(hand), Some(key)) = (&mut self.hand, key.of_playback()) {
            if key == PlaybackKey::Leave {
                self.page.say("leaving");
            }
            if let (Some(command), Some(commands)) = (hand.command(key), &self.commands) {
                commands.send(command).ok();
            }
            return;
        }
        self.page.clear_said();
        match key {
            Key::Character('?' | 'h') => self.page.help = !self.page.help,
            Key::Escape | Key::Enter => self.page.help = false,
            Key::Character('a') => {
                let first = self.page.shot.as_ref().and_then(|shot| {
                    shot.alerts.iter().find(|alert| alert.needs_acknowledgement).map(|alert| alert.number)
                });
                let said =
                    first.map_or("nothing to acknowledge".to_owned(), |number| self.desk.acknowledge(number));
                self.page.say(said);
            }
            Key::Character('A') => self.page.say(self.desk.acknowledge(0)),
            Key::Character('s') => self.page.say(self.desk.silence()),
            Key::Character('n') if self.desk.is_open() => self.page.note = Some(String::new()),
            Key::Character('n') => self.page.say(self.desk.note("")),
            Key::Character('w') => self.page.extent = self.page.extent.next(),
            Key::Character('q') => self.page.say("Ctrl-C ends the dive"),
            _ => {}
        }
    }

    /// Handles a key while a note is being written.
    fn write(&mut self, key: Key) {
        let Some(note) = &mut self.page.note else { return };
        match key {
            Key::Character(letter)
                if !letter.is_control() && note.len() + letter.len_utf8() <= MAX_NOTE_BYTES =>
            {
                note.push(letter);
            }
            Key::Backspace => drop(note.pop()),
            Key::Enter => {
                let said = self.desk.note(note);
                self.page.note = None;
                self.page.say(said);
            }
            Key::Escape => self.page.note = None,
            _ => {}
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "when the screen is drawn; no result depends on it")]
fn now() -> Instant {
    Instant::now()
}
