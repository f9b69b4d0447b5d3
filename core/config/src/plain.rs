//! Sanitising of external text for display, because such text may contain terminal control codes.
//!
//! External text comes from files, devices and command lines.

use core::fmt::Write as _;
use std::borrow::Cow;

/// Returns a text as one visible line. A JSON text remains valid JSON.
///
/// Control characters, line ends, and characters that reverse or hide others are replaced by JSON escapes.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, acts)
}

/// Returns a text with each of its lines sanitised as by [`one_line`]. Line ends are kept.
pub fn lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && acts(c))
}

/// Whether [`one_line`] leaves a text unchanged.
pub fn is_plain(text: &str) -> bool {
    !text.contains(acts)
}

/// Whether a character changes the terminal or the text layout instead of being displayed.
///
/// Source: Unicode 16, categories Cc, Zl and Zp; Bidi_Control; and the invisible characters of Cf.
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{AD}' | '\u{61C}' | '\u{180E}' | '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}'
            | '\u{2060}'..='\u{206F}' | '\u{FEFF}' | '\u{FFF9}'..='\u{FFFB}' | '\u{E0000}'..='\u{E007F}')
}

fn escaped(text: &str, is_unfit: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_unfit) {
        return Cow::Borrowed(text);
    }
    let mut fit = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            _ if !is_unfit(c) => fit.push(c),
            '\n' => fit.push_str("\\n"),
            '\r' => fit.push_str("\\r"),
            '\t' => fit.push_str("\\t"),
            _ => {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    // Writing to a String cannot fail.
                    let _written = write!(fit, "\\u{unit:04x}");
                }
            }
        }
    }
    Cow::Owned(fit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        let cases = [
            ("\x1b[2J\x1b]0;title\x07", "\\u001b[2J\\u001b]0;title\\u0007"),
            ("one\r\ntwo\tthree", "one\\r\\ntwo\\tthree"),
            ("\u{9b}31m\u{7f}\0", "\\u009b31m\\u007f\\u0000"),
            ("a\u{202e}b\u{2066}c\u{200f}d\u{feff}\u{2028}", "a\\u202eb\\u2066c\\u200fd\\ufeff\\u2028"),
            ("\u{e0041}", "\\udb40\\udc41"),
        ];
        for (text, shown) in cases {
            assert_eq!(one_line(text), shown);
            assert!(!is_plain(text) && is_plain(shown));
        }
    }

    #[test]
    fn letters_of_all_scripts_are_unchanged() {
        for text in ["Stollen Süd, 12 °C, \"x\\y\"", "隧道", "נהר", "e\u{301}", "⚠ 🚇"] {
            assert_eq!(one_line(text), text);
        }
        assert_eq!(lines("a\nb\rc\n"), "a\nb\\rc\n");
    }
}
