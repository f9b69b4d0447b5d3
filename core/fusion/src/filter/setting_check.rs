//! Detection of wrong settings from the residuals of ranges against the design.
//!
//! Each setting is a parameter that is fitted to the residuals. Within a pose window of a few seconds, the vehicle's
//! pose explains as much of the residuals as it can, and the parameters explain the rest. The sums of pose windows are
//! added up over blocks of distance. Blocks are nearly independent of each other, so their scatter gives the
//! uncertainty of a parameter. For a head's tilt, each pose window is its own block. Summary: `docs/why/navigation.md`,
//! "Settings in doubt".
//!
//! A residual is r = x b. x is the error of the setting, and b depends on the setting as listed below. t is the
//! derivative of the range by rotation, p its derivative by position, and A the sonar's lever arm.
//!
//! - speed of sound, or a wider wall: b is the expected range
//! - head turned about its axis a: b = (t - A x p) . a
//! - head pitched or yawed on its mount: the same b about the axis of pitch or yaw, without its constant part

use serde::{Deserialize, Serialize};

use super::evidence::{Alternative, COMPARED, FOLLOWED, Fit, Line, POSE, SURE};
use super::head_tilt::TiltFit;
use super::measure::{self, Beam, ScalarUpdate, with_quantum};
use super::pose_window::PoseWindow;
use super::settings::Settings;
use super::sources::Source;
use super::state::{ATTITUDE, POSITION, State, vec};
use super::window::Waiting;
use crate::relative::Relative;
use headrace_geometry::frames::{Body, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::Reading;

/// Length of a pose window. The filter keeps its position for about this time, even if ranges are wrong.
const SPELL: DurNs = DurNs(5_000_000_000);
/// Minimum distance between two pose windows that count for a head's tilt, m. It is about the length of a bump.
const MOVES_ON_M: f64 = 0.2;
/// Least duration and length of a block of pose windows. A block that has not covered `BLOCK_M` after `LONGEST` is
/// dropped.
const BLOCK: DurNs = DurNs(20_000_000_000);
const BLOCK_M: f64 = 3.0;
const LONGEST: DurNs = DurNs(120_000_000_000);
/// Minimum number of readings in a block of pose windows.
const FEWEST_READINGS: u32 = 100;
/// Smallest setting errors that are reported: `LEAST_SCALE` as a share of the range, and `LEAST_ANGLE_RAD`.
const LEAST_SCALE: f64 = 0.015;
const LEAST_ANGLE_RAD: f64 = 0.03;
/// Largest standard deviation of a head's pitch and yaw at which its mount counts as verified, radians.
///
/// Then the smallest error that is reported, `LEAST_ANGLE_RAD`, is at least two standard deviations from zero.
const VERIFIED_RAD: f64 = LEAST_ANGLE_RAD / 2.0;
/// Residual beyond which a range loses weight (`FAR_M`), and beyond which it is ignored (`BEYOND_M`).
const FAR_M: f64 = 0.5;
const BEYOND_M: f64 = 2.0;
/// Maximum number of pairs of a sonar and an alternative mount.
const ALTERNATIVES: usize = FOLLOWED * FOLLOWED;
/// Mean square residual above which an echosounder counts as wrongly configured, m^2.
///
/// Such an echosounder pulls the estimate away from the truth, which makes correct heads look turned.
const ASTRAY_M2: f64 = 0.04;

/// A setting that is likely wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Setting {
    /// Ranges are too long by this share.
    ///
    /// Either the configured speed of sound is too high by this share, or the wall is wider than its design by it.
    RangeScale(f64),
    /// A head is rotated about its axis, relative to its configured mount, by this angle, radians.
    ///
    /// Adding the angle to the configured roll corrects the setting.
    HeadTurned(f64),
    /// A head is pitched on its mount by this angle, radians. Adding it to the configured pitch corrects the setting.
    HeadPitched(f64),
    /// A head is yawed on its mount by this angle, radians. Adding it to the configured yaw corrects the setting.
    HeadYawed(f64),
    /// A sensor faces the direction opposite to that of its configured mount.
    WrongWayRound,
    /// Two sources are swapped; the value is the number of the second source.
    Swapped(u16),
}

/// A setting that is likely wrong, with its source and certainty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SettingDoubt {
    /// The setting that is likely wrong.
    pub setting: Setting,
    /// Number of the source to which the setting belongs. `None` for a setting of all sources.
    pub source: Option<u16>,
    /// Distance of the setting from its configured value, in standard deviations.
    pub sure_sd: f64,
}

impl Setting {
    /// Name of the setting in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::RangeScale(_) => "range_scale",
            Self::HeadTurned(_) => "head_turned",
            Self::HeadPitched(_) => "head_pitched",
            Self::HeadYawed(_) => "head_yawed",
            Self::WrongWayRound => "wrong_way_round",
            Self::Swapped(_) => "swapped",
        }
    }

    /// Returns the size of the setting error, a share or an angle in radians; 0 if it has no size.
    pub fn figure(self) -> f64 {
        match self {
            Self::RangeScale(figure)
            | Self::HeadTurned(figure)
            | Self::HeadPitched(figure)
            | Self::HeadYawed(figure) => figure,
            Self::WrongWayRound | Self::Swapped(_) => 0.0,
        }
    }

    /// Returns the angle by which a head differs from its configured mount, radians; `None` for other settings.
    pub fn angle_rad(self) -> Option<f64> {
        match self {
            Self::HeadTurned(by_rad) | Self::HeadPitched(by_rad) | Self::HeadYawed(by_rad) => Some(by_rad),
            Self::RangeScale(_) | Self::WrongWayRound | Self::Swapped(_) => None,
        }
    }

    /// Whether the setting is the direction of a head's axis. If this direction is wrong, the head's samples are
    /// displaced along the tunnel.
    pub fn is_of_pointing(self) -> bool {
        match self {
            Self::HeadPitched(_) | Self::HeadYawed(_) | Self::WrongWayRound | Self::Swapped(_) => true,
            Self::RangeScale(_) | Self::HeadTurned(_) => false,
        }
    }

    /// Returns the number of the second of two swapped sources; `None` for other settings.
    pub fn other(self) -> Option<u16> {
        match self {
            Self::Swapped(other) => Some(other),
            _ => None,
        }
    }
}

impl SettingDoubt {
    /// Whether two doubts concern the same setting. Its values may differ.
    pub fn is_of_same(&self, other: &Self) -> bool {
        self.source == other.source
            && self.setting.as_str() == other.setting.as_str()
            && self.setting.other() == other.setting.other()
    }
}

/// Context for the prediction of ranges.
#[derive(Debug, Clone, Copy)]
pub struct Design<'a> {
    /// Design profile of the tunnel.
    pub profile: &'a Profile,
    /// Water and location of the tunnel.
    pub site: &'a Site,
    /// Noise settings of the sensors.
    pub settings: &'a Settings,
    /// Position of the inertial unit on the vehicle.
    pub unit_at: Vec3<Body>,
}

/// A measured range with its beam, to be compared with the design.
struct Look {
    beam: Beam,
    range_m: f64,
    sd_m: f64,
}

/// A range as used in the fits: its derivatives with respect to the vehicle's pose and to a rotation of the head, its
/// expected value, residual and weight.
struct Seen {
    by_pose: [f64; POSE],
    own_turn: Vec3<Tunnel>,
    expected_m: f64,
    residual_m: f64,
    weight: f64,
}

/// Sums over a block of pose windows, with the block's start and number of readings.
///
/// The vehicle's pose is already eliminated from the sums.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Block {
    begun: Option<(MonoNs, f64)>,
    readings: u32,
    scale: [f64; 2],
    turned: [[f64; 2]; FOLLOWED],
}

/// Fits of all settings that are checked.
#[derive(Debug, Clone)]
pub struct SettingChecks {
    block: Block,
    spell: PoseWindow,
    followed: [Option<u16>; FOLLOWED],
    scale: Fit,
    turned: [Fit; FOLLOWED],
    tilted: [[TiltFit; 2]; FOLLOWED],
    alternatives: Vec<Alternative>,
    /// For each checked source: number of readings (`heard`), and observed share of the declared variance, at most 1
    /// (`levels`).
    heard: [u32; FOLLOWED],
    levels: [f64; FOLLOWED],
    /// Smallest standard deviations so far of each head's pitch and yaw on its mount, radians; infinite at first.
    ///
    /// The smallest ones count, because mounts do not change during a dive. `None` for a source that is not a head.
    mounts: [Option<[f64; 2]>; FOLLOWED],
    /// Chainage of the vehicle, m.
    here_m: f64,
    /// Chainage of the last pose window that counted for the tilt of a head, m; `None` before the first.
    tilted_at_m: Option<f64>,
    doubt: Option<SettingDoubt>,
}

stateful!(SettingChecks { state: block, spell, followed, scale, turned, tilted, heard, levels, mounts, here_m, tilted_at_m, doubt; lists: alternatives; });

impl Default for SettingChecks {
    /// Creates the checks with allocated buffers, but no readings.
    fn default() -> Self {
        Self {
            block: Block::default(),
            spell: PoseWindow::default(),
            followed: [None; FOLLOWED],
            scale: Fit::default(),
            turned: [Fit::default(); FOLLOWED],
            tilted: [[TiltFit::default(); 2]; FOLLOWED],
            alternatives: Vec::with_capacity(ALTERNATIVES),
            heard: [0; FOLLOWED],
            levels: [1.0; FOLLOWED],
            mounts: [None; FOLLOWED],
            here_m: 0.0,
            tilted_at_m: None,
            doubt: None,
        }
    }
}

impl SettingChecks {
    /// Returns the setting that explains the residuals best, among those that are certainly wrong.
    ///
    /// `share` is the estimated scale error of all ranges, and `sd` its standard deviation. The residuals no longer
    /// contain the effect of this scale error.
    pub fn doubt(&self, [share, sd]: [f64; 2]) -> Option<SettingDoubt> {
        let sure_sd = share.abs() / sd.max(f64::MIN_POSITIVE);
        let is_scaled = self.scale.is_settled() && share.abs() >= LEAST_SCALE && sure_sd >= SURE;
        let setting = Setting::RangeScale(share);
        self.doubt.or_else(|| is_scaled.then_some(SettingDoubt { setting, source: None, sure_sd }))
    }

    /// Whether the ranges have not yet verified the pitch and yaw of all heads on their mounts.
    ///
    /// Ranges verify pitch and yaw of a mount while the vehicle swings from side to side. A single head needs no check,
    /// because a wrong mount moves all of its samples alike.
    pub fn has_unverified_mounts(&self) -> bool {
        self.compared_heads().flatten().any(|sd_rad| *sd_rad > VERIFIED_RAD)
    }

    /// Returns the relative covariance that mount errors cause between samples of two heads.
    ///
    /// `declared_rad` is the declared standard deviation of a head's pitch and yaw on its mount. Ranges do not reduce
    /// this covariance, even if the vehicle swings, because each head is compared with heads whose mounts are just as
    /// uncertain.
    pub fn mount_error(&self, declared_rad: f64) -> Relative {
        let is_compared = self.compared_heads().next().is_some();
        let variance = if is_compared { 2.0 * declared_rad * declared_rad } else { 0.0 };
        Relative::new([[0.0; 3], [0.0, variance, 0.0], [0.0, 0.0, variance]])
    }

    /// Standard deviations of each head's pitch and yaw on its mount, if there are several heads.
    fn compared_heads(&self) -> impl Iterator<Item = &[f64; 2]> {
        let heads = self.mounts.iter().flatten();
        let several = heads.clone().count() > 1;
        heads.filter(move |_| several)
    }

    /// Processes a reading before it is fused; `state` is the estimate at the time of the reading.
    ///
    /// Allocates: never.
    pub fn hear(
        &mut self,
        state: &State,
        design: &Design<'_>,
        sources: &[Option<Source>],
        waiting: &Waiting,
    ) {
        let Some(info) = info(sources, waiting.source) else { return };
        let Some(look) = look(info, design, &waiting.reading) else { return };
        let Some(slot) = self.slot(waiting.source) else { return };
        let x_m = state.position.x();
        self.here_m = x_m;
        let spell_begun = *self.spell.begun.get_or_insert(waiting.at);
        if !(0..SPELL.0).contains(&waiting.at.since(spell_begun).0) {
            self.end_spell();
        }
        let (begun, from_m) = *self.block.begun.get_or_insert((waiting.at, x_m));
        let (lasted, moved_m) = (waiting.at.since(begun).0, (x_m - from_m).abs());
        if lasted >= BLOCK.0 && moved_m >= BLOCK_M {
            self.close();
        } else if !(0..LONGEST.0).contains(&lasted) {
            self.give_up();
        }
        let Some(row) = expect(state, design, &look) else { return };
        if let (Some(level), Some(Some(source))) = (self.levels.get_mut(slot), sources.get(waiting.source)) {
            *level = source.noise_level.smoothness().unwrap_or(1.0);
        }
        if let Some(heard) = self.heard.get_mut(slot) {
            *heard = heard.wrapping_add(1);
            if heard.is_multiple_of(COMPARED) {
                self.compare(state, design, sources, waiting, row.residual);
            }
        }
        if row.residual.abs() > BEYOND_M {
            return;
        }
        let place = vec::<Tunnel>(&row.h, POSITION);
        let arm = state.attitude * look.beam.offset;
        let turn = vec::<Tunnel>(&row.h, ATTITUDE);
        let own_turn = turn + -arm.cross(&place);
        let expected_m = look.range_m - row.residual;
        let by_pose = [place.y(), place.z(), turn.x(), turn.y(), turn.z()];
        // The residual is taken with and without the known scale error, and the smaller one counts. So a scale error
        // does not turn a range into an outlier.
        let scale = self.scale.estimate().map_or(0.0, |[scale, _]| scale);
        let off_m = row.residual.abs().min((row.residual - scale * expected_m).abs());
        let weight = (FAR_M / off_m.max(FAR_M)) / row.noise;
        self.block.readings += 1;
        self.spell.add(by_pose, row.residual, weight);
        self.spell.scale.add(by_pose, expected_m, row.residual, weight);
        if info.kind == SensorKind::Head {
            let seen = Seen { by_pose, own_turn, expected_m, residual_m: row.residual, weight };
            self.hear_head(slot, &info.mount.rotation, (state, &look.beam), &seen);
        }
    }

    /// Adds a head's return to the fits of the head's mount.
    fn hear_head(
        &mut self,
        slot: usize,
        mount: &Rot<Body, Sensor>,
        (state, beam): (&State, &Beam),
        seen: &Seen,
    ) {
        let Seen { by_pose, own_turn, expected_m, residual_m, weight } = *seen;
        if let Some(mount) = self.mounts.get_mut(slot) {
            mount.get_or_insert([f64::INFINITY; 2]);
        }
        let axis = state.attitude * (*mount * Vec3::<Sensor>::new(1.0, 0.0, 0.0));
        if let Some(line) = self.spell.turned.get_mut(slot) {
            line.add(by_pose, own_turn.dot(&axis), residual_m, weight);
        }
        let along = state.attitude * beam.along;
        for (line, axis) in self.spell.tilted.get_mut(slot).into_iter().flatten().zip(tilt_axes(mount)) {
            let axis = state.attitude * axis;
            let leans = axis.cross(&along).x();
            line.add(by_pose, own_turn.dot(&axis), expected_m * leans * leans, residual_m, weight);
        }
    }

    /// Returns the index of a source among the sources that are checked; adds the source if there is room.
    fn slot(&mut self, source: usize) -> Option<usize> {
        let source = u16::try_from(source).ok()?;
        let place = self.followed.iter().position(|known| known.is_none_or(|known| known == source))?;
        *self.followed.get_mut(place)? = Some(source);
        Some(place)
    }

    /// Compares a range with predictions for alternative mounts of its sonar.
    ///
    /// The alternatives are the mounts of other sources of the same kind, and the source's own mount turned by half a
    /// turn.
    fn compare(
        &mut self,
        state: &State,
        design: &Design<'_>,
        sources: &[Option<Source>],
        waiting: &Waiting,
        missed_m: f64,
    ) {
        let Some(own) = info(sources, waiting.source) else { return };
        for other in self.followed.iter().flatten() {
            let Some(theirs) = info(sources, usize::from(*other)) else { continue };
            let is_own = usize::from(*other) == waiting.source;
            if core::mem::discriminant(&theirs.kind) != core::mem::discriminant(&own.kind) {
                continue;
            }
            let Some(mut look) = look(&SensorInfo { mount: theirs.mount, ..*own }, design, &waiting.reading)
            else {
                continue;
            };
            if is_own {
                look.beam.along =
                    own.mount.rotation * (round() * (own.mount.rotation.inverse() * look.beam.along));
            }
            let Some(row) = expect(state, design, &look) else { continue };
            let Ok(source) = u16::try_from(waiting.source) else {
                debug_assert!(false, "source {}, which is followed, has a short number", waiting.source);
                continue;
            };
            let is_echo = own.kind != SensorKind::Head;
            note(&mut self.alternatives, (source, *other, is_echo), [missed_m, row.residual]);
        }
    }

    fn end_spell(&mut self) {
        let spell = core::mem::take(&mut self.spell);
        let Some(factor) = spell.factor() else { return };
        let add = |sums: &mut [f64; 2], line: &Line| {
            for (sum, part) in sums.iter_mut().zip(spell.freed(line, &factor)) {
                *sum += part;
            }
        };
        add(&mut self.block.scale, &spell.scale);
        for (sums, line) in self.block.turned.iter_mut().zip(&spell.turned) {
            add(sums, line);
        }
        if self.tilted_at_m.is_none_or(|last_m| (self.here_m - last_m).abs() >= MOVES_ON_M) {
            self.tilted_at_m = Some(self.here_m);
            for (fit, line) in self.tilted.iter_mut().flatten().zip(spell.tilted.iter().flatten()) {
                fit.add(line.freed(spell.residuals, &factor));
            }
        }
        self.note_mounts();
        self.doubt = self.likeliest();
    }

    /// Updates the standard deviations of each head's pitch and yaw on its mount.
    fn note_mounts(&mut self) {
        for ((head, fits), level) in self.mounts.iter_mut().zip(&self.tilted).zip(self.levels) {
            for (least_rad, fit) in head.iter_mut().flatten().zip(fits) {
                *least_rad = least_rad.min(fit.sd_rad(level).unwrap_or(f64::INFINITY));
            }
        }
    }

    fn give_up(&mut self) {
        self.spell = PoseWindow::default();
        self.block = Block::default();
        for alternative in &mut self.alternatives {
            alternative.block = [0.0; 3];
        }
    }

    /// Ends a block of pose windows, and adds its sums to the fits of settings.
    fn close(&mut self) {
        self.end_spell();
        if self.block.readings >= FEWEST_READINGS {
            let readings = self.block.readings;
            self.scale.add(self.block.scale, readings);
            for (fit, sums) in self.turned.iter_mut().zip(self.block.turned) {
                fit.add(sums, readings);
            }
            for alternative in &mut self.alternatives {
                alternative.close();
            }
            self.doubt = self.likeliest();
        }
        self.give_up();
    }

    fn likeliest(&self) -> Option<SettingDoubt> {
        let mut best: Option<(f64, SettingDoubt)> = None;
        let mut propose = |explains: f64, doubt: SettingDoubt| {
            if best.is_none_or(|(before, _)| explains > before) {
                best = Some((explains, doubt));
            }
        };
        if let Some((share, sure_sd)) = self.scale.certain(LEAST_SCALE) {
            let setting = Setting::RangeScale(share);
            propose(self.scale.explains(), SettingDoubt { setting, source: None, sure_sd });
        }
        let is_astray = self.alternatives.iter().any(|of| of.is_echo && of.all[0] > ASTRAY_M2 * of.all[2]);
        for (source, fit) in self.followed.iter().zip(&self.turned) {
            if let Some((by_rad, sure_sd)) = fit.certain(LEAST_ANGLE_RAD).filter(|_| !is_astray) {
                let setting = Setting::HeadTurned(by_rad);
                propose(fit.explains(), SettingDoubt { setting, source: *source, sure_sd });
            }
        }
        for ((source, fits), level) in self.followed.iter().zip(&self.tilted).zip(self.levels) {
            for (fit, setting) in fits.iter().zip([Setting::HeadPitched, Setting::HeadYawed]) {
                if let Some((by_rad, sure_sd)) = fit.certain(LEAST_ANGLE_RAD, level).filter(|_| !is_astray) {
                    propose(
                        fit.explains(),
                        SettingDoubt { setting: setting(by_rad), source: *source, sure_sd },
                    );
                }
            }
        }
        for own in &self.alternatives {
            let source = Some(own.source);
            if own.source == own.other {
                if let Some(sure_sd) = own.certain(own.share_left()) {
                    let setting = Setting::WrongWayRound;
                    propose(own.explains(), SettingDoubt { setting, source, sure_sd });
                }
                continue;
            }
            let is_return = |other: &&Alternative| (other.source, other.other) == (own.other, own.source);
            let Some(other) = self.alternatives.iter().find(is_return) else { continue };
            let left = (own.all[1] + other.all[1]) / (own.all[0] + other.all[0]).max(f64::MIN_POSITIVE);
            let sure_sd = own.certain(left).zip(other.certain(left));
            if let Some((own_sd, other_sd)) = sure_sd.filter(|_| own.source < own.other) {
                let (setting, sure_sd) = (Setting::Swapped(own.other), own_sd.min(other_sd));
                propose(own.explains() + other.explains(), SettingDoubt { setting, source, sure_sd });
            }
        }
        best.map(|(_, doubt)| doubt)
    }
}

fn info(sources: &[Option<Source>], number: usize) -> Option<&SensorInfo> {
    let source = sources.get(number)?.as_ref();
    debug_assert!(source.is_some(), "source {number}, which has readings, is known");
    source.map(|source| &source.sensor)
}

/// Returns the axes about which a mount is pitched and yawed, in the body frame.
fn tilt_axes(mount: &Rot<Body, Sensor>) -> [Vec3<Body>; 2] {
    let ahead = *mount * Vec3::<Sensor>::new(1.0, 0.0, 0.0);
    let level = math::hypot(ahead.x(), ahead.y()).max(f64::MIN_POSITIVE);
    [Vec3::new(-ahead.y() / level, ahead.x() / level, 0.0), Vec3::new(0.0, 0.0, 1.0)]
}

/// Returns a rotation by half a turn about the z axis of the sensor's frame.
fn round() -> Rot<Sensor, Sensor> {
    Rot::from_roll_pitch_yaw(0.0, 0.0, math::PI)
}

/// Interprets a reading of a source with this mount; `None` if the reading has no range.
fn look(info: &SensorInfo, design: &Design<'_>, reading: &Reading) -> Option<Look> {
    let Design { site, settings, unit_at, .. } = design;
    let (along, range_m, first_rad, unsure_rad, sd_m) = match (info.kind, reading) {
        (SensorKind::Head, Reading::Sonar(sonar)) => (
            head_direction(sonar.angle_rad),
            site.rescaled_range_m(sonar.range_m?, sonar.sound_speed_mps),
            settings.return_beam_rad / 2.0,
            0.0,
            with_quantum(settings.return_sd_m, sonar.resolution_m),
        ),
        (SensorKind::Echosounder { .. }, Reading::Echo(echo)) => (
            Vec3::new(1.0, 0.0, 0.0),
            site.rescaled_range_m(echo.range_m?, echo.sound_speed_mps),
            0.0,
            settings.echo_beam_rad / 2.0,
            settings.echo_sd_m,
        ),
        _ => return None,
    };
    let offset = info.mount.position + -*unit_at;
    let beam = Beam { offset, along: info.mount.rotation * along, first_rad, unsure_rad };
    Some(Look { beam, range_m, sd_m })
}

fn expect(state: &State, design: &Design<'_>, look: &Look) -> Option<ScalarUpdate> {
    measure::range(state, design.profile, &look.beam, look.range_m, look.sd_m)
}

fn note(alternatives: &mut Vec<Alternative>, (source, other, is_echo): (u16, u16, bool), missed_m: [f64; 2]) {
    let known = alternatives.iter().position(|known| (known.source, known.other) == (source, other));
    let place = known.unwrap_or(alternatives.len());
    if known.is_none() {
        if alternatives.len() >= ALTERNATIVES {
            return;
        }
        alternatives.push(Alternative { source, other, is_echo, ..Alternative::default() });
    }
    if let Some(alternative) = alternatives.get_mut(place) {
        alternative.note(missed_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_misalignment_settings_have_an_angle() {
        for by_rad in [0.05, -0.02] {
            for setting in
                [Setting::HeadTurned(by_rad), Setting::HeadPitched(by_rad), Setting::HeadYawed(by_rad)]
            {
                assert_eq!((setting.angle_rad(), setting.figure()), (Some(by_rad), by_rad));
            }
        }
        for setting in [Setting::RangeScale(0.03), Setting::WrongWayRound, Setting::Swapped(3)] {
            assert_eq!(setting.angle_rad(), None, "{setting:?}");
        }
    }
}
