//! A section as recorded in the stream `judgements` each time its verdict, hole or flag changes.

use crate::pilot_text::CauseFigures;
use crate::result_stream::{RecordKind, ResultStream};
use headrace_coverage::{Again, Cause, Causes, Failing, Judgement, Section, Verdict};
use headrace_geometry::time::MonoNs;
use headrace_sampling::head::HeadSet;

/// A judgement of a section. The fields have the names and units of [`SectionRow`](crate::section_row::SectionRow).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionJudgement {
    /// Time of the judgement.
    pub at: MonoNs,
    /// Number of the section: the chainage of its start divided by the section length.
    pub index: i64,
    /// Change of the section's state by the judgement, such as a raised flag.
    pub change: Judgement,
    /// Verdict on the section.
    pub verdict: Verdict,
    /// Diameter of the section's largest hole, m; 0 if the hole wasn't measured.
    pub hole_m: f64,
    /// Standard deviation of the hole's diameter, m.
    pub hole_sd_m: f64,
    /// Chainage of the hole's centre, m; 0 if the hole wasn't measured.
    pub hole_x_m: f64,
    /// Arc length of the hole's centre, m; 0 if the hole wasn't measured.
    pub hole_arc_m: f64,
    /// Evidence for the cause of a fail; `None` before the section's first fail.
    pub cause: Option<CauseFigures>,
}

/// Adds the record of a judgement to a stream.
pub(super) fn record(to: &mut ResultStream, at: MonoNs, index: i64, change: Judgement, section: &Section) {
    to.record(RecordKind::Section)
        .integer(at.0)
        .integer(index.cast_unsigned())
        .integer(change as u64)
        .integer(section.verdict as u64)
        .number(section.hole.map_or(0.0, |hole| hole.diameter_m))
        .number(section.hole_sd_m)
        .integer(section.evidence.map_or(u64::MAX, |evidence| evidence.cause as u64))
        .number(section.hole.map_or(0.0, |hole| hole.x_m))
        .number(section.hole.map_or(0.0, |hole| hole.arc_m));
    if let Some(evidence) = section.evidence {
        to.number(evidence.speed_mps)
            .number(evidence.t_y_m)
            .number(evidence.middle_t_y_m)
            .number(evidence.missing_share)
            .number(evidence.swing_m)
            .integer(u64::from(evidence.silent_heads.bits()))
            .integer(u64::from(evidence.causes.bits()))
            .number(evidence.with_losses_mps);
    }
}

impl SectionJudgement {
    /// Reads a judgement from the words of its record; `None` if the words are too few, or name an unknown change or
    /// verdict.
    ///
    /// Also accepts records of earlier program versions, which have fewer figures about the cause.
    pub fn read(words: &[u64]) -> Option<Self> {
        let ([at, index, change, verdict, hole, hole_sd, cause, hole_x, hole_arc], figures) =
            words.split_first_chunk()?;
        let cause = Cause::ALL.into_iter().find(|known| *known as u64 == *cause);
        Some(Self {
            at: MonoNs(*at),
            index: index.cast_signed(),
            change: Judgement::ALL.into_iter().find(|known| *known as u64 == *change)?,
            verdict: Verdict::ALL.into_iter().find(|known| *known as u64 == *verdict)?,
            hole_m: f64::from_bits(*hole),
            hole_sd_m: f64::from_bits(*hole_sd),
            hole_x_m: f64::from_bits(*hole_x),
            hole_arc_m: f64::from_bits(*hole_arc),
            cause: cause.and_then(|cause| figures_of(cause, figures)),
        })
    }
}

fn figures_of(cause: Cause, words: &[u64]) -> Option<CauseFigures> {
    let (figures, rest) = words.split_first_chunk()?;
    let [speed_mps, t_y_m, middle_t_y_m, missing_share, swing_m] = figures.map(f64::from_bits);
    let silent_heads = rest.first().and_then(|bits| u8::try_from(*bits).ok()).map(HeadSet::from_bits);
    let causes = rest.get(1).and_then(|bits| u16::try_from(*bits).ok()).map(Causes::from_bits);
    let causes = causes.unwrap_or(Causes::of(cause));
    let again_mps = rest.get(2).copied().map_or(0.0, f64::from_bits);
    Some(CauseFigures {
        causes,
        speed_mps,
        t_y_m,
        middle_t_y_m,
        missing_share,
        again: Again::of(&Failing { causes, again_mps }),
        swing_m,
        silent_heads: silent_heads.unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result_stream::first_record;
    use headrace_coverage::{Evidence, Hole};

    fn failed() -> Section {
        let mut section = Section::default();
        section.verdict = Verdict::Fail;
        section.hole =
            Some(Hole { diameter_m: 0.8, least_m: 0.8, most_m: 0.8, x_m: 10.1, arc_m: 9.4, bounded: true });
        section.hole_sd_m = 0.02;
        section.evidence = Some(Evidence {
            cause: Cause::TooFast,
            causes: Causes::of(Cause::TooFast).with(Cause::HeadSilent),
            speed_mps: 0.31,
            t_y_m: 0.21,
            middle_t_y_m: 0.19,
            missing_share: 0.125,
            swing_m: 0.05,
            silent_heads: HeadSet::from_bits(5),
            fits_mps: 0.1,
            with_losses_mps: 0.09,
            pass_gap_s: 2.4,
            even_pass_gap_s: 1.2,
            all_pass_gap_s: 0.6,
            occluded_share: 0.0,
            standing_share: 0.0,
            lost_in_hole: 3,
        });
        section
    }

    fn written(section: &Section) -> Vec<u64> {
        let mut stream = ResultStream::default();
        stream.keep();
        record(&mut stream, MonoNs(7), -3, Judgement::Raised, section);
        first_record(stream.words()).unwrap().0.words.to_vec()
    }

    #[test]
    fn judgement_is_read_as_recorded() {
        let section = failed();
        let (hole, evidence) = (section.hole.unwrap(), section.evidence.unwrap());
        let expected = SectionJudgement {
            at: MonoNs(7),
            index: -3,
            change: Judgement::Raised,
            verdict: Verdict::Fail,
            hole_m: hole.diameter_m,
            hole_sd_m: section.hole_sd_m,
            hole_x_m: hole.x_m,
            hole_arc_m: hole.arc_m,
            cause: Some(CauseFigures::from(&evidence)),
        };
        assert_eq!(SectionJudgement::read(&written(&section)), Some(expected));
        let blank = SectionJudgement::read(&written(&Section::default())).unwrap();
        assert_eq!((blank.verdict, blank.hole_m, blank.cause), (Verdict::Open, 0.0, None));
    }

    #[test]
    fn incomplete_or_unknown_judgement_is_not_read() {
        let words = written(&failed());
        assert_eq!(SectionJudgement::read(&words[..8]), None);
        let mut unknown = words.clone();
        unknown[3] = 9;
        assert_eq!(SectionJudgement::read(&unknown), None);
        // Earlier program versions recorded no figure after the swing distance.
        let earlier = SectionJudgement::read(&words[..14]).unwrap().cause.unwrap();
        assert_eq!((earlier.causes, earlier.silent_heads), (Causes::of(Cause::TooFast), HeadSet::default()));
    }
}
