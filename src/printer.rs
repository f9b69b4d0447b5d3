//! Writes a dive's lines to stdout on a separate thread, so that an unread terminal doesn't block a live
//! dive.

use std::thread::{self, JoinHandle};

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};

use crate::output::{UNREAD_FOR, give_up, put_waiting};
use crate::terminal;

/// Maximum number of lines in the queue for stdout. A dive has about one line a second, and a few for each
/// stretch.
const WAITING: usize = 1 << 10;

enum Message {
    Line(String),
    /// A line of state, which the next line overwrites.
    Status(String),
}

/// Writes lines to stdout in order, on a separate thread.
pub(crate) struct Printer {
    sender: Option<Sender<Message>>,
    thread: Option<JoinHandle<()>>,
    /// Channel that is disconnected when the thread has written all lines.
    done: Receiver<()>,
    /// Whether lines that find no room in the queue are dropped. Otherwise the caller waits.
    lossy: bool,
    dropped: u64,
}

impl Printer {
    /// Starts the thread. A `lossy` printer never makes its caller wait. It drops and counts lines that find no room in
    /// the queue.
    pub(crate) fn start(lossy: bool) -> Self {
        let (sender, messages) = bounded(WAITING);
        // If the thread can't be started, all lines are dropped, which is reported at the end of the dive.
        let (writing, done) = bounded(0);
        let write = move || {
            print(&messages);
            drop::<Sender<()>>(writing);
        };
        let thread = thread::Builder::new().name("terminal".to_owned()).spawn(write).ok();
        Self { sender: Some(sender), thread, done, lossy, dropped: 0 }
    }

    /// Makes the printer lossy: from now on no caller waits for the terminal.
    pub(crate) fn drop_rather_than_wait(&mut self) {
        self.lossy = true;
    }

    /// Writes a line of printable text.
    pub(crate) fn line(&mut self, text: String) {
        self.send(Message::Line(text));
    }

    /// Shows a line of state, which the next line overwrites.
    pub(crate) fn status(&mut self, text: String) {
        self.send(Message::Status(text));
    }

    fn send(&mut self, message: Message) {
        let Some(sender) = &self.sender else { return };
        let full = if self.lossy {
            matches!(sender.try_send(message), Err(TrySendError::Full(_)))
        } else {
            sender.send(message).is_err()
        };
        self.dropped += u64::from(full);
    }

    /// Waits until all lines are written. A lossy printer waits for at most [`UNREAD_FOR`].
    ///
    /// An unread terminal must not keep a dive from completing its log.
    pub(crate) fn end(&mut self) {
        drop(self.sender.take());
        let stuck = self.thread.is_some()
            && self.lossy
            && self.done.recv_timeout(UNREAD_FOR) == Err(RecvTimeoutError::Timeout);
        if stuck {
            self.thread = None;
            give_up();
            tracing::warn!("the terminal doesn't read its input; its last lines are dropped");
        }
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the terminal's thread has ended early");
        }
        if self.dropped > 0 {
            tracing::warn!(lines = self.dropped, "lines dropped: the terminal couldn't keep up");
            self.dropped = 0;
        }
    }
}

impl Drop for Printer {
    fn drop(&mut self) {
        self.end();
    }
}

fn print(messages: &Receiver<Message>) {
    let mut has_status = false;
    let close = |has_status: &mut bool| {
        // A log message may have cleared the status line already, so the flag is checked.
        if core::mem::take(has_status) && terminal::take_transient() {
            put_waiting(terminal::CLEAR);
        }
    };
    for message in messages {
        match message {
            Message::Line(text) => {
                close(&mut has_status);
                put_waiting(&format!("{text}\n"));
            }
            Message::Status(text) => {
                put_waiting(&format!("{}{text}", terminal::CLEAR));
                terminal::note_transient();
                has_status = true;
            }
        }
    }
    close(&mut has_status);
}
