//! The terminal while it is taken: without lines and echo, on its second page, and back on every way out.

use std::fs::File;
use std::io::{self, IsTerminal as _, Write as _};
use std::os::fd::AsFd as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetwinsize, tcsetattr,
};

use crate::failure::Failure;
use crate::logging;

/// Name of the thread that draws.
pub(super) const ARTIST: &str = "screen";
/// To the second page, without a cursor.
const ENTER: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[2J";
/// Back to the first, as it was.
const LEAVE: &[u8] = b"\x1b[0m\x1b[?25h\x1b[?1049l";
/// Steps in which another thread waits for the one that draws to leave by itself.
const STEP: Duration = Duration::from_millis(25);
const STEPS: u32 = 20;

/// Settings before the terminal was taken.
static BEFORE: OnceLock<Termios> = OnceLock::new();
/// Whether the terminal is taken.
static TAKEN: AtomicBool = AtomicBool::new(false);
/// Whether it is to be given back.
static LEAVING: AtomicBool = AtomicBool::new(false);

/// The terminal that is drawn on. Writing goes past stdout's lock: a terminal that doesn't read holds up nobody else.
pub(super) struct Hold(File);

/// Errors: stdin or stdout is no terminal, or one without a second page.
pub(super) fn check() -> Result<(), Failure> {
    let able = crate::terminal::of(&io::stdout()).overwrites && io::stdin().is_terminal();
    let why = "--tui needs a terminal on stdin and stdout (and TERM other than dumb); over ssh: ssh -t";
    if able { Ok(()) } else { Err(Failure::Usage(why.to_owned())) }
}

impl Hold {
    /// Takes the terminal.
    pub(super) fn take() -> io::Result<Self> {
        let out = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        let before = tcgetattr(io::stdin())?;
        let mut raw = before.clone();
        // Ctrl-C, Ctrl-Z and Ctrl-\ are keys. Ctrl-S and Ctrl-Q go on to stop and start the terminal.
        raw.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG | LocalModes::IEXTEN);
        raw.special_codes[SpecialCodeIndex::VMIN] = 1;
        raw.special_codes[SpecialCodeIndex::VTIME] = 0;
        BEFORE.get_or_init(|| before);
        tcsetattr(io::stdin(), OptionalActions::Now, &raw)?;
        logging::hold();
        mind_panics();
        LEAVING.store(false, Ordering::Relaxed);
        TAKEN.store(true, Ordering::Relaxed);
        (&out).write_all(ENTER)?;
        Ok(Self(out))
    }

    /// What is written to.
    pub(super) fn out(&self) -> io::Result<File> {
        self.0.try_clone()
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> (u16, u16) {
        match tcgetwinsize(&self.0) {
            Ok(size) if size.ws_col > 0 && size.ws_row > 0 => (size.ws_col, size.ws_row),
            _ => (80, 24),
        }
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        restore();
    }
}

/// Asks the thread that draws to give the terminal back.
pub(super) fn leave() {
    LEAVING.store(true, Ordering::Relaxed);
}

/// Whether the terminal is to be given back.
pub(super) fn is_leaving() -> bool {
    LEAVING.load(Ordering::Relaxed)
}

/// Settings as they were: takes no time, whatever the terminal does.
pub(super) fn restore_settings() {
    if let Some(before) = BEFORE.get()
        && let Err(error) = tcsetattr(io::stdin(), OptionalActions::Now, before)
    {
        tracing::warn!(%error, "the terminal's settings could not be restored");
    }
}

/// The terminal as it was. Does nothing the second time.
pub(super) fn restore() {
    if TAKEN.swap(false, Ordering::Relaxed) {
        restore_settings();
        let mut out = io::stdout().lock();
        // A terminal that is gone needs nothing.
        out.write_all(LEAVE).and_then(|()| out.flush()).ok();
    }
}

/// The same from another thread than the one that draws, within half a second.
pub(super) fn restore_from_elsewhere() {
    leave();
    for _ in 0..STEPS {
        if !TAKEN.load(Ordering::Relaxed) {
            return;
        }
        thread::sleep(STEP);
    }
    restore_settings();
    // The terminal may not read: it is waited for no longer.
    let writing = thread::spawn(restore);
    for _ in 0..STEPS {
        if writing.is_finished() {
            return;
        }
        thread::sleep(STEP);
    }
}

/// A panic that ends the program leaves the terminal in order before it says why; one of another thread is a line on the screen.
fn mind_panics() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        match thread::current().name() {
            Some(ARTIST) => restore(),
            Some("main") => restore_from_elsewhere(),
            _ if TAKEN.load(Ordering::Relaxed) => return logging::complain(&format!("headrace: {panic}")),
            _ => {}
        }
        logging::release();
        usual(panic);
    }));
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::io::Read as _;
    use std::process::Command;

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{Winsize, tcsetwinsize};

    use super::*;

    /// Name of the thread that panics in [`panics_with_the_terminal_taken`].
    const THREAD: &str = "HEADRACE_TEST_THREAD";
    const WORDS: &str = "a panic on purpose";

    /// Run by [`a_panic_leaves_the_terminal_as_it_was`] in a process with a terminal of its own.
    #[test]
    #[ignore = "takes the terminal, and panics"]
    fn panics_with_the_terminal_taken() {
        let Ok(name) = std::env::var(THREAD) else { return };
        let hold = Hold::take().unwrap();
        let panicking = thread::Builder::new().name(name).spawn(|| panic!("{WORDS}")).unwrap();
        assert!(panicking.join().is_err());
        assert!(tcgetwinsize(&hold.0).is_ok());
    }

    /// All that a process writes which panics on a thread of that name with the terminal taken, the terminal's settings while it is
    /// taken, and whether they are afterwards as they were.
    fn written(thread: &str) -> (String, bool) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let end = OpenOptions::new().read(true).write(true).open(name).unwrap();
        tcsetwinsize(&end, Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
        let before = tcgetattr(&end).unwrap();
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args([
            "tui::hold::tests::panics_with_the_terminal_taken",
            "--exact",
            "--ignored",
            "--nocapture",
        ]);
        command.env(THREAD, thread).env("RUST_BACKTRACE", "0");
        let [stdin, stdout, stderr] = [(); 3].map(|()| end.try_clone().unwrap());
        let mut child = command.stdin(stdin).stdout(stdout).stderr(stderr).spawn().unwrap();
        drop(command);
        let mut master = File::from(master);
        let reading = thread::spawn(move || {
            let (mut all, mut bytes) = (Vec::new(), [0; 4096]);
            // The end of a terminal that nobody holds open is an error.
            while let Ok(count @ 1..) = master.read(&mut bytes) {
                all.extend_from_slice(&bytes[..count]);
            }
            String::from_utf8(all).unwrap()
        });
        assert!(child.wait().unwrap().success());
        let after = tcgetattr(&end).unwrap();
        drop(end);
        let same = (before.local_modes, before.input_modes, before.output_modes)
            == (after.local_modes, after.input_modes, after.output_modes);
        (reading.join().unwrap(), same)
    }

    #[test]
    fn a_panic_leaves_the_terminal_as_it_was() {
        let at = |written: &str, text: &str| {
            written.find(text).unwrap_or_else(|| panic!("{text:?} in {written:?}"))
        };
        let [enter, leave] = [ENTER, LEAVE].map(|bytes| std::str::from_utf8(bytes).unwrap());
        // What draws, and the loop: the words stand on the first page, after the way back to it.
        for thread in [ARTIST, "main"] {
            let (written, same) = written(thread);
            assert!(same, "{thread}: the settings are others");
            assert!(at(&written, enter) < at(&written, leave), "{thread}: {written:?}");
            assert!(at(&written, leave) < at(&written, WORDS), "{thread}: {written:?}");
            assert_eq!(written.matches(leave).count(), 1, "{thread}: {written:?}");
        }
        // Another thread's panic is a line of the log, and the terminal stays taken until its owner gives it back.
        let (written, same) = written("line 0");
        assert!(same && at(&written, enter) < at(&written, leave), "{written:?}");
        assert!(!written.contains(WORDS), "{written:?}");
    }
}
