//! Senders that aren't believed.

/// Senders named; of more it is only said that there are others.
const NAMED: usize = 4;

/// Messages of senders that aren't the device, and who these are. Bounded, whatever comes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Strangers {
    messages: u64,
    who: Vec<String>,
    more: bool,
}

impl Strangers {
    /// Counts messages of one sender; true if it is named now and wasn't before.
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

    /// Messages that weren't believed.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Who isn't believed; `None` if there is nobody. Changes only with the names, not with the count.
    pub fn words(&self) -> Option<String> {
        let more = if self.more { " and others" } else { "" };
        (!self.who.is_empty()).then(|| format!("not believed: {}{more}", self.who.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_counted_and_the_first_few_named() {
        let mut strangers = Strangers::default();
        assert_eq!(strangers.words(), None);
        for number in 0..1000 {
            assert_eq!(strangers.note(1, &format!("system {}", number % 5)), number < NAMED as u64);
        }
        assert_eq!(strangers.messages(), 1000);
        let words = "not believed: system 0, system 1, system 2, system 3 and others";
        assert_eq!(strangers.words().unwrap(), words);
    }
}
