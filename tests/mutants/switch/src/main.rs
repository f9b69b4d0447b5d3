//! `switch LIST.json`: puts all mutants of the listed sources behind a switch, so that a single build contains all of
//! them.
//!
//! LIST.json is the output of `cargo mutants --list --json` with a number (`id`) added to each mutant. Each file in it
//! is rewritten in place, relative to the current folder. For example, `a + b` becomes
//! `if crate::switched::on(7) { a - b } else { a + b }`. The program prints the ids of mutants that can't be switched.
//! These mutants are in code that is evaluated at compile time, or in conditions that bind a name.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::ops::Range;

use proc_macro2::LineColumn;
use serde::Deserialize;
use syn::spanned::Spanned;

mod places;

use places::{Kind, Place};

#[derive(Deserialize)]
struct Mutant {
    id: u32,
    file: String,
    genre: String,
    replacement: String,
    span: MutantSpan,
}

#[derive(Deserialize)]
struct MutantSpan {
    start: Position,
}

/// Line and column, both counted from 1; the column counts characters.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Position {
    line: usize,
    column: usize,
}

impl From<LineColumn> for Position {
    fn from(at: LineColumn) -> Self {
        Self { line: at.line, column: at.column + 1 }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let list = std::env::args().nth(1).ok_or("usage: switch LIST.json")?;
    let mutants: Vec<Mutant> = serde_json::from_str(&fs::read_to_string(list)?)?;
    let mut files: BTreeMap<&str, Vec<&Mutant>> = BTreeMap::new();
    for mutant in &mutants {
        files.entry(&mutant.file).or_default().push(mutant);
    }
    let mut left_out = Vec::new();
    for (file, mutants) in files {
        let source = fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
        let syntax = syn::parse_file(&source).map_err(|error| format!("{file}: {error}"))?;
        let places = places::all(&syntax);
        let mut switched: BTreeMap<usize, Vec<&Mutant>> = BTreeMap::new();
        for mutant in mutants {
            let at = (mutant.genre.as_str(), mutant.span.start);
            match places.iter().position(|place| (place.kind.genre(), place.named_at) == at) {
                Some(place) => switched.entry(place).or_default().push(mutant),
                None => left_out.push(mutant.id),
            }
        }
        let text = Text { source: &source, places: &places, switched: &switched };
        fs::write(file, text.whole())?;
    }
    println!("{}", serde_json::to_string(&left_out)?);
    Ok(())
}

/// Source text of a file, with the places to be rewritten.
struct Text<'a> {
    source: &'a str,
    /// Outer places come before the places inside them.
    places: &'a [Place],
    /// Mutants of each place, keyed by the place's index.
    switched: &'a BTreeMap<usize, Vec<&'a Mutant>>,
}

impl Text<'_> {
    fn whole(&self) -> String {
        self.within(0..self.source.len(), 0)
    }

    /// Returns the text of a range. Places in the range, from index `first` on, are rewritten as switches.
    fn within(&self, range: Range<usize>, first: usize) -> String {
        let mut out = String::new();
        let mut at = range.start;
        for (&index, mutants) in self.switched.range(first..) {
            let Some(place) = self.places.get(index) else { continue };
            if place.range.start < at || place.range.end > range.end {
                continue;
            }
            out += &self.source[at..place.range.start];
            out += &self.place(index, place, mutants);
            at = place.range.end;
        }
        out + &self.source[at..range.end]
    }

    /// Writes a place with each mutant on its own line, so that a compiler error can be assigned to its mutant.
    fn place(&self, index: usize, place: &Place, mutants: &[&Mutant]) -> String {
        let inner = |range: &Range<usize>| self.within(range.clone(), index + 1);
        let raw = |range: &Range<usize>| &self.source[range.clone()];
        let on = |mutant: &Mutant| format!("crate::switched::on({})", mutant.id);
        let choice = |of: &dyn Fn(&Mutant) -> String, or: String| {
            let each: String = mutants
                .iter()
                .map(|mutant| format!("\nif {} {{ {} }}\nelse ", on(mutant), of(mutant)))
                .collect();
            format!("({each}{{ {or} }})")
        };
        match &place.kind {
            Kind::Binary { left, operator, right } => choice(
                &|mutant| format!("({}) {} ({})", raw(left), mutant.replacement, raw(right)),
                format!("{} {} {}", inner(left), raw(operator), inner(right)),
            ),
            Kind::Unary { operator, operand } => {
                choice(&|_| raw(operand).to_owned(), format!("{} {}", raw(operator), inner(operand)))
            }
            Kind::Guard => {
                mutants.iter().fold(inner(&place.range), |guard, mutant| match mutant.replacement.as_str() {
                    "true" => format!("(\n{} || ({guard}))", on(mutant)),
                    _ => format!("(\n!{} && ({guard}))", on(mutant)),
                })
            }
            Kind::Body => {
                let each = mutants
                    .iter()
                    .map(|mutant| format!("\nif {} {{ return {}; }}\n", on(mutant), mutant.replacement));
                each.collect::<String>() + &inner(&place.range)
            }
            Kind::Arm { guard } => mutants.iter().fold(String::new(), |_, mutant| match guard {
                Some(guard) => {
                    let before = self.source[place.range.start..guard.start].trim_end().to_owned();
                    format!("{before}\n !{} && ({})", on(mutant), inner(guard))
                }
                None => format!("{}\nif !{}", raw(&place.range), on(mutant)),
            }),
        }
    }
}

/// Start of a syntax element in cargo-mutants' notation.
fn start(of: &impl Spanned) -> Position {
    of.span().start().into()
}
