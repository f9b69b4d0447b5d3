//! Questions ready to ask.

/// A question: its name, and its SQL, whose first comments say what it asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Question {
    /// Its name.
    pub name: &'static str,
    /// Its SQL.
    pub sql: &'static str,
}

/// All of them, of `campaign/questions`.
pub const QUESTIONS: [Question; 5] = [
    Question { name: "years", sql: include_str!("../../questions/years.sql") },
    Question { name: "target", sql: include_str!("../../questions/target.sql") },
    Question { name: "causes", sql: include_str!("../../questions/causes.sql") },
    Question { name: "versions", sql: include_str!("../../questions/versions.sql") },
    Question { name: "worst", sql: include_str!("../../questions/worst.sql") },
];

impl Question {
    /// The question of a name.
    pub fn find(name: &str) -> Option<Self> {
        QUESTIONS.into_iter().find(|question| question.name == name)
    }

    /// What it asks: the first line.
    pub fn about(&self) -> &'static str {
        self.sql.lines().next().unwrap_or_default().trim_start_matches("--").trim()
    }
}
