//! `--tui`: shows the dive on the whole screen of a terminal, for a session over ssh.
//!
//! The renderer's thread requests a frame, and the loop's thread passes it by value. In a live dive, the
//! loop's thread never waits for the terminal.

mod alerts;
mod draw;
mod frame;
pub(crate) mod keys;
mod listen;
mod message;
mod mode;
mod panels;
mod renderer;
mod screen_buffer;
mod terminal_guard;
mod wall;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::console::ConsolePort;
use headrace_monitor::live_messages::LiveMessage;
use headrace_monitor::live_state::Lamp;
use headrace_monitor::live_text::PilotLine;
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;
use headrace_ports::{Phase, Status};
use headrace_replay::log::RecordingEvent;

use crate::failure::Failure;
use crate::follower::Follower;
use crate::interrupt;
use crate::output::give_up;
use crate::recording_state::RecordingState;
use alerts::Desk;
use frame::FrameBuilder;
use message::Message;
pub(crate) use mode::Mode;
use mode::Stop;
use renderer::Renderer;
use terminal_guard::TerminalGuard;

/// Longest wait for the terminal at the end of a live dive.
const ENDS_WITHIN: Duration = Duration::from_secs(2);

/// Parameters of the screen.
pub(crate) struct Start<'a> {
    /// Name of the vehicle.
    pub(crate) vehicle: &'a str,
    /// First line among the screen's messages.
    pub(crate) first: Option<String>,
    pub(crate) mode: Mode,
    /// Flag that Ctrl-C sets.
    pub(crate) interrupted: Arc<AtomicBool>,
    /// Port for an operator's commands; `None` for a recorded dive.
    pub(crate) console: Option<ConsolePort>,
}

/// Follower that shows a dive on the whole terminal.
pub(crate) struct Tui {
    eye: FrameBuilder,
    wanted: Arc<AtomicBool>,
    sender: Option<Sender<Message>>,
    thread: Option<JoinHandle<()>>,
    /// Channel that is disconnected when the terminal has been restored.
    done: Receiver<()>,
    is_live: bool,
}

impl Tui {
    /// Prepares for a second Ctrl-C, which restores the terminal and ends the program at once.
    ///
    /// Call this function before the signal handlers are installed.
    ///
    /// Errors: stdin or stdout is not a terminal.
    pub(crate) fn prepare() -> Result<(), Failure> {
        terminal_guard::check()?;
        interrupt::leave_second_to_keys();
        Ok(())
    }

    /// Takes over the terminal, and starts the threads that draw and read keys.
    ///
    /// Errors: the terminal's settings can't be changed, or a thread can't be started.
    pub(crate) fn start(start: Start<'_>) -> Result<Self, Failure> {
        let failed = |source| Failure::System { what: "taking the terminal", source };
        let hold = TerminalGuard::take().map_err(failed)?;
        let (sender, messages) = bounded(64);
        let wanted = Arc::new(AtomicBool::new(true));
        let is_live = matches!(start.mode, Mode::Live);
        let ended = listen::listen(sender.clone(), Arc::clone(&start.interrupted)).map_err(failed)?;
        let renderer = Renderer::new(hold, start.mode, Desk::new(start.console), Arc::clone(&wanted), ended);
        let (drawing, done) = bounded(0);
        let draw = move || {
            renderer.draw_until_the_end(&messages);
            drop::<Sender<()>>(drawing);
        };
        let thread =
            thread::Builder::new().name(terminal_guard::ARTIST.to_owned()).spawn(draw).map_err(failed)?;
        let mut eye = FrameBuilder::new(start.vehicle);
        if let Some(first) = start.first {
            eye.tell(PilotLine { place: "BEGUN".to_owned(), what: vec![first], ..PilotLine::default() });
        }
        Ok(Self { eye, wanted, sender: Some(sender), thread: Some(thread), done, is_live })
    }

    /// Keys that the bytes stand for. A terminal sends all bytes of a key at once.
    fn show(&mut self, dive: &Loop, stopped: Option<Stop>) {
        let Some(sender) = &self.sender else { return };
        if self.is_live && sender.is_full() {
            return;
        }
        let shot = Message::ScreenFrame(Box::new(self.eye.shot(dive, stopped)));
        // If the renderer's thread has ended, nothing more is shown. The thread has logged the reason.
        let is_taken = if self.is_live { sender.try_send(shot).is_ok() } else { sender.send(shot).is_ok() };
        if !is_taken {
            self.eye.show_all_again();
        }
    }
}

impl Follower for Tui {
    fn messages(&mut self, messages: &[LiveMessage], dive: &Loop) {
        self.eye.messages(messages, dive);
    }

    fn notice(&mut self, notice: &Notice, _: &Loop) {
        self.eye.hear(notice);
    }

    fn tick(&mut self, dive: &Loop) {
        if self.wanted.swap(false, Ordering::Relaxed) {
            self.show(dive, None);
        }
    }

    fn sensor(&mut self, id: &str, status: &Status) {
        self.eye.sensor(status);
        let lamp = (status.phase != Phase::Running).then_some(Lamp::Amber);
        let what = vec![format!("{id} {status}")];
        self.eye.tell(PilotLine { place: "SENSOR".to_owned(), what, lamp, ..PilotLine::default() });
    }

    fn recorded(&mut self, state: &RecordingState) {
        self.eye.recorded(state);
    }

    fn recording(&mut self, event: &RecordingEvent, _: MonoNs) {
        let (words, fails) = (event.words(), event.fails());
        let lamp = Some(if fails { Lamp::Red } else { Lamp::Amber });
        self.eye.tell(PilotLine {
            place: "RECORDING".to_owned(),
            what: vec![words],
            lamp,
            ..PilotLine::default()
        });
    }

    fn rebuilt(&mut self, dive: &Loop) {
        self.eye.forget();
        self.show(dive, None);
    }

    fn stopped(&mut self, dive: &Loop, _: DurNs, ended: bool) {
        self.eye.forget();
        self.show(dive, Some(if ended { Stop::Ended } else { Stop::Paused }));
    }

    fn end(&mut self, _: &Loop) {
        self.close();
    }
}

impl Tui {
    /// Releases the terminal. In a live dive this takes at most [`ENDS_WITHIN`].
    fn close(&mut self) {
        let Some(sender) = self.sender.take() else { return };
        terminal_guard::leave();
        sender.try_send(Message::End).ok();
        drop(sender);
        let stuck = self.done.recv_timeout(ENDS_WITHIN) == Err(RecvTimeoutError::Timeout);
        if stuck {
            self.thread = None;
            give_up();
            terminal_guard::restore_settings();
        }
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the screen's thread has stopped early");
        }
        crate::logging::release();
        if stuck {
            tracing::warn!("the terminal doesn't read its input; it may keep showing the alternate screen");
        }
    }
}

impl Drop for Tui {
    fn drop(&mut self) {
        self.close();
    }
}
