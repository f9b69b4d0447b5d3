//! Search for the known word that the author of a file may have intended.

/// Maximum number of edits between a word and the known word that may have been intended: `MORE` if both words have at
/// least `LONG` letters, else `FEW`.
const FEW: usize = 1;
const MORE: usize = 2;
const LONG: usize = 6;

/// Returns the known word nearest to `word`. If several are equally near, returns the first. `None` if no known word is
/// near.
pub(super) fn nearest<'w>(word: &str, known: impl IntoIterator<Item = &'w str>) -> Option<&'w str> {
    let near = |candidate: &&str| {
        if stem(word) == stem(candidate) {
            return Some(FEW);
        }
        let shorter = word.chars().count().min(candidate.chars().count());
        let most = if shorter >= LONG { MORE } else { FEW };
        Some(changes(word, candidate)).filter(|changes| *changes <= most && *changes < shorter)
    };
    let mut best: Option<(usize, &str)> = None;
    for candidate in known {
        if let Some(changes) =
            near(&candidate).filter(|changes| best.is_none_or(|(least, _)| *changes < least))
        {
            best = Some((changes, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Returns a key without its unit: `start` for `start_m`.
fn stem(word: &str) -> &str {
    let units = ["m", "s", "ms", "deg", "hz", "mps", "degps", "h", "pa"];
    word.rsplit_once('_').filter(|(_, unit)| units.contains(unit)).map_or(word, |(stem, _)| stem)
}

/// Number of letters to insert, remove, replace or swap with a neighbour to turn `from` into `to`, ignoring case.
///
/// Source: the optimal string alignment distance; Boytsov, "Indexing methods for approximate dictionary searching",
/// 2011.
fn changes(from: &str, to: &str) -> usize {
    let letters = |word: &str| -> Vec<char> { word.chars().flat_map(char::to_lowercase).collect() };
    let (from, to) = (letters(from), letters(to));
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.iter().enumerate() {
        let mut row = vec![i + 1];
        for (j, b) in to.iter().enumerate() {
            let replaced = last[j] + usize::from(a != b);
            let mut least = replaced.min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && *a == to[j - 1] && from[i - 1] == *b {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = core::mem::replace(&mut last, row);
    }
    last.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_is_symmetric_and_ignores_case() {
        let cases = [
            ("", "abc", 3),
            ("plugn", "plugin", 1),
            ("target_cm", "target_m", 1),
            ("raed", "read", 1),
            ("a", "A", 0),
        ];
        for (from, to, expected) in cases {
            assert_eq!((changes(from, to), changes(to, from)), (expected, expected), "{from} {to}");
        }
        assert_eq!(changes("kitten", "sitting"), 3);
    }

    #[test]
    fn nearest_word_is_found_within_two_edits() {
        let known = ["target_m", "section_m", "id", "heads", "hull"];
        for (word, meant) in [
            ("target_cm", Some("target_m")),
            ("taget_m", Some("target_m")),
            ("head", Some("heads")),
            ("Hull", Some("hull")),
            ("weather", None),
            ("x", None),
            ("di", Some("id")),
            ("section", Some("section_m")),
            ("section_cm", Some("section_m")),
        ] {
            assert_eq!(nearest(word, known), meant, "{word}");
        }
    }
}
