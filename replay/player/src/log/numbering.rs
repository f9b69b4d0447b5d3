//! Finds missing, repeated and reordered messages in this program's logs by their message numbers.
//!
//! Each channel counts its messages, and continues the count from part to part. A checksum covers one record, so it
//! can't show that a whole record was removed, repeated or moved. The message numbers show such changes.

use std::collections::BTreeMap;

use headrace_geometry::time::MonoNs;
use serde::{Deserialize, Serialize};

use super::channels::Channels;
use super::loss::{Loss, LossKind, Losses};
use super::merge::Entry;
use super::part::{PART_END, Part};
use super::scan::{Scan, Span};

/// Maximum number of runs of consecutive message numbers kept per channel. An intact log has one run, or a
/// few while its pieces are read out of order.
const MAX_RUNS: usize = 64;

/// A run of consecutive message numbers of a channel: first and last piece of the log, first and last number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Run {
    pieces: (usize, usize),
    first: u64,
    last: u64,
}

/// Runs of a channel's message numbers read so far.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Count {
    /// Number that the channel's first message in this log should have.
    first: u64,
    runs: Vec<Run>,
}

/// Runs of message numbers of all channels read so far.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Numbering {
    channels: BTreeMap<u16, Count>,
    /// Number of messages read so far.
    messages: u64,
    /// Number of messages that the closing records of the log state.
    wanted: Option<u64>,
}

/// Kind of fault in the message numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    Missing,
    Repeated,
    Disordered,
}

/// A place between two pieces of the log at which the message numbers of a channel are not consecutive.
#[derive(Debug)]
struct Break {
    fault: Fault,
    messages: u64,
    /// First and last piece of a range of pieces. The break lies before one of the pieces in this range. An index one
    /// above the last piece's stands for the log's end.
    pieces: (usize, usize),
}

impl Numbering {
    /// Creates the check of the message numbers in a log with these channels. `end` is the length of the log.
    ///
    /// Returns `None` for logs of other writers, which may number messages in any way.
    ///
    /// Also reports a part that was closed without an end record.
    pub(super) fn of(scan: &mut Scan, part: Option<&Part>, channels: &Channels, end: u64) -> Option<Self> {
        // If the log was not closed, the scan has already reported a loss.
        if part.is_some_and(|part| part.end.is_none()) && scan.losses.list().is_empty() {
            let kind = LossKind::Metadata(PART_END.to_owned());
            scan.losses.push(Loss { kind, offset: end, bytes: 0, from: None, to: None });
        }
        if !scan.ours {
            return None;
        }
        let before = |topic: &str| part.and_then(|part| part.head.before.sequences.get(topic)).copied();
        let count = |topic: &str| Count { first: before(topic).unwrap_or_default().into(), runs: Vec::new() };
        let channels = channels.all().map(|channel| (channel.id, count(&channel.topic))).collect();
        let wanted = scan.messages.or_else(|| part?.messages());
        Some(Self { channels, messages: 0, wanted })
    }

    /// Adds the message numbers of a piece of the log. The entries are in file order.
    pub(super) fn add(&mut self, piece: usize, entries: &[Entry]) {
        for head in entries.iter().map(|entry| entry.head) {
            self.messages += 1;
            // Messages of undefined channels are reported as another kind of loss.
            if let Some(count) = self.channels.get_mut(&head.channel) {
                count.add(piece, head.sequence);
            }
        }
    }

    /// Reports the breaks in the numbers of a log that has been read to its end. Breaks that a known loss explains
    /// aren't reported again.
    pub(super) fn report(&self, spans: &[Span], losses: &mut Losses) {
        let known = losses.list();
        let mut found: Vec<Break> = self.channels.values().flat_map(Count::breaks).collect();
        let end = self.channels.values().flat_map(|count| &count.runs).map(|run| run.pieces.1 + 1).max();
        let wanted = self.wanted.filter(|_| known.iter().all(is_elsewhere));
        if let Some(messages @ 1..) = wanted.map(|wanted| self.missing(wanted, &found)) {
            let pieces = (end.unwrap_or_default(), spans.len());
            found.push(Break { fault: Fault::Missing, messages, pieces });
        }
        let mut breaks: Vec<Break> = Vec::new();
        for one in found {
            let place = one.place(spans);
            if known.iter().any(|loss| explains(loss, place)) {
                continue;
            }
            match breaks.iter_mut().find(|other| other.meets(&one)) {
                Some(other) => other.add(&one),
                None => breaks.push(one),
            }
        }
        breaks.sort_by_key(|one| one.pieces);
        for one in breaks {
            losses.push(one.loss(spans));
        }
    }

    /// Returns the number of messages missing at the log's end, where no later message shows a gap.
    fn missing(&self, wanted: u64, found: &[Break]) -> u64 {
        let sum = |fault| found.iter().filter(|one| one.fault == fault).map(|one| one.messages).sum::<u64>();
        wanted.saturating_add(sum(Fault::Repeated)).saturating_sub(self.messages + sum(Fault::Missing))
    }
}

/// Whether the number of messages that the log states can still be checked in spite of a known loss.
fn is_elsewhere(known: &Loss) -> bool {
    matches!(known.kind, LossKind::Stated(_) | LossKind::Misplaced | LossKind::Truncated)
}

/// Whether a known loss may explain a break between two file offsets.
fn explains(known: &Loss, (from, to): (u64, u64)) -> bool {
    match known.kind {
        // The log's writer stated this loss. A writer numbers only messages that it writes, so the loss leaves no
        // break.
        LossKind::Stated(_) => false,
        // A loss of this kind may affect several positions in the file, but states only one range.
        LossKind::Swells { .. } | LossKind::Beyond { .. } | LossKind::Unreadable(_) => true,
        _ => known.offset <= to && from <= known.offset.saturating_add(known.bytes),
    }
}

impl Break {
    /// Whether breaks in the message numbers of two channels may be at the same position in the file.
    fn meets(&self, other: &Self) -> bool {
        let (first, last) = (self.pieces.0.max(other.pieces.0), self.pieces.1.min(other.pieces.1));
        self.fault == other.fault && first <= last
    }

    /// Merges a break in the numbers of another channel into this break. The result has the pieces that both ranges
    /// contain. A channel with few messages has a wide range, because few messages locate the break only roughly.
    fn add(&mut self, other: &Self) {
        self.messages += other.messages;
        self.pieces = (self.pieces.0.max(other.pieces.0), self.pieces.1.min(other.pieces.1));
    }

    /// Returns the file offsets between which the break in the message numbers lies.
    fn place(&self, spans: &[Span]) -> (u64, u64) {
        let before = self.pieces.0.checked_sub(1).and_then(|piece| spans.get(piece));
        let from = before.map_or(0, |span| span.end);
        let to =
            spans.get(self.pieces.1).map_or_else(|| spans.last().map_or(0, |span| span.end), |span| span.at);
        (from, to.max(from))
    }

    fn loss(&self, spans: &[Span]) -> Loss {
        let messages = self.messages;
        let kind = match self.fault {
            Fault::Missing => LossKind::Missing { messages },
            Fault::Repeated => LossKind::Repeated { messages },
            Fault::Disordered => LossKind::Disordered { messages },
        };
        let (offset, to) = self.place(spans);
        let before = spans.iter().take(self.pieces.0).rev().find(|span| span.is_dated());
        let after = spans.iter().skip(self.pieces.1).find(|span| span.is_dated());
        let (from, until) = (before.map(|span| MonoNs(span.to)), after.map(|span| MonoNs(span.from)));
        Loss { kind, offset, bytes: to - offset, from, to: until }
    }
}

impl Count {
    fn add(&mut self, piece: usize, number: u32) {
        // Numbers wrap at 32 bits. The full number is the one nearest to the previous number.
        let near = self.runs.last().map_or(self.first, |run| run.last);
        let low = u64::from(number.wrapping_sub(low_word(near)));
        let ahead = low <= u64::from(u32::MAX / 2);
        let number = if ahead { near + low } else { (near + low).saturating_sub(1 << 32) };
        let before =
            self.runs.iter().rposition(|run| run.last + 1 == number && self.is_clear(run.pieces.1, piece));
        let Some(run) = before.and_then(|at| self.runs.get_mut(at)) else {
            if self.runs.len() < MAX_RUNS {
                self.runs.push(Run { pieces: (piece, piece), first: number, last: number });
            }
            return;
        };
        (run.last, run.pieces.1) = (number, piece);
        // Pieces may be read in an order other than the file's, so the new number may close a gap between two runs.
        let after = self.runs.iter().position(|run| run.first == number + 1 && piece < run.pieces.0);
        let after =
            after.filter(|at| self.runs.get(*at).is_some_and(|run| self.is_clear(piece, run.pieces.0 - 1)));
        if let Some((before, after)) = before.zip(after) {
            let next = self.runs.get(after).copied();
            if let (Some(run), Some(next)) = (self.runs.get_mut(before), next) {
                (run.last, run.pieces.1) = (next.last, next.pieces.1);
            }
            self.runs.remove(after);
        }
    }

    /// Whether a run of message numbers that ends in piece `from` of the log may continue in piece `to`.
    /// Piece `to` must not be earlier, and no other run may lie between the two.
    fn is_clear(&self, from: usize, to: usize) -> bool {
        from <= to && !self.runs.iter().any(|run| from < run.pieces.1 && run.pieces.0 <= to)
    }

    /// Returns the places where message numbers are missing or repeated, or continue elsewhere in the file.
    fn breaks(&self) -> Vec<Break> {
        let mut runs = self.runs.clone();
        runs.sort_by_key(|run| (run.first, run.pieces));
        let mut breaks: Vec<Break> = Vec::new();
        let (mut next, mut piece) = (self.first, 0);
        for run in runs {
            let pieces = (piece.min(run.pieces.0), run.pieces.0);
            let repeated = next.min(run.last + 1).saturating_sub(run.first);
            let disordered = if run.pieces.0 + 1 < piece { run.last + 1 - run.first } else { 0 };
            for (fault, messages) in [
                (Fault::Missing, run.first.saturating_sub(next)),
                (Fault::Repeated, repeated),
                (Fault::Disordered, disordered),
            ] {
                breaks.push(Break { fault, messages, pieces });
            }
            (next, piece) = (next.max(run.last + 1), run.pieces.1 + 1);
        }
        breaks.retain(|one| one.messages > 0);
        breaks
    }
}

/// Returns the lower 32 bits of a message number.
fn low_word(number: u64) -> u32 {
    u32::try_from(number & u64::from(u32::MAX)).unwrap_or_default()
}
