//! Breaks texts into lines, and divides the width of a table among its columns. Lengths are points, of which an inch
//! has 72.

use super::helvetica::width_pt;
use super::model::Table;

/// Space between two columns of a table, points.
pub(super) const GAP_PT: f64 = 10.0;

/// Font of a text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Font {
    pub(super) size_pt: f64,
    pub(super) bold: bool,
}

impl Font {
    pub(super) fn width_pt(self, text: &str) -> f64 {
        width_pt(text, self.size_pt, self.bold)
    }

    /// Breaks a text at its spaces into lines of at most `room_pt`. A longer word is divided.
    pub(super) fn broken(self, text: &str, room_pt: f64) -> Vec<String> {
        let mut lines = vec![String::new()];
        for word in text.split(' ') {
            let Some(line) = lines.last_mut() else { continue };
            let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
            if self.width_pt(&longer) <= room_pt {
                *line = longer;
                continue;
            }
            let mut pieces = self.pieces(word, room_pt);
            if line.is_empty() && !pieces.is_empty() {
                *line = pieces.remove(0);
            }
            lines.extend(pieces);
        }
        lines
    }

    fn pieces(self, word: &str, room_pt: f64) -> Vec<String> {
        let mut pieces = vec![String::new()];
        for letter in word.chars() {
            let Some(piece) = pieces.last_mut() else { continue };
            piece.push(letter);
            if self.width_pt(piece) > room_pt && piece.chars().count() > 1 {
                piece.pop();
                pieces.push(letter.to_string());
            }
        }
        pieces
    }
}

/// Widths of a table's columns, which fit into `room_pt`. `fonts` are those of the header and of the cells.
///
/// Columns have the width of their longest cell if all of them fit. Otherwise each column has room for its longest
/// word, and the rest of the room is divided among the columns, in proportion to the lengths that don't fit yet.
pub(super) fn column_widths(table: &Table, fonts: [Font; 2], room_pt: f64) -> Vec<f64> {
    let cells = |column: usize| {
        let header = table.columns.get(column).map(|name| (name, fonts[0]));
        let rows = table.rows.iter().filter_map(move |row| row.get(column)).map(move |cell| (cell, fonts[1]));
        header.into_iter().chain(rows)
    };
    let count = table.columns.len();
    let widest = |measure: &dyn Fn(&str, Font) -> f64| -> Vec<f64> {
        (0..count)
            .map(|column| cells(column).map(|(text, font)| measure(text, font)).fold(0.0, f64::max) + 0.1)
            .collect()
    };
    let whole = widest(&|text, font| font.width_pt(text));
    let room_pt = room_pt - GAP_PT * (count as f64 - 1.0);
    if whole.iter().sum::<f64>() <= room_pt {
        return whole;
    }
    let words = widest(&|text, font| text.split(' ').map(|word| font.width_pt(word)).fold(0.0, f64::max));
    let needed: f64 = words.iter().sum();
    if needed > room_pt {
        return words.iter().map(|word_pt| word_pt * room_pt / needed).collect();
    }
    let missing: f64 = whole.iter().zip(&words).map(|(whole, word)| whole - word).sum();
    let share = (room_pt - needed) / missing.max(1e-9);
    whole.iter().zip(&words).map(|(whole, word)| word + share * (whole - word)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FONT: Font = Font { size_pt: 10.0, bold: false };

    #[test]
    fn lines_keep_all_letters_and_fit() {
        let text = "the wall from the portal to 0123456789012345678901234567890123456789 and on";
        let lines = FONT.broken(text, 90.0);
        assert!(lines.iter().all(|line| FONT.width_pt(line) <= 90.0), "{lines:?}");
        assert_eq!(lines.concat().replace(' ', ""), text.replace(' ', ""));
        assert_eq!(FONT.broken("", 90.0), [""]);
    }

    #[test]
    fn columns_of_a_wide_table_fit_and_keep_their_words() {
        let long = "the vehicle blocks the beams and a head stopped turning";
        let table = Table {
            columns: vec!["from".to_owned(), "cause".to_owned(), "action".to_owned()],
            rows: vec![vec!["0+010.00".to_owned(), long.to_owned(), long.repeat(3)]],
        };
        let widths = column_widths(&table, [FONT; 2], 300.0);
        assert!(widths.iter().sum::<f64>() + 2.0 * GAP_PT <= 300.001, "{widths:?}");
        assert!(widths[0] >= FONT.width_pt("0+010.00") && widths[2] > widths[1], "{widths:?}");
    }
}
