//! Contents of a document. HTML and PDF have the same blocks.

use crate::pictures::shape::Drawing;

/// A document.
#[derive(Debug, Clone)]
pub struct Document {
    /// Title on the cover, and in the footer of each page.
    pub title: String,
    /// Text at the right of each page's footer, before the page number.
    pub footer: String,
    /// Contents in order. The cover ends at the first page break.
    pub blocks: Vec<Block>,
}

/// A part of a document.
#[derive(Debug, Clone)]
pub enum Block {
    /// Heading of a chapter.
    Heading(String),
    /// Heading within a chapter.
    Subheading(String),
    /// A paragraph.
    Paragraph(String),
    /// A paragraph that readers must not overlook.
    Warning(String),
    /// Paragraphs of a list.
    List(Vec<String>),
    /// Names with their values.
    Values(Vec<(String, String)>),
    /// A table.
    Table(Table),
    /// A drawing with its caption.
    Figure(Drawing, String),
    /// The next block begins a new page.
    PageBreak,
}

/// A table. Each row has a cell for each column.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Names of the columns, with their units.
    pub columns: Vec<String>,
    /// Text of the cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Whether a column has numbers alone, which are aligned to the right.
    pub(super) fn is_number(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.get(column)).filter(|cell| *cell != "-");
        cells.all(|cell| cell.parse::<f64>().is_ok())
    }
}

impl Document {
    /// Returns the document's text, one line for each paragraph, row and caption.
    pub fn text(&self) -> String {
        let lines: Vec<String> = self.blocks.iter().flat_map(Block::lines).collect();
        format!("{}\n{}\n", self.title, lines.join("\n"))
    }
}

impl Block {
    fn lines(&self) -> Vec<String> {
        match self {
            Self::Heading(text) => vec![String::new(), format!("# {text}")],
            Self::Subheading(text) => vec![format!("## {text}")],
            Self::Paragraph(text) => vec![text.clone()],
            Self::Warning(text) => vec![format!("! {text}")],
            Self::List(texts) => texts.iter().map(|text| format!("- {text}")).collect(),
            Self::Values(values) => values.iter().map(|(name, value)| format!("{name}: {value}")).collect(),
            Self::Table(Table { columns, rows }) => {
                core::iter::once(columns).chain(rows).map(|cells| cells.join(" | ")).collect()
            }
            Self::Figure(_, caption) => vec![format!("[{caption}]")],
            Self::PageBreak => Vec::new(),
        }
    }
}
