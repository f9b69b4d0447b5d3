//! Reads the keys that a terminal sends as bytes.

use crate::play::Key as Playing;

/// Character that a terminal sends for Ctrl-C.
pub(super) const INTERRUPT: char = '\x03';

/// A key of the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    Character(char),
    Enter,
    Escape,
    Backspace,
    Up,
    Down,
    Left,
    Right,
}

impl Key {
    /// Corresponding key of playback, if any.
    pub(super) fn of_playback(self) -> Option<Playing> {
        Some(match self {
            Self::Up => Playing::Up,
            Self::Down => Playing::Down,
            Self::Left => Playing::Left,
            Self::Right => Playing::Right,
            Self::Character(' ') => Playing::Space,
            Self::Character('+' | '=') => Playing::Faster,
            Self::Character('-' | '_') => Playing::Slower,
            Self::Character('.') => Playing::Tick,
            Self::Character('q' | 'Q' | '\x04') => Playing::Leave,
            _ => return None,
        })
    }
}

/// Keys that the bytes stand for. A terminal sends all bytes of a key at once.
pub(crate) fn keys(bytes: &[u8]) -> Vec<Key> {
    let text = String::from_utf8_lossy(bytes);
    let mut rest = text.as_ref();
    let mut keys = Vec::new();
    while let Some(first) = rest.chars().next() {
        rest = &rest[first.len_utf8()..];
        keys.push(match first {
            '\x1b' => {
                let Some(code) = rest.strip_prefix(['[', 'O']) else {
                    keys.push(Key::Escape);
                    continue;
                };
                // An escape sequence has parameters, then a letter or a tilde.
                let end = code.find(|c: char| c.is_ascii_alphabetic() || c == '~');
                let Some(end) = end else { return keys };
                let arrow = code.as_bytes().get(end).copied();
                rest = code.get(end + 1..).unwrap_or_default();
                match arrow {
                    Some(b'A') => Key::Up,
                    Some(b'B') => Key::Down,
                    Some(b'C') => Key::Right,
                    Some(b'D') => Key::Left,
                    _ => continue,
                }
            }
            '\r' | '\n' => Key::Enter,
            '\x08' | '\x7f' => Key::Backspace,
            other => Key::Character(other),
        });
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_a_terminal_are_decoded_to_screen_keys() {
        assert_eq!(
            keys("a\x1b[D\x1bOA\u{e4}\r\x7f\x1b[3~ \x03".as_bytes()),
            [
                Key::Character('a'),
                Key::Left,
                Key::Up,
                Key::Character('\u{e4}'),
                Key::Enter,
                Key::Backspace,
                Key::Character(' '),
                Key::Character(INTERRUPT),
            ]
        );
        assert_eq!(keys(b"\x1b"), [Key::Escape]);
        assert_eq!(keys(b"\x1b[1;5"), []);
    }
}
