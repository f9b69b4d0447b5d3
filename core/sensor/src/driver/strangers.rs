//! Senders that are ignored on a device's line.

/// Maximum number of senders that are listed by name.
const NAMED: usize = 4;

/// Names of the ignored senders, and number of their messages. The memory is bounded for any input.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct IgnoredSenders {
    messages: u64,
    who: Vec<String>,
    more: bool,
}

impl IgnoredSenders {
    /// Counts messages of one sender. Returns true if its name is new and has been added to the list.
    pub fn note(&mut self, messages: u64, who: &str) -> bool {
        self.messages = self.messages.saturating_add(messages);
        if self.who.iter().any(|known| known == who) {
            return false;
        }
        if self.who.len() < NAMED {
            self.who.push(who.to_owned());
            return true;
        }
        self.more = true;
        false
    }

    /// Returns the number of ignored messages.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Describes the ignored senders; `None` if there are none. The text depends only on their names.
    pub fn words(&self) -> Option<String> {
        let more = if self.more { " and others" } else { "" };
        (!self.who.is_empty()).then(|| format!("ignored: {}{more}", self.who.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_4_senders_of_ignored_messages_are_named() {
        let mut strangers = IgnoredSenders::default();
        assert_eq!(strangers.words(), None);
        for number in 0..1000 {
            assert_eq!(strangers.note(1, &format!("system {}", number % 5)), number < NAMED as u64);
        }
        assert_eq!(strangers.messages(), 1000);
        let words = "ignored: system 0, system 1, system 2, system 3 and others";
        assert_eq!(strangers.words().unwrap(), words);
    }
}
