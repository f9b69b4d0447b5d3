//! Converts the loop's results ([`headrace_monitor::result_stream`]) to messages that Foxglove and Lichtblick display.
//!
//! The schemas are Foxglove's or this program's own.
//!
//! | topic below `/result/view/` | schema | content, rate |
//! |---|---|---|
//! | `transforms` | `foxglove.FrameTransforms` | `tunnel` to `vehicle` and to `wall`, at each update (5 Hz) |
//! | `pose` | `foxglove.PoseInFrame` | the vehicle, at each update |
//! | `vehicle` | `headrace.Vehicle` | state of the vehicle for plots, with speed and standard deviations |
//! | `points` | `foxglove.PointCloud` | samples of half a second, with the head number |
//! | `wall` | `foxglove.Grid` | the unrolled wall within 8 m of the vehicle, every 2 s |
//! | `sections` | `headrace.Section` | each section as it is judged |
//! | `missed` | `headrace.Missed` | the flagged stretches, every 2 s if changed |
//! | `advice` | `headrace.Advice` | the advice when it changes, and every second |
//! | `alerts` | `foxglove.Log` | alerts to the pilot |
//!
//! Frame `tunnel` is the tunnel frame of [`headrace_geometry::frames`]. Its z axis points up, as viewers expect, so
//! nothing needs rotating. Frame `wall` lies flat beside it: x is chainage, y is arc length.
//!
//! The messages are created by the recorder's thread ([`DerivedChannels`]), not by the loop. A replay doesn't read them.

mod judged;
mod messages;
mod points;
mod schemas;
mod site;
mod wall;

#[cfg(test)]
mod tests;

use headrace_fusion::NoFix;
use headrace_geometry::frames::{Body, Rot, Tunnel};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::WallPoint;
use headrace_monitor::alert_list::Occurrence;
use headrace_monitor::pilot_text::{AdviceFigures, advice_text, recorded_observation_text};
use headrace_monitor::result_stream::{Record, RecordKind, first_record, text_of};
use headrace_monitor::section_judgement::SectionJudgement;
use headrace_sampling::advice::{Reason, Remedy};
use serde::Serialize;

use self::judged::Sections;
use self::messages::{
    Advice, Deviations, FrameTransform, FrameTransforms, Known, Level, Log, Pose, PoseInFrame, Turn, Vehicle,
    Xyz, rounded,
};
use self::points::Points;
use self::schemas::Topic;
use self::site::{TUNNEL, VEHICLE, WALL};
use self::wall::Wall;
use crate::log::format::{STREAMS, read_results};
use crate::log::{DerivedChannels, Made};

pub use schemas::channels;
pub use site::Site;

/// Distance between the tunnel and the wall displayed beside it, m.
const BESIDE_M: f64 = 1.0;
/// Interval at which advice is published again if it hasn't changed.
const ADVICE_EVERY: DurNs = DurNs(1_000_000_000);
/// Speeds that differ by less than this count as equal advice, m/s.
const SAME_MPS: f64 = 0.005;

/// Creates messages for viewers from the loop's results.
#[derive(Debug)]
pub struct View {
    site: Site,
    beside_m: f64,
    points: Points,
    wall: Wall,
    sections: Sections,
    /// Chainage, m, and speed, m/s, of the vehicle at its latest known position.
    last: Option<(f64, f64)>,
    v_max_mps: f64,
    last_advice: Option<LastAdvice>,
    at: MonoNs,
}

/// The most recently published advice.
#[derive(Debug)]
struct LastAdvice {
    at: MonoNs,
    v_max_mps: f64,
    reason: Reason,
    will_exceed: bool,
}

impl View {
    /// Creates the view of a dive that has no results yet.
    pub fn new(site: Site) -> Self {
        let steps = 64;
        let arcs = (0..steps).map(|step| f64::from(step) / f64::from(steps) * site.profile.perimeter_m());
        let left_m =
            arcs.map(|arc_m| site.profile.point_at(arc_m)).fold(0.0, |most, [y, _]| f64::max(most, y));
        Self {
            wall: Wall::new(&site),
            beside_m: rounded(left_m + BESIDE_M, 1e2),
            points: Points::default(),
            sections: Sections::default(),
            last: None,
            v_max_mps: 0.0,
            last_advice: None,
            at: MonoNs(0),
            site,
        }
    }

    fn record(&mut self, record: Record<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let mut words = Words(record.words);
        match record.kind? {
            RecordKind::Pose => self.pose(&mut words, made),
            RecordKind::NoPose => self.no_pose(&mut words, made),
            RecordKind::Sample => self.sample(&mut words, made),
            RecordKind::Section => {
                self.section(&SectionJudgement::read(record.words)?, made);
                Some(())
            }
            RecordKind::Run => {
                self.sections.run(words.integer()?, words.integer()?);
                Some(())
            }
            RecordKind::Alert => self.observation(&mut words, made),
            RecordKind::Advice => self.advice(&mut words, made),
            // Viewers get only samples. Doubtful returns, live states and the list of alerts are not for viewers: they
            // are only in the log's results.
            RecordKind::NoSample
            | RecordKind::Doubtful
            | RecordKind::State
            | RecordKind::AlertChange
            | RecordKind::Note
            | RecordKind::Voice => Some(()),
        }
    }

    fn pose(&mut self, words: &mut Words<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let at = MonoNs(words.integer()?);
        let [x_m, y_m, z_m] = words.numbers()?;
        let wxyz: [f64; 4] = words.numbers()?;
        let speed_mps = words.number()?;
        let attitude = Rot::<Tunnel, Body>::from_wxyz(wxyz[0], wxyz[1], wxyz[2], wxyz[3])?;
        let (roll, pitch, yaw) = attitude.roll_pitch_yaw();
        let (position, orientation) = (Xyz::new([x_m, y_m, z_m]), Turn::of_wxyz(attitude.wxyz()));
        self.last = Some((x_m, speed_mps));
        let frame = |child, translation, rotation| FrameTransform {
            timestamp: at.into(),
            parent_frame_id: TUNNEL,
            child_frame_id: child,
            translation,
            rotation,
        };
        let beside = Xyz::new([0.0, self.beside_m, 0.0]);
        let transforms = vec![frame(VEHICLE, position, orientation), frame(WALL, beside, Turn::NONE)];
        made.push(Topic::Transforms, &FrameTransforms { transforms });
        let pose = Pose { position, orientation };
        made.push(Topic::Pose, &PoseInFrame { timestamp: at.into(), frame_id: TUNNEL, pose });
        let degrees = |angle_rad: f64| rounded(angle_rad.to_degrees(), 1e2);
        let deviations = words.numbers().map(|[along_m, place_m, tilt_rad, yaw_rad]| Deviations {
            chainage_sd_m: rounded(along_m, 1e3),
            place_sd_m: rounded(place_m, 1e3),
            tilt_sd_deg: degrees(tilt_rad),
            yaw_sd_deg: degrees(yaw_rad),
        });
        let known = Known {
            chainage_m: rounded(x_m, 1e3),
            left_m: rounded(y_m, 1e3),
            up_m: rounded(z_m, 1e3),
            roll_deg: degrees(roll),
            pitch_deg: degrees(pitch),
            yaw_deg: degrees(yaw),
            speed_mps: rounded(speed_mps, 1e3),
        };
        let vehicle = Vehicle { timestamp: at.into(), position: "known", known: Some(known), deviations };
        made.push(Topic::Vehicle, &vehicle);
        self.publish_regular(at, made);
        Some(())
    }

    fn no_pose(&mut self, words: &mut Words<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let at = MonoNs(words.integer()?);
        let no_fix = words.one_of(&NoFix::ALL, |no_fix| no_fix as u64)?;
        let vehicle =
            Vehicle { timestamp: at.into(), position: no_fix.as_str(), known: None, deviations: None };
        made.push(Topic::Vehicle, &vehicle);
        self.publish_regular(at, made);
        Some(())
    }

    /// Publishes the messages for viewers that are due at regular intervals.
    fn publish_regular(&mut self, at: MonoNs, made: &mut Outbox<'_>) {
        self.at = at;
        made.push_some(Topic::Points, self.points.close_before(at).as_ref());
        if let Some((x_m, _)) = self.last {
            made.push_some(Topic::Wall, self.wall.show(at, x_m).as_ref());
        }
        made.push_some(Topic::Missed, self.sections.show(at, &self.site).as_ref());
    }

    fn sample(&mut self, words: &mut Words<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let (at, source, _) = (MonoNs(words.integer()?), words.integer()?, words.integer()?);
        let [x_m, y_m, z_m, arc_m] = words.numbers()?;
        let head = self.site.heads.iter().position(|head| *head == source);
        let head = head.and_then(|head| u8::try_from(head).ok()).unwrap_or(u8::MAX);
        self.wall.sample(WallPoint { x_m, arc_m });
        made.push_some(Topic::Points, self.points.add(at, head, [x_m, y_m, z_m]).as_ref());
        Some(())
    }

    fn section(&mut self, judged: &SectionJudgement, made: &mut Outbox<'_>) {
        self.wall.judge(judged.index, judged.verdict);
        let (shown, said) = self.sections.judge(judged, &self.site, self.v_max_mps);
        made.push(Topic::Sections, &shown);
        for line in &said {
            made.push(Topic::Alerts, line);
        }
    }

    fn advice(&mut self, words: &mut Words<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let at = MonoNs(words.integer()?);
        let v_max_mps = words.number()?;
        let reason = words.one_of(&Reason::ALL, |reason| reason as u64)?;
        let will_exceed = words.integer()? != 0;
        let [phase_error_rad, t_y_m, width_m, arc_m] = words.numbers()?;
        let (remedy, mode) = (words.integer()?, [words.integer()?, words.integer()?]);
        let remedy = Remedy::of(remedy, &text_of(mode));
        self.v_max_mps = v_max_mps;
        let speed_mps = self.last.map(|(_, speed_mps)| speed_mps);
        let last_advice = self.last_advice.as_ref();
        let turned = last_advice
            .is_none_or(|last_advice| last_advice.reason != reason || last_advice.will_exceed != will_exceed);
        let same = |last_advice: &LastAdvice| {
            (last_advice.v_max_mps - v_max_mps).abs() < SAME_MPS
                && (0..ADVICE_EVERY.0).contains(&at.since(last_advice.at).0)
        };
        if !turned && last_advice.is_some_and(same) {
            return Some(());
        }
        let figures = AdviceFigures {
            speed_mps: speed_mps.unwrap_or(0.0),
            v_max_mps,
            reason,
            will_exceed,
            phase_error_rad,
            t_y_m,
            unseen_m: (width_m > 0.0).then_some([width_m, arc_m]),
            remedy,
        };
        let said = advice_text(&figures, &self.site.profile, &self.site.head_descriptions);
        if turned {
            let is_grave = will_exceed || reason != Reason::HelixPitch;
            let level = if is_grave { Level::Warning } else { Level::Info };
            made.push(Topic::Alerts, &Log::new(at, level, said.clone()));
        }
        made.push(
            Topic::Advice,
            &Advice {
                timestamp: at.into(),
                v_max_mps: rounded(v_max_mps, 1e3),
                speed_mps: speed_mps.map(|speed_mps| rounded(speed_mps, 1e3)),
                will_exceed,
                reason: reason.as_str(),
                words: said,
            },
        );
        self.last_advice = Some(LastAdvice { at, v_max_mps, reason, will_exceed });
        Some(())
    }

    /// Publishes an observation about the dive as a whole, or about a head.
    fn observation(&self, words: &mut Words<'_>, made: &mut Outbox<'_>) -> Option<()> {
        let at = MonoNs(words.integer()?);
        let kind = words.integer()?;
        let [x_m, off_m] = words.numbers()?;
        let head = words.integer().and_then(|source| self.site.heads.iter().position(|head| *head == source));
        let head = head.map_or_else(String::new, |head| format!("head {}", head + 1));
        let text = recorded_observation_text(kind, &head, Occurrence { x_m, off_m })?;
        made.push(Topic::Alerts, &Log::new(at, Level::Error, text));
        Some(())
    }
}

impl DerivedChannels for View {
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>) {
        if usize::from(channel) >= STREAMS.len() {
            return;
        }
        let Some((_, _, words)) = read_results(message) else { return };
        let mut made = Outbox { at, made };
        let mut rest = words.as_slice();
        while let Some((record, after)) = first_record(rest) {
            rest = after;
            // Records of results in the format of another version are skipped.
            let _ = self.record(record, &mut made);
        }
        self.at = at;
    }

    fn end(&mut self, made: &mut Vec<Made>) {
        let at = self.at;
        let mut made = Outbox { at, made };
        made.push_some(Topic::Points, self.points.close().as_ref());
        // The final state of the wall and of the missed stretches is always published, even if it isn't due yet.
        self.wall.hurry();
        self.sections.hurry();
        if let Some((x_m, _)) = self.last {
            made.push_some(Topic::Wall, self.wall.show(at, x_m).as_ref());
        }
        made.push_some(Topic::Missed, self.sections.show(at, &self.site).as_ref());
    }
}

/// Collects messages for viewers, to be written to the log.
struct Outbox<'a> {
    /// Log time of the messages. It is the log time of the results from which they are made, so that log times don't go
    /// back.
    at: MonoNs,
    made: &'a mut Vec<Made>,
}

impl Outbox<'_> {
    fn push<T: Serialize>(&mut self, topic: Topic, message: &T) {
        let channel = STREAMS.len() + topic as usize;
        let (Ok(channel), Ok(bytes)) = (u16::try_from(channel), serde_json::to_vec(message)) else { return };
        self.made.push(Made { channel, at: self.at, bytes });
    }

    fn push_some<T: Serialize>(&mut self, topic: Topic, message: Option<&T>) {
        if let Some(message) = message {
            self.push(topic, message);
        }
    }
}

/// Words of a stored result record, read in order.
struct Words<'a>(&'a [u64]);

impl Words<'_> {
    fn integer(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn number(&mut self) -> Option<f64> {
        self.integer().map(f64::from_bits)
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(first.map(f64::from_bits))
    }

    /// Returns the element of `all` whose `number` is the next word of the record.
    fn one_of<T: Copy>(&mut self, all: &[T], number: impl Fn(T) -> u64) -> Option<T> {
        let word = self.integer()?;
        all.iter().copied().find(|kind| number(*kind) == word)
    }
}
