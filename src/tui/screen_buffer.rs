//! Screen buffer: colours, shapes, and rows of the screen.

use headrace_monitor::live_state::Lamp;
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use crate::terminal;

/// Capabilities of the terminal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Palette {
    pub(super) colour: bool,
    pub(super) unicode: bool,
}

impl Palette {
    pub(super) fn of_stdout() -> Self {
        Self { colour: terminal::of(&std::io::stdout()).colour, unicode: terminal::has_unicode() }
    }

    /// Symbol of a status lamp. Its shape shows the state even without colour.
    pub(super) fn shape(self, lamp: Lamp) -> &'static str {
        match (lamp, self.unicode) {
            (Lamp::Green, true) => "●",
            (Lamp::Amber, true) => "▲",
            (Lamp::Red, true) => "■",
            (Lamp::Green, false) => "o",
            (Lamp::Amber, false) => "^",
            (Lamp::Red, false) => "#",
        }
    }

    pub(super) fn style(self, lamp: Lamp) -> Style {
        let style = Style::default();
        match (lamp, self.colour) {
            (Lamp::Green, true) => style.fg(Color::Green),
            (Lamp::Amber, true) => style.fg(Color::Yellow),
            (Lamp::Red, true) => style.fg(Color::LightRed).add_modifier(Modifier::BOLD),
            (Lamp::Green, false) => style,
            (Lamp::Amber | Lamp::Red, false) => style.add_modifier(Modifier::BOLD),
        }
    }

    /// Style of a whole area in the colour of a status lamp.
    pub(super) fn banner(self, lamp: Lamp) -> Style {
        let style = Style::default().add_modifier(Modifier::BOLD);
        match (lamp, self.colour) {
            (Lamp::Green, true) => style.bg(Color::Green).fg(Color::Black),
            (Lamp::Amber, true) => style.bg(Color::Yellow).fg(Color::Black),
            (Lamp::Red, true) => style.bg(Color::Red).fg(Color::White),
            (Lamp::Green, false) => style,
            (Lamp::Amber | Lamp::Red, false) => style.add_modifier(Modifier::REVERSED),
        }
    }

    pub(super) fn dim() -> Style {
        Style::default().add_modifier(Modifier::DIM)
    }
}

/// Area of the screen whose rows are filled from the top down.
pub(super) struct Rows<'a> {
    pub(super) to: &'a mut Buffer,
    pub(super) top: u16,
    pub(super) bottom: u16,
}

impl Rows<'_> {
    pub(super) fn left(&self) -> u16 {
        self.bottom.saturating_sub(self.top)
    }

    pub(super) fn width(&self) -> u16 {
        self.to.area.width
    }

    #[expect(clippy::needless_pass_by_value, reason = "lines are built where they are drawn")]
    pub(super) fn line(&mut self, line: Line<'_>) {
        if self.left() > 0 {
            self.to.set_line(0, self.top, &line, self.to.area.width);
            self.top += 1;
        }
    }

    pub(super) fn text(&mut self, text: &str, style: Style) {
        self.line(Line::styled(text.to_owned(), style));
    }

    /// Draws the title of a panel, followed by a horizontal rule.
    pub(super) fn title(&mut self, title: &str, ink: Palette) {
        let rule = if ink.unicode { "─" } else { "-" };
        let behind = usize::from(self.width()).saturating_sub(title.chars().count() + 1);
        self.line(Line::from(vec![
            Span::styled(format!("{title} "), Style::default().add_modifier(Modifier::BOLD)),
            Span::styled(rule.repeat(behind), Palette::dim()),
        ]));
    }
}
