//! Reads the terminal's keys and counts the signals that end the program, on a separate thread.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crossbeam::channel::Sender;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::keys::{INTERRUPT, Key, keys};
use super::message::Message;
use super::terminal_guard;
use crate::interrupt::{self, Requests};

/// Longest wait for a key, so that the end of the dive is noticed.
const WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };

/// Sends keys until the returned flag is set.
///
/// Like SIGINT, Ctrl-C sets `interrupted`. A second Ctrl-C, over a second later, restores the terminal and
/// ends the program at once.
///
/// Errors: signals can't be counted, or the thread can't be started.
pub(super) fn listen(to: Sender<Message>, interrupted: Arc<AtomicBool>) -> io::Result<Arc<AtomicBool>> {
    let ended = Arc::new(AtomicBool::new(false));
    let until = Arc::clone(&ended);
    let signals = interrupt::seconds()?;
    let read = move || {
        let mut bytes = [0; 256];
        let (mut requests, mut is_sent) = (Requests::default(), false);
        while !until.load(Ordering::Relaxed) {
            if !is_sent && interrupted.load(Ordering::Relaxed) {
                is_sent = to.try_send(Message::Interrupted).is_ok();
            }
            let stdin = io::stdin();
            let mut waiting = [PollFd::new(&signals, PollFlags::IN), PollFd::new(&stdin, PollFlags::IN)];
            if !matches!(poll(&mut waiting, Some(&WAIT)), Ok(1..)) {
                continue;
            }
            let [by_signal, by_key] = waiting.map(|one| !one.revents().is_empty());
            if by_signal && rustix::io::read(&signals, &mut bytes).is_ok() && requests.is_second_now() {
                end_at_once();
            }
            if !by_key {
                continue;
            }
            match rustix::io::read(&stdin, &mut bytes) {
                // The terminal is closed, but the dive continues.
                Ok(0) | Err(rustix::io::Errno::IO) => return,
                Ok(count) => {
                    for key in keys(bytes.get(..count).unwrap_or_default()) {
                        if key != Key::Character(INTERRUPT) {
                            to.try_send(Message::Key(key)).ok();
                            continue;
                        }
                        if requests.is_second_now() {
                            end_at_once();
                        }
                        interrupted.store(true, Ordering::Relaxed);
                    }
                }
                Err(_) => {}
            }
        }
    };
    thread::Builder::new().name("keys".to_owned()).spawn(read)?;
    Ok(ended)
}

fn end_at_once() {
    terminal_guard::restore_from_elsewhere();
    crate::logging::release();
    std::process::exit(1);
}
