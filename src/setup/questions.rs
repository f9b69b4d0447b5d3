//! Questions whose answers come from options, from the terminal, or from suggestions.

use std::io;

use headrace_config::plain::one_line;

use crate::failure::Failure;
use crate::keyboard;
use crate::logging::complain;
use crate::output::put;

/// A question.
pub(super) struct Question<'a> {
    pub(super) text: &'a str,
    /// Option that gives the answer if there is no terminal.
    pub(super) option: &'a str,
    /// Suggested answer; `None` if there can't be one.
    pub(super) suggestion: Option<&'a str>,
}

/// Asks questions, and collects the questions that have no answer.
pub(super) struct Questions {
    has_terminal: bool,
    takes_suggestions: bool,
    missing: Vec<String>,
}

impl Questions {
    /// Creates the questions. With `takes_suggestions`, questions that have a suggested answer aren't asked.
    pub(super) fn new(takes_suggestions: bool) -> Self {
        Self { has_terminal: keyboard::is_ours(), takes_suggestions, missing: Vec::new() }
    }

    /// Whether someone can be asked.
    pub(super) fn has_terminal(&self) -> bool {
        self.has_terminal
    }

    /// The answer to a question, which is repeated until `parse` accepts the answer.
    ///
    /// `None` without a terminal and suggestion; [`complete`](Self::complete) then fails.
    ///
    /// Errors: standard input has ended.
    pub(super) fn ask<T>(
        &mut self,
        question: &Question<'_>,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Option<T>, Failure> {
        let Question { text, option, suggestion } = *question;
        if let Some(answer) =
            suggestion.filter(|_| self.takes_suggestions).and_then(|answer| parse(answer).ok())
        {
            return Ok(Some(answer));
        }
        if !self.has_terminal {
            self.missing.push(option.to_owned());
            return Ok(None);
        }
        loop {
            let shown = suggestion.filter(|answer| !answer.is_empty());
            let brackets = shown.map(|answer| format!(" [{answer}]")).unwrap_or_default();
            put(&format!("{}{brackets}: ", one_line(text)));
            let mut line = String::new();
            let failed = |source| Failure::System { what: "reading an answer", source };
            if io::stdin().read_line(&mut line).map_err(failed)? == 0 {
                put("\n");
                return Err(Failure::Usage(format!("setup: no answer to {text:?}; {option} gives it")));
            }
            let typed = line.trim();
            let answer = if typed.is_empty() { suggestion.unwrap_or_default() } else { typed };
            match parse(answer) {
                Ok(answer) => return Ok(Some(answer)),
                Err(why) if why.contains(&format!("{answer:?}")) => complain(&why),
                Err(why) => complain(&format!("{answer:?}: {why}")),
            }
        }
    }

    /// Whether the answer to a question is yes. Without a terminal only suggestions are answers.
    pub(super) fn confirm(&mut self, text: &str, is_suggested: bool) -> Result<bool, Failure> {
        if !self.has_terminal || self.takes_suggestions {
            return Ok(is_suggested && self.takes_suggestions);
        }
        let suggestion = Some(if is_suggested { "y" } else { "n" });
        let yes_or_no = |answer: &str| match answer.to_ascii_lowercase().as_str() {
            "y" | "yes" => Ok(true),
            "n" | "no" => Ok(false),
            _ => Err("expected y or n".to_owned()),
        };
        Ok(self.ask(&Question { text, option: "--yes", suggestion }, yes_or_no)?.unwrap_or(false))
    }

    /// Checks that every question has an answer.
    ///
    /// Errors: an answer is missing; the text names all options that give missing answers.
    pub(super) fn complete(&self) -> Result<(), Failure> {
        if self.missing.is_empty() {
            return Ok(());
        }
        let missing = self.missing.join("; ");
        Err(Failure::Usage(format!(
            "setup: there is no terminal to ask on; give the answers as options: {missing}"
        )))
    }
}
