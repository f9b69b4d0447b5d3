//! Capabilities of stdout: overwriting, colours, and width.

use std::io::IsTerminal;

use headrace_config::plain::one_line;
use headrace_monitor::live_state::Lamp;

use crate::terminal::{self, Terminal};

/// Width assumed for a terminal that doesn't report its width.
const COLUMNS: usize = 80;
/// Minimum width assumed, even if the terminal is narrower.
const LEAST_COLUMNS: usize = 40;

/// Capabilities of stdout.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Screen {
    /// Whether lines can be overwritten.
    pub(crate) overwrites: bool,
    colours: bool,
}

impl Screen {
    /// Detects whether stdout can overwrite lines and show colours.
    pub(crate) fn of_stdout() -> Self {
        let Terminal { overwrites, colour } = terminal::of(&std::io::stdout());
        Self { overwrites, colours: colour }
    }

    /// Number of columns that a line may fill; `None` in a pipe or file, where there is no limit. The width
    /// may change.
    ///
    /// The last column stays empty, because a full line would wrap on some terminals.
    pub(crate) fn columns() -> Option<usize> {
        let stdout = std::io::stdout();
        if !stdout.is_terminal() {
            return None;
        }
        let columns = rustix::termios::tcgetwinsize(&stdout).map_or(0, |size| usize::from(size.ws_col));
        Some(if columns == 0 { COLUMNS } else { columns.max(LEAST_COLUMNS) } - 1)
    }

    /// A printable line in the colour of a status lamp.
    pub(crate) fn coloured(self, text: &str, lamp: Option<Lamp>) -> String {
        let text = one_line(text);
        let code = match lamp.filter(|_| self.colours) {
            None => return text.into_owned(),
            Some(Lamp::Green) => "32",
            Some(Lamp::Amber) => "33",
            Some(Lamp::Red) => "1;31",
        };
        format!("\x1b[{code}m{text}\x1b[0m")
    }
}
