//! Ignored senders on a device's line.

/// Maximum number of senders named; beyond it the text only mentions others.
const NAMED: usize = 4;

/// Count of messages from senders other than the device, and their names; bounded for any input.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Strangers {
    messages: u64,
    who: Vec<String>,
    more: bool,
}

impl Strangers {
    /// Counts messages of one sender; returns true if this call names it for the first time.
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

    /// Describes the ignored senders; `None` without any. It changes with the names, not with the count.
    pub fn words(&self) -> Option<String> {
        let more = if self.more { " and others" } else { "" };
        (!self.who.is_empty()).then(|| format!("ignored: {}{more}", self.who.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_senders_are_counted_and_the_first_few_named() {
        let mut strangers = Strangers::default();
        assert_eq!(strangers.words(), None);
        for number in 0..1000 {
            assert_eq!(strangers.note(1, &format!("system {}", number % 5)), number < NAMED as u64);
        }
        assert_eq!(strangers.messages(), 1000);
        let words = "ignored: system 0, system 1, system 2, system 3 and others";
        assert_eq!(strangers.words().unwrap(), words);
    }
}
