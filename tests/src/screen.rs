//! The program under test on a pseudoterminal, with simulated key presses.

use std::cell::RefCell;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::num::NonZero;
use std::os::fd::OwnedFd;
use std::process::Child;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use rustix::fs::{Mode, OFlags};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

use crate::folder::{Folder, program};

/// Longest wait for expected output, as a number of steps of `STEP`.
const STEPS: u32 = 1200;
const STEP: Duration = Duration::from_millis(100);

/// The running program under test and its terminal.
pub struct Screen {
    child: Child,
    keys: File,
    coming: Receiver<Vec<u8>>,
    seen: RefCell<Vec<u8>>,
    /// Size of the terminal in columns and lines.
    size: (u16, u16),
}

impl Screen {
    /// Runs the program in a folder on a terminal of `columns` columns. The program gets `TERM=xterm` and the
    /// environment variables `variables`.
    pub fn run(folder: &Folder, arguments: &[&str], columns: u16, variables: &[(&str, &str)]) -> Self {
        Self::sized(folder, arguments, (columns, 24), variables)
    }

    /// As [`Screen::run`], with both columns and lines given.
    pub fn sized(
        folder: &Folder,
        arguments: &[&str],
        (columns, lines): (u16, u16),
        variables: &[(&str, &str)],
    ) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap();
        let end = || rustix::fs::open(&*path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
        tcsetwinsize(&master, Winsize { ws_row: lines, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 })
            .unwrap();
        let mut command = program();
        command.args(arguments).current_dir(folder.path("")).env_remove("NO_COLOR").env("TERM", "xterm");
        command.envs(variables.iter().copied());
        command.stdin(end()).stdout(end()).stderr(end());
        let child = command.spawn().unwrap();
        // The `Command` value must be dropped, because it keeps the terminal open even after the program's end.
        drop(command);
        let mut reading = clone(&master);
        let (to, coming) = channel();
        thread::spawn(move || {
            let mut bytes = [0; 4096];
            // On Linux, reading fails once no process has the terminal open, which ends this loop.
            while let Ok(count @ 1..) = reading.read(&mut bytes) {
                if to.send(bytes[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        Self { child, keys: File::from(master), coming, seen: RefCell::default(), size: (lines, columns) }
    }

    /// All output of the program so far, including escape sequences.
    pub fn shown(&self) -> String {
        let mut seen = self.seen.borrow_mut();
        seen.extend(self.coming.try_iter().flatten());
        String::from_utf8_lossy(&seen).into_owned()
    }

    /// Waits until the program prints a text; returns the output up to this text.
    #[track_caller]
    pub fn until(&self, text: &str) -> String {
        for _ in 0..STEPS {
            let shown = self.shown();
            if shown.contains(text) {
                return shown;
            }
            thread::sleep(STEP);
        }
        panic!("{text:?} doesn't appear: {:?}", self.shown());
    }

    /// The terminal's present content, as a separate terminal emulator interprets it.
    pub fn terminal(&self) -> vt100::Parser {
        self.shown();
        let [lines, columns] = [self.size.0, self.size.1].map(|size| NonZero::new(size).unwrap());
        let mut terminal = vt100::Parser::new(lines, columns, 0);
        terminal.process(&self.seen.borrow());
        terminal
    }

    /// The page as text. Trailing spaces are removed, because the program may leave them out.
    pub fn page(&self) -> String {
        let page = self.terminal().screen().contents();
        page.lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
    }

    /// Waits until the page contains a text and has stopped changing. Returns the page.
    #[track_caller]
    pub fn until_page(&self, text: &str) -> String {
        let mut before = String::new();
        for _ in 0..STEPS {
            let page = self.page();
            if page.contains(text) && page == before {
                return page;
            }
            before = page;
            thread::sleep(STEP);
        }
        panic!("{text:?} doesn't appear: {before}");
    }

    /// Changes the terminal's size to these columns and lines.
    pub fn resize(&mut self, (columns, lines): (u16, u16)) {
        self.size = (lines, columns);
        tcsetwinsize(&self.keys, Winsize { ws_row: lines, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 })
            .unwrap();
    }

    /// Sends key presses to the program.
    pub fn press(&mut self, keys: &[u8]) {
        self.keys.write_all(keys).unwrap();
    }

    /// Sends the program a signal.
    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Whether the terminal is in echo and line mode, as a shell leaves it.
    pub fn is_in_order(&self) -> bool {
        use rustix::termios::{LocalModes, tcgetattr};
        let all = LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG;
        tcgetattr(&self.keys).unwrap().local_modes.contains(all)
    }

    /// Waits for the program's end; returns exit code and all output.
    #[track_caller]
    pub fn end(&mut self) -> (Option<i32>, String) {
        for _ in 0..STEPS {
            if let Some(status) = self.child.try_wait().unwrap() {
                // The program's last output may not have arrived yet.
                thread::sleep(STEP);
                return (status.code(), self.shown());
            }
            thread::sleep(STEP);
        }
        panic!("the program doesn't end: {:?}", self.shown());
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // Killing fails if the process has already ended.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

fn clone(master: &OwnedFd) -> File {
    File::from(master.try_clone().unwrap())
}
