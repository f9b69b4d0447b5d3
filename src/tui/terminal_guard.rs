//! Takes over the terminal: raw mode on the alternate screen. Every exit restores the terminal.

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

/// Name of the renderer's thread.
pub(super) const ARTIST: &str = "screen";
/// Codes that switch to the alternate screen and hide the cursor.
const ENTER: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[2J";
/// Codes that restore the main screen and show the cursor.
const LEAVE: &[u8] = b"\x1b[0m\x1b[?25h\x1b[?1049l";
/// Interval at which another thread checks whether the renderer has released the terminal. `STEPS` is the number of
/// checks.
const STEP: Duration = Duration::from_millis(25);
const STEPS: u32 = 20;

/// Terminal settings before the terminal was taken over.
static BEFORE: OnceLock<Termios> = OnceLock::new();
/// Whether the terminal is taken over.
static TAKEN: AtomicBool = AtomicBool::new(false);
/// Whether the renderer's thread is asked to release the terminal.
static LEAVING: AtomicBool = AtomicBool::new(false);

/// The terminal, for drawing. Writing bypasses the lock of stdout, so an unread terminal blocks no other
/// writer.
pub(super) struct TerminalGuard(File);

/// Checks the terminal.
///
/// Errors: stdin or stdout is not a terminal, or the terminal has no alternate screen.
pub(super) fn check() -> Result<(), Failure> {
    let able = crate::terminal::of(&io::stdout()).overwrites && io::stdin().is_terminal();
    let why = "--tui needs a terminal on stdin and stdout (and TERM other than dumb); over ssh: ssh -t";
    if able { Ok(()) } else { Err(Failure::Usage(why.to_owned())) }
}

impl TerminalGuard {
    /// Takes over the terminal.
    pub(super) fn take() -> io::Result<Self> {
        let out = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        let before = tcgetattr(io::stdin())?;
        let mut raw = before.clone();
        // Ctrl-C, Ctrl-Z and Ctrl-\ are read as keys. Ctrl-S and Ctrl-Q still stop and start the terminal's
        // output.
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

    /// File for writing to the terminal.
    pub(super) fn out(&self) -> io::Result<File> {
        self.0.try_clone()
    }

    /// Number of columns and rows of the terminal.
    pub(super) fn size(&self) -> (u16, u16) {
        match tcgetwinsize(&self.0) {
            Ok(size) if size.ws_col > 0 && size.ws_row > 0 => (size.ws_col, size.ws_row),
            _ => (80, 24),
        }
    }
}

impl Drop for TerminalGuard {
    fn drop(&mut self) {
        restore();
    }
}

/// Requests that the renderer's thread release the terminal.
pub(super) fn leave() {
    LEAVING.store(true, Ordering::Relaxed);
}

/// Whether the renderer's thread is asked to release the terminal.
pub(super) fn is_leaving() -> bool {
    LEAVING.load(Ordering::Relaxed)
}

/// Restores the terminal's settings. The call never blocks, even if the terminal reads nothing.
pub(super) fn restore_settings() {
    if let Some(before) = BEFORE.get()
        && let Err(error) = tcsetattr(io::stdin(), OptionalActions::Now, before)
    {
        tracing::warn!(%error, "the terminal's settings could not be restored");
    }
}

/// Restores the terminal. A second call does nothing.
pub(super) fn restore() {
    if TAKEN.swap(false, Ordering::Relaxed) {
        restore_settings();
        let mut out = io::stdout().lock();
        // A closed terminal needs no restoring, so the error is ignored.
        out.write_all(LEAVE).and_then(|()| out.flush()).ok();
    }
}

/// Restores the terminal within half a second, called from a thread other than the renderer's.
pub(super) fn restore_from_elsewhere() {
    leave();
    for _ in 0..STEPS {
        if !TAKEN.load(Ordering::Relaxed) {
            return;
        }
        thread::sleep(STEP);
    }
    restore_settings();
    // If the terminal reads nothing, writing blocks, so another thread writes, and the wait for it is limited.
    let writing = thread::spawn(restore);
    for _ in 0..STEPS {
        if writing.is_finished() {
            return;
        }
        thread::sleep(STEP);
    }
}

/// Installs a panic hook. It restores the terminal before the text of a fatal panic is printed.
///
/// A panic of any other thread becomes a line on the screen.
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

    /// Environment variable with the name of the thread that panics in [`thread_panics_while_the_terminal_is_taken`].
    const THREAD: &str = "HEADRACE_TEST_THREAD";
    const WORDS: &str = "a panic on purpose";

    /// Runs in a process with its own terminal. [`panic_restores_the_terminal`] starts that process.
    #[test]
    #[ignore = "takes the terminal, and panics"]
    fn thread_panics_while_the_terminal_is_taken() {
        let Ok(name) = std::env::var(THREAD) else { return };
        let hold = TerminalGuard::take().unwrap();
        let panicking = thread::Builder::new().name(name).spawn(|| panic!("{WORDS}")).unwrap();
        assert!(panicking.join().is_err());
        assert!(tcgetwinsize(&hold.0).is_ok());
    }

    /// Output of a process in which the thread with this name panics while the terminal is taken over.
    ///
    /// Also returns whether the terminal's settings are the same afterwards.
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
            "tui::terminal_guard::tests::thread_panics_while_the_terminal_is_taken",
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
            // Reading returns an error once all handles of the pseudo-terminal's other end are closed.
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
    fn panic_restores_the_terminal() {
        let at = |written: &str, text: &str| {
            written.find(text).unwrap_or_else(|| panic!("{text:?} in {written:?}"))
        };
        let [enter, leave] = [ENTER, LEAVE].map(|bytes| std::str::from_utf8(bytes).unwrap());
        // If the renderer or the loop panics, the text appears on the main screen, after the terminal has switched back
        // to this screen.
        for thread in [ARTIST, "main"] {
            let (written, same) = written(thread);
            assert!(same, "{thread}: the terminal's settings have changed");
            assert!(at(&written, enter) < at(&written, leave), "{thread}: {written:?}");
            assert!(at(&written, leave) < at(&written, WORDS), "{thread}: {written:?}");
            assert_eq!(written.matches(leave).count(), 1, "{thread}: {written:?}");
        }
        // If another thread panics, the text becomes a line of the log. The terminal stays taken over until
        // its owner releases it.
        let (written, same) = written("line 0");
        assert!(same && at(&written, enter) < at(&written, leave), "{written:?}");
        assert!(!written.contains(WORDS), "{written:?}");
    }
}
