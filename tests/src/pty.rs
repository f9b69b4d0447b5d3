//! A program on a pseudoterminal of a given width, and the program's output.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write as _};
use std::os::fd::AsRawFd as _;
use std::process::{Child, Command};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcgetwinsize, tcsetwinsize};

/// A terminal that nobody reads except the test.
pub struct Terminal {
    reader: File,
    end: File,
}

impl Terminal {
    /// Opens a terminal of 40 lines and `columns` columns.
    pub fn open(columns: u16) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let end = OpenOptions::new().read(true).write(true).open(name).unwrap();
        tcsetwinsize(&end, Winsize { ws_row: 40, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
        Self { reader: File::from(master), end }
    }

    /// The end of the pseudoterminal that the program uses.
    pub fn end(&self) -> File {
        self.end.try_clone().unwrap()
    }

    /// Reads until `text` arrives. Panics after a minute without output.
    pub fn read_until(&mut self, text: &str) {
        let (mut read, mut bytes) = (Vec::new(), [0; 4096]);
        while !String::from_utf8_lossy(&read).contains(text) {
            let mut waits = [PollFd::new(&self.reader, PollFlags::IN)];
            let within = Timespec { tv_sec: 60, tv_nsec: 0 };
            assert_eq!(poll(&mut waits, Some(&within)), Ok(1), "{}", String::from_utf8_lossy(&read));
            let count = self.reader.read(&mut bytes).unwrap();
            read.extend_from_slice(&bytes[..count]);
        }
    }

    /// Fills the terminal's buffer until it accepts no more bytes, so that later writes of the program block.
    pub fn fill(&self) {
        // The program's end of the terminal is opened again. Non-blocking mode belongs to one opening of a file, so the
        // program isn't affected.
        let name = format!("/proc/self/fd/{}", self.end.as_raw_fd());
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK;
        let mut end = File::from(rustix::fs::open(name, flags, Mode::empty()).unwrap());
        while end.write(b"x").is_ok() {}
    }
}

/// A program on a pseudoterminal, killed when it goes out of scope.
pub struct OnTerminal {
    child: Child,
    pieces: Receiver<Vec<u8>>,
    written: Vec<u8>,
}

impl OnTerminal {
    /// Starts a program on a terminal of `columns` columns.
    pub fn start(mut command: Command, columns: u16) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let slave = OpenOptions::new().read(true).write(true).open(name).unwrap();
        tcsetwinsize(&slave, Winsize { ws_row: 40, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
        assert_eq!(tcgetwinsize(&slave).unwrap().ws_col, columns);
        command.env("TERM", "xterm").env_remove("NO_COLOR");
        command.stdin(slave.try_clone().unwrap()).stderr(slave.try_clone().unwrap()).stdout(slave);
        let child = command.spawn().unwrap();
        // The `Command` value still holds copies of the program's end of the terminal, which would keep the terminal
        // open.
        drop(command);
        let (sender, pieces) = sync_channel(1 << 10);
        let mut master = File::from(master);
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            // Reading fails as soon as no process has the program's end open any more.
            while let Ok(read) = master.read(&mut bytes) {
                if read == 0 || sender.send(bytes[..read].to_vec()).is_err() {
                    return;
                }
            }
        });
        Self { child, pieces, written: Vec::new() }
    }

    /// Waits until the output contains `text` after index `from`. Returns the index after the text. Panics after a
    /// minute without output.
    pub fn wait_for(&mut self, text: &str, from: usize) -> usize {
        loop {
            let written = String::from_utf8_lossy(&self.written[from..]).into_owned();
            if let Some(at) = written.find(text) {
                return from + at + text.len();
            }
            match self.pieces.recv_timeout(Duration::from_mins(1)) {
                Ok(piece) => self.written.extend(piece),
                Err(why) => panic!("{text:?} wasn't written ({why}): {written}"),
            }
        }
    }

    /// Waits for the program's end; returns all output.
    pub fn all(mut self) -> String {
        while let Ok(piece) = self.pieces.recv_timeout(Duration::from_mins(2)) {
            self.written.extend(piece);
        }
        String::from_utf8_lossy(&self.written).into_owned()
    }

    /// All output of the program so far.
    pub fn so_far(&self) -> String {
        String::from_utf8_lossy(&self.written).into_owned()
    }

    /// Process id of the program.
    pub fn id(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for OnTerminal {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// The lines as displayed, without colours. An overwritten line appears once for each displayed version.
pub fn shown_lines(written: &str) -> Vec<String> {
    let mut plain = String::new();
    let mut rest = written;
    while let Some(at) = rest.find('\x1b') {
        plain.push_str(&rest[..at]);
        let end = rest[at..].find(|c: char| c.is_ascii_alphabetic()).map_or(rest.len(), |end| at + end + 1);
        rest = &rest[end..];
    }
    plain.push_str(rest);
    plain.split(['\n', '\r']).filter(|line| !line.is_empty()).map(str::to_owned).collect()
}
