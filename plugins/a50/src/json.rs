//! A look through one JSON object, from its first byte to its last, without keeping anything.
//!
//! Whoever looks is called for each key of an object with a cursor that stands before the key's value, and takes it or
//! lets it go by. What isn't JSON ends the look. Stricter than the grammar in two points: numbers must be finite as
//! doubles, and nothing may be nested deeper than [`MAX_DEPTH`].
//! Source: RFC 8259.

/// How deep arrays and objects may stand in one another.
pub const MAX_DEPTH: usize = 8;

/// A place in a text.
#[derive(Debug, Clone, Copy)]
pub struct Cursor<'a> {
    rest: &'a [u8],
    depth: usize,
}

/// Takes an object's key, its escapes as they stand, and the value that follows; `None` ends the look.
pub type Visitor<'v, 'a> = &'v mut dyn FnMut(&'a [u8], &mut Cursor<'a>) -> Option<()>;

impl<'a> Cursor<'a> {
    /// Before the first byte of `text`; `None` where that isn't UTF-8.
    pub fn new(text: &'a [u8]) -> Option<Self> {
        core::str::from_utf8(text).ok().map(|text| Self { rest: text.as_bytes(), depth: 0 })
    }

    /// Whether only white space is left.
    pub fn is_at_end(mut self) -> bool {
        self.skip_space();
        self.rest.is_empty()
    }

    /// Takes an object and shows each key to `visitor`, which has to take the value.
    pub fn object(&mut self, visitor: Visitor<'_, 'a>) -> Option<()> {
        self.items(b'{', b'}', &mut |cursor| {
            let key = cursor.text()?;
            cursor.expect(b':')?;
            visitor(key, cursor)
        })
    }

    /// Takes an array; `visitor` has to take each value.
    pub fn array(&mut self, visitor: &mut dyn FnMut(&mut Self) -> Option<()>) -> Option<()> {
        self.items(b'[', b']', visitor)
    }

    /// Takes a number.
    pub fn number(&mut self) -> Option<f64> {
        self.skip_space();
        let before = self.rest;
        self.take_if(b'-');
        if !self.take_if(b'0') {
            self.digits()?;
        }
        if self.take_if(b'.') {
            self.digits()?;
        }
        if self.take_if(b'e') || self.take_if(b'E') {
            if !self.take_if(b'+') {
                self.take_if(b'-');
            }
            self.digits()?;
        }
        let text = before.get(..before.len() - self.rest.len())?;
        core::str::from_utf8(text).ok()?.parse().ok().filter(|number: &f64| number.is_finite())
    }

    /// Takes a string: what stands between its quotes, escapes as they are.
    pub fn text(&mut self) -> Option<&'a [u8]> {
        self.expect(b'"')?;
        let before = self.rest;
        loop {
            match self.next()? {
                b'"' => return before.get(..before.len() - self.rest.len() - 1),
                b'\\' => self.escape()?,
                0..=0x1F => return None,
                _ => (),
            }
        }
    }

    /// Takes `true` or `false`.
    pub fn boolean(&mut self) -> Option<bool> {
        match self.peek()? {
            b't' => self.word(b"true").map(|()| true),
            _ => self.word(b"false").map(|()| false),
        }
    }

    /// Takes any value.
    pub fn skip(&mut self) -> Option<()> {
        match self.peek()? {
            b'{' => self.object(&mut |_, value| value.skip()),
            b'[' => self.array(&mut Self::skip),
            b'"' => self.text().map(|_| ()),
            b't' | b'f' => self.boolean().map(|_| ()),
            b'n' => self.word(b"null"),
            _ => self.number().map(|_| ()),
        }
    }

    fn items(&mut self, open: u8, close: u8, item: &mut dyn FnMut(&mut Self) -> Option<()>) -> Option<()> {
        self.expect(open)?;
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return None;
        }
        if self.peek()? == close {
            self.next()?;
        } else {
            loop {
                item(self)?;
                self.skip_space();
                match self.next()? {
                    b',' => (),
                    byte if byte == close => break,
                    _ => return None,
                }
            }
        }
        self.depth -= 1;
        Some(())
    }

    fn escape(&mut self) -> Option<()> {
        match self.next()? {
            b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't' => Some(()),
            b'u' => (0..4).try_for_each(|_| self.next().filter(u8::is_ascii_hexdigit).map(|_| ())),
            _ => None,
        }
    }

    fn digits(&mut self) -> Option<()> {
        let count = self.rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        self.rest = self.rest.get(count..)?;
        (count > 0).then_some(())
    }

    fn word(&mut self, word: &[u8]) -> Option<()> {
        self.skip_space();
        self.rest = self.rest.strip_prefix(word)?;
        Some(())
    }

    fn expect(&mut self, wanted: u8) -> Option<()> {
        self.skip_space();
        (self.next()? == wanted).then_some(())
    }

    fn peek(&mut self) -> Option<u8> {
        self.skip_space();
        self.rest.first().copied()
    }

    fn next(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn take_if(&mut self, wanted: u8) -> bool {
        match self.rest.strip_prefix(&[wanted]) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn skip_space(&mut self) {
        let count = self.rest.iter().take_while(|byte| matches!(byte, b' ' | b'\t' | b'\r' | b'\n')).count();
        self.rest = self.rest.get(count..).unwrap_or_default();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::Value;

    use super::*;

    /// Whether the text is one value and nothing else.
    fn is_json(text: &[u8]) -> bool {
        Cursor::new(text).is_some_and(|mut cursor| cursor.skip().is_some() && cursor.is_at_end())
    }

    /// Every number at the top of an object, by key; the last of those with one key.
    fn numbers(text: &str) -> Option<Vec<(String, f64)>> {
        let mut found: Vec<(String, f64)> = Vec::new();
        let mut cursor = Cursor::new(text.as_bytes())?;
        cursor.object(&mut |key, value| {
            let key = String::from_utf8(key.to_vec()).unwrap();
            match value.peek()? {
                b'-' | b'0'..=b'9' => found.push((key, value.number()?)),
                _ => value.skip()?,
            }
            Some(())
        })?;
        Some(found)
    }

    fn any_value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            ".{0,8}".prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 32, 5, |inner| {
            prop_oneof![
                proptest::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                proptest::collection::vec(("[a-z_]{1,6}", inner), 0..5)
                    .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #![proptest_config(headrace_sensor::codec::contract::config())]

        #[test]
        fn what_another_writer_writes_is_json(value in any_value(), pretty in any::<bool>()) {
            let text = if pretty { serde_json::to_string_pretty(&value) } else { serde_json::to_string(&value) };
            prop_assert!(is_json(text.unwrap().as_bytes()));
        }

        #[test]
        fn a_damaged_text_is_json_where_another_reader_says_so(
            value in any_value(),
            at in any::<prop::sample::Index>(),
            byte in prop_oneof![any::<u8>(), proptest::sample::select(b"{}[]\",:\\.-+eE0 tfn".to_vec())],
            cut in any::<bool>(),
        ) {
            let mut text = serde_json::to_vec(&value).unwrap();
            let at = at.index(text.len());
            if cut { text.remove(at); } else { text[at] = byte; }
            prop_assert_eq!(is_json(&text), serde_json::from_slice::<Value>(&text).is_ok(), "{:?}", text);
        }

        #[test]
        fn numbers_are_those_that_another_reader_finds(
            pairs in proptest::collection::vec(("[a-z_]{1,6}", any_value()), 0..8),
        ) {
            let value = Value::Object(pairs.into_iter().collect());
            let got = numbers(&value.to_string()).unwrap();
            let wanted: Vec<_> = value.as_object().unwrap().iter()
                .filter_map(|(key, value)| value.as_f64().map(|number| (key.clone(), number)))
                .collect();
            prop_assert_eq!(got, wanted);
        }

        #[test]
        fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = is_json(&bytes);
        }
    }

    #[test]
    fn depth_is_bounded() {
        let nested = |depth: usize| [vec![b'['; depth], vec![b']'; depth]].concat();
        assert!(is_json(&nested(MAX_DEPTH)));
        assert!(!is_json(&nested(MAX_DEPTH + 1)));
        assert!(!is_json(&vec![b'['; 100_000]));
    }

    #[test]
    fn what_is_no_json_is_refused() {
        for text in [
            "", "{", "{}}", "{\"a\"}", "{\"a\":}", "[1,]", "01", "1.", ".5", "1e", "+1", "NaN", "1e999",
            "tru",
        ] {
            assert!(!is_json(text.as_bytes()), "{text}");
        }
    }
}
