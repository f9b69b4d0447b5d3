//! Tests of the steps that the filter records for smoothing.

use super::rig::{IMU, Rig, at, cruise};
use crate::Navigation as _;
use crate::filter::FilterNavigation;
use crate::smooth::journal::{Journal, JournalReader};
use crate::smooth::step::{Move, Placed};
use headrace_geometry::time::DurNs;

fn recorded(rig: &Rig) -> (FilterNavigation, JournalReader) {
    let (journal, reader) = Journal::new(10_000);
    (rig.navigation().with_journal(journal), reader)
}

fn steps(reader: &JournalReader) -> Vec<Placed> {
    core::iter::from_fn(|| reader.next()).map(|words| Placed::of_words(&words).unwrap()).collect()
}

/// Groups the steps by piece of the track. Returns each group with the numbers of its piece and of its clock.
fn pieces(steps: &[Placed]) -> Vec<((u32, u32), &[Placed])> {
    steps.chunk_by(|a, b| a.piece == b.piece).map(|piece| ((piece[0].piece, piece[0].clock), piece)).collect()
}

/// Whether each step begins where the previous step ends, and only the last step is an end marker.
fn is_whole(piece: &[Placed]) -> bool {
    let is_end = |placed: &&Placed| matches!(placed.step.by, Move::End);
    piece.windows(2).all(|two| two[0].step.to == two[1].step.at)
        && piece.iter().filter(is_end).count() == 1
        && piece.last().as_ref().is_some_and(is_end)
}

#[test]
fn dive_without_an_estimate_records_no_smoothing_steps() {
    let rig = Rig::new(cruise, 5);
    let (mut nav, reader) = recorded(&rig);
    for event in rig.events(0.0, 1.0).iter().filter(|event| event.source == IMU) {
        Rig::hear(&mut nav, event);
    }
    assert!(nav.running().is_none());
    nav.end();
    assert_eq!(steps(&reader).len(), 0);
}

/// A clock reset by more than 10 s ends the piece of the track exactly once, even if no later reading follows.
#[test]
fn filter_steps_before_a_clock_reset_are_recorded_completely() {
    let rig = Rig::new(cruise, 5);
    let (mut nav, reader) = recorded(&rig);
    for event in rig.events(0.0, 30.0) {
        Rig::hear(&mut nav, &event);
    }
    let ended = nav.received;
    for event in &rig.events(0.0, 0.1) {
        Rig::hear(&mut nav, event);
    }
    nav.end();
    let all = steps(&reader);
    let found = pieces(&all);
    assert_eq!(found.iter().map(|(numbers, _)| *numbers).collect::<Vec<_>>(), [(1, 0)]);
    assert!(is_whole(found[0].1));
    let last = all.last().unwrap().step.at;
    assert!(ended.since(last) < DurNs::from_secs_f64(1.0), "the last epochs must be recorded");
}

#[test]
fn recording_of_navigation_steps_is_split_at_a_clock_reset() {
    let rig = Rig::new(cruise, 5);
    let (mut nav, reader) = recorded(&rig);
    for event in rig.events(0.0, 30.0).iter().chain(&rig.events(0.0, 20.0)) {
        Rig::hear(&mut nav, event);
    }
    nav.end();
    let all = steps(&reader);
    let found = pieces(&all);
    assert_eq!(found.iter().map(|(numbers, _)| *numbers).collect::<Vec<_>>(), [(1, 0), (2, 1)]);
    assert!(found.iter().all(|(_, piece)| is_whole(piece)));
    let last = all.last().unwrap().step.at;
    assert!(at(20.0).since(last) < DurNs::from_secs_f64(0.1), "all readings must be fused at the end");
}
