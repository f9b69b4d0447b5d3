//! Texts of alerts, from the same table of words as the pilot's other messages. Allocates: outlets only,
//! never within a tick.

use super::alert::{AlertState, Figures, ListedAlert};
use super::kind::ListKind;
use crate::head_descriptions::HeadDescriptions;
use crate::observations::{Occurrence, Occurrences};
use crate::pilot_text::{
    actions_text, advice_text, cause_text, clock_text, measured_speed_text, no_position_text,
    observation_text, setting_text, speed_text, station,
};
use crate::source::SourceInfo;
use crate::unsure_stretch::{UnsureStretch, helps_text, unsure_text};
use crate::words::{withheld_action, withheld_text};
use headrace_coverage::{Sections, Stretch};
use headrace_geometry::time::DiveClock;
use headrace_geometry::tunnel::Profile;

/// Properties of the dive that the alert texts need.
#[derive(Debug, Clone, Copy)]
pub struct TextContext<'a> {
    /// Sources, for the sensor ids that alert texts name.
    pub sources: &'a [SourceInfo],
    /// Tunnel profile, for clock positions.
    pub profile: &'a Profile,
    /// Length of a tunnel section, m.
    pub section_m: f64,
    /// Sections of the tunnel, from which the place to go back to is found.
    pub sections: &'a Sections,
    /// Names of the heads, and the alternative settings that could be advised.
    pub heads: &'a HeadDescriptions,
    /// Clock of the dive.
    pub clock: DiveClock,
}

impl<'a> TextContext<'a> {
    /// Context from which the texts of a dive's alerts are made.
    pub(crate) fn of(
        sources: &'a [SourceInfo],
        profile: &'a Profile,
        sections: &'a Sections,
        heads: &'a HeadDescriptions,
        clock: DiveClock,
    ) -> Self {
        Self { sources, profile, section_m: sections.section_m(), sections, heads, clock }
    }

    fn unsure(&self, stretch: &Stretch) -> UnsureStretch {
        UnsureStretch::of(stretch, self.sections)
    }

    fn name(&self, source: usize) -> String {
        self.sources.get(source).map_or_else(String::new, |source| source.id.clone())
    }
}

impl ListedAlert {
    /// Beginning and end of the alert's stretch, m.
    pub fn bounds_m(&self, section_m: f64) -> (Option<f64>, Option<f64>) {
        match self.stretch {
            Some((from, to)) => (Some(from as f64 * section_m), Some(to as f64 * section_m)),
            None => (self.x_m, None),
        }
    }

    /// Text of the problem that the alert reports.
    pub fn text(&self, around: &TextContext<'_>) -> String {
        let name = self.source.map(|source| around.name(source.index())).unwrap_or_default();
        let place = match self.bounds_m(around.section_m) {
            (Some(from_m), Some(to_m)) => format!("{} to {}", station(from_m), station(to_m)),
            _ => String::new(),
        };
        match (self.kind, &self.figures) {
            (_, Figures::Missed(causes, arc_m, _)) => {
                let clock = clock_text(around.profile, *arc_m);
                format!("MISSED {place}, at {clock}: {}", cause_text(causes, around.heads))
            }
            (_, Figures::CannotSay(stretch)) => {
                format!("CAN'T SAY {place}: {}", unsure_text(&around.unsure(stretch)))
            }
            (ListKind::TooFast, Figures::Advice(figures)) => {
                // The text omits the present speed, which every screen shows.
                format!("TOO FAST: up to {}", measured_speed_text(figures.speed_mps.abs()))
            }
            (ListKind::TurnFails, Figures::Advice(figures)) => {
                format!(
                    "THIS TURN MISSES: heads {:.0} degrees out of phase",
                    figures.phase_error_rad.to_degrees().abs()
                )
            }
            (_, Figures::Advice(figures)) => advice_text(figures, around.profile, around.heads),
            (_, Figures::MissingRequirement(no_fix)) => no_position_text(*no_fix),
            (_, Figures::Error(error_m, _)) => format!("CAN'T SAY: position ±{error_m:.2} m"),
            (kind, Figures::Deviation(Occurrences { first_m, worst_m, .. })) => match kind.observed() {
                Some(kind) => {
                    let worst = Occurrence { x_m: *first_m, off_m: *worst_m };
                    place_first(&observation_text(kind, &name, worst), *first_m)
                }
                None => String::new(),
            },
            (_, Figures::Setting(doubt, Occurrences { first_m, .. })) => {
                let name = |source: u16| around.name(source.into());
                place_first(&setting_text(doubt, *first_m, &name), *first_m)
            }
            (ListKind::CableLeft, Figures::Left(left_m)) => format!("{left_m:.0} m of cable left"),
            (ListKind::TimeLeft, Figures::Left(left_s)) => match left_s / 60.0 {
                min if min < 0.0 => format!("{:.0} min over the dive's time", -min),
                min => format!("{min:.0} min of the dive left"),
            },
            (_, Figures::Stalled(seconds @ ..60)) => {
                format!("computer stalled for {seconds} s: data arrived late or were lost")
            }
            (_, Figures::Stalled(seconds)) => {
                format!(
                    "computer stalled or off for {} min: there are no data from this time",
                    seconds.div_ceil(60)
                )
            }
            (_, Figures::Withheld(readings)) => format!("{name}: {}", withheld_text(*readings)),
            (_, Figures::Left(left_pct)) => format!("battery at {left_pct:.0} %"),
            (kind, Figures::None) => plain_text(kind, &name, &place),
        }
    }

    /// Text of the action against the alert's problem; empty if there is none or if the alert has ended.
    pub fn advice(&self, around: &TextContext<'_>) -> String {
        if self.state != AlertState::Active {
            return String::new();
        }
        match (self.kind, &self.figures) {
            (_, Figures::Missed(causes, _, v_max_mps)) => {
                let from_m = self.bounds_m(around.section_m).0.unwrap_or(0.0);
                let back_to_m = around.sections.back_to_m(from_m);
                actions_text(&causes.actions(), back_to_m, causes.again_mps(*v_max_mps), around.heads)
            }
            (_, Figures::CannotSay(stretch)) => helps_text(&around.unsure(stretch)),
            (ListKind::TooFast, Figures::Advice(figures)) => speed_text("at most", figures.v_max_mps),
            (ListKind::TurnFails, Figures::Advice(figures)) => speed_text("go", figures.v_max_mps),
            (ListKind::NoPosition, _) => "hold still".to_owned(),
            (ListKind::PositionDoubtful, Figures::Error(_, true)) => "stand still for 30 s".to_owned(),
            (ListKind::PositionDoubtful, _) => {
                "go slower, or pass it again with a more certain position".to_owned()
            }
            (ListKind::NoSonar, _) => "stop".to_owned(),
            (ListKind::NoData, _) => "stop; check power, connections and ports".to_owned(),
            (ListKind::MountsUnverified, _) => "drive slowly and swing 5 degrees left and right".to_owned(),
            (ListKind::ComputerStalled, _) => {
                "hold a steady speed; close other programs on the computer".to_owned()
            }
            (_, Figures::Withheld(readings)) => withheld_action(readings.reason).to_owned(),
            (ListKind::NotRecorded, _) => "free disk space, or change the medium".to_owned(),
            (ListKind::CableLeft | ListKind::TimeLeft | ListKind::BatteryLeft, _) => "turn back".to_owned(),
            _ => String::new(),
        }
    }
}

fn plain_text(kind: ListKind, name: &str, place: &str) -> String {
    match kind {
        ListKind::SensorSilent => format!("{name} silent"),
        ListKind::SensorStalled => format!("{name} doesn't turn"),
        ListKind::SensorHung => format!("{name} is stuck: it repeats one reading"),
        ListKind::SensorDeaf => format!("{name} detects no wall"),
        ListKind::MountsUnverified => "mounts of the heads not verified".to_owned(),
        ListKind::NoSonar => "NO SONAR: no returns".to_owned(),
        ListKind::NoData => "NO DATA: nothing from any sensor".to_owned(),
        ListKind::NotRecorded => "NOT RECORDED: the recording fails, or its disk is too slow".to_owned(),
        ListKind::Missed => format!("MISSED {place}"),
        ListKind::TooFast => "TOO FAST".to_owned(),
        kind => kind.as_str().replace('_', " "),
    }
}

/// Prepends the place to a text about this chainage, m.
fn place_first(text: &str, x_m: f64) -> String {
    let place = station(x_m);
    let said = text.strip_prefix(&format!("ch {place}")).unwrap_or(text).trim_start();
    format!("{place}: {said}")
}
