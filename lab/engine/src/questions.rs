//! Predefined SQL questions about dives.

/// A question: a name and an SQL query. The first comments in the SQL describe the question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Question {
    /// Name of the question.
    pub name: &'static str,
    /// SQL of the question.
    pub sql: &'static str,
}

/// All questions of `lab/questions`.
pub const QUESTIONS: [Question; 5] = [
    Question { name: "years", sql: include_str!("../../questions/years.sql") },
    Question { name: "target", sql: include_str!("../../questions/target.sql") },
    Question { name: "causes", sql: include_str!("../../questions/causes.sql") },
    Question { name: "versions", sql: include_str!("../../questions/versions.sql") },
    Question { name: "worst", sql: include_str!("../../questions/worst.sql") },
];

impl Question {
    /// Finds a question by its name.
    pub fn find(name: &str) -> Option<Self> {
        QUESTIONS.into_iter().find(|question| question.name == name)
    }

    /// Description of the question: the first line of the SQL.
    pub fn about(&self) -> &'static str {
        self.sql.lines().next().unwrap_or_default().trim_start_matches("--").trim()
    }
}
