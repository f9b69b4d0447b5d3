//! Dives with injected causes, drawn from a seed. Their vehicle and scene files can be written with any of the causes
//! removed.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use headrace_coverage::Cause;
use headrace_geometry::math;

use crate::random_dives::Draw;

/// Chainage at which dives begin, m.
pub(super) const START_M: f64 = 3.0;
/// Distance that a vehicle drives beyond the far end of the dive, m. A vehicle that turns back too early stops at the
/// same distance before the far end.
const ON_M: f64 = 4.5;
/// Distance over which the vehicle rolls before a pass in a rolled attitude, m.
const ROLLS_OVER_M: f64 = 1.0;

/// Tables of the sensors that determine the vehicle's position. No part of the hull blocks their beams.
const SENSORS: &str = r#"[[sensors]]
id = "left"
plugin = "ping1d"
position_m = [0, 0.3, 0]
angles_deg = [0, 0, 90]
[[sensors]]
id = "right"
plugin = "ping1d"
position_m = [0, -0.3, 0]
angles_deg = [0, 0, -90]
[[sensors]]
id = "up"
plugin = "ping1d"
position_m = [0, 0, 0.35]
angles_deg = [0, -90, 0]
[[sensors]]
id = "down"
plugin = "ping1d"
position_m = [0, 0, -0.1]
angles_deg = [0, 90, 0]
[[sensors]]
id = "depth"
plugin = "bar100"
[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"
[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

/// A cause that is injected into a dive, so that sections fail.
#[expect(missing_docs, reason = "the variants name their fields")]
#[derive(Debug, Clone, PartialEq)]
pub enum Injected {
    /// The vehicle drives over a stretch at `factor` times the dive's speed.
    TooFast { over_m: [f64; 2], factor: f64 },
    /// A mode of the heads with coarser angular steps.
    AngularStep { mode: &'static str },
    /// Missing returns; `keys` are the keys of the simulator effect.
    MissingReturns { keys: String },
    /// A range setting of the heads that is shorter than the distance to the wall, m.
    OutOfRange { range_m: u32 },
    /// Parts of the vehicle hide the wall from the beams. Vehicle files always declare these parts.
    Occluded,
    /// The vehicle is offset from the centre line by [y, z], m.
    Aside { over_m: [f64; 2], by_m: [f64; 2] },
    /// The vehicle yaws back and forth.
    Swing { over_m: [f64; 2], yaw_deg: f64, every_s: f64 },
    /// The heads start with these phase offsets, degrees.
    Phase { offsets_deg: Vec<f64> },
    /// A head that stalls now and then.
    HeadStalled { head: usize, per_hour: f64 },
    /// Some heads are silent over a stretch.
    HeadSilent { heads: Vec<usize>, over_m: [f64; 2] },
    /// A sensor that determines the position is silent over a stretch.
    PositionLost { sensor: &'static str, over_m: [f64; 2] },
    /// A vehicle that turns back before the end.
    NotPassed,
}

impl Injected {
    /// Cause that the program should report for the injected cause.
    pub fn cause(&self) -> Cause {
        match self {
            Self::TooFast { .. } => Cause::TooFast,
            Self::AngularStep { .. } => Cause::AngularStep,
            Self::MissingReturns { .. } => Cause::MissingReturns,
            Self::OutOfRange { .. } => Cause::OutOfRange,
            Self::Occluded => Cause::Occluded,
            Self::Aside { .. } | Self::Swing { .. } => Cause::OffAxis,
            Self::Phase { .. } => Cause::Phase,
            Self::HeadStalled { .. } => Cause::HeadStalled,
            Self::HeadSilent { .. } => Cause::HeadSilent,
            Self::PositionLost { .. } => Cause::PositionLost,
            Self::NotPassed => Cause::NotPassed,
        }
    }
}

/// Cross-section of the tunnel in a drawn dive.
#[derive(Debug, Clone)]
struct Tunnel {
    keys: String,
    /// Distance from the centre line to the farthest wall, m.
    far_m: f64,
    /// Distance from the centre line to the nearest wall, m.
    near_m: f64,
    middle_m: [f64; 2],
    range_m: u32,
}

/// A dive with injected causes, drawn from a seed.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// Seed from which the dive is drawn.
    pub seed: u64,
    /// Seed of the noise in the dive's effects.
    noise: u64,
    /// Causes injected into the dive.
    pub injected: Vec<Injected>,
    /// Chainage of the far end of the dive, m.
    pub end_m: f64,
    /// Speed without injected causes, m/s.
    pub speed_mps: f64,
    /// Target T, m. Until the dive has been simulated, this is only an estimate.
    pub target_m: f64,
    /// Ratio of the target to the largest hole without injected causes.
    pub margin: f64,
    tunnel: Tunnel,
    mode: &'static str,
    /// Tables of the heads in the vehicle file, without the keys for mode and range.
    heads: Vec<String>,
    hull: &'static str,
    way: &'static str,
    /// Whether heads hide the wall from each other in addition to the injected causes.
    in_each_others_way: bool,
    swaying: bool,
    /// A stretch on which the vehicle obeys a speed limit, and the limit in m/s.
    at_most: Option<([f64; 2], f64)>,
    /// A stretch that the vehicle passes again at the end of the dive, and the angle by which it then rolls to each
    /// side, degrees.
    again: Option<([f64; 2], f64)>,
}

/// Turn time in seconds and step in degrees of each mode. Source: Jorge et al. 2021, Table 2.
const MODES: [(&str, f64, f64); 4] =
    [("medium", 10.8, 0.6), ("fast", 8.0, 0.9), ("faster", 6.6, 1.2), ("fastest", 4.8, 2.4)];

/// A box on top of the vehicle that hides the wall above the heads.
const HULL: &str = "[[hull]]\nleast_m = [-0.7, -0.25, 0.1]\nmost_m = [0.7, 0.25, 0.3]\n";

fn tunnel(draw: &mut Draw) -> Tunnel {
    match draw.below(3) {
        0 => Tunnel {
            keys: "profile = \"ceran\"".to_owned(),
            far_m: 6.3,
            near_m: 5.0,
            middle_m: [0.0, 4.0],
            range_m: 10,
        },
        1 => {
            let radius_m = draw.between(2.3, 3.2);
            let keys = format!("profile = \"circle\"\nradius_m = {radius_m:.2}");
            Tunnel { keys, far_m: radius_m, near_m: radius_m, middle_m: [0.0, radius_m], range_m: 5 }
        }
        _ => {
            let [width_m, height_m] = [draw.between(3.5, 5.5), draw.between(3.0, 4.5)];
            let keys = format!("profile = \"rectangle\"\nwidth_m = {width_m:.2}\nheight_m = {height_m:.2}");
            Tunnel {
                keys,
                far_m: math::hypot(width_m, height_m) / 2.0,
                near_m: width_m.min(height_m) / 2.0,
                middle_m: [0.0, height_m / 2.0],
                range_m: 5,
            }
        }
    }
}

/// Positions of the heads: in a line along the hull, or in a front pair and an aft pair side by side.
fn heads(count: usize, side_by_side: bool) -> Vec<String> {
    let place = |head: usize| {
        if !side_by_side {
            return format!("position_m = [{:.2}, 0, 0]\nangles_deg = [0, 0, 0]\n", 0.55 - 0.3 * head as f64);
        }
        let (x_m, yaw) = if head < 2 { (0.551, 0) } else { (-0.551, 180) };
        let y_m = if head.is_multiple_of(2) { 0.15 } else { -0.15 };
        format!("position_m = [{x_m}, {y_m}, 0]\nangles_deg = [0, 0, {yaw}]\n")
    };
    (0..count).map(place).collect()
}

/// The eleven causes that can be injected.
pub const KINDS: [Cause; 11] = [
    Cause::TooFast,
    Cause::AngularStep,
    Cause::MissingReturns,
    Cause::OutOfRange,
    Cause::Occluded,
    Cause::OffAxis,
    Cause::Phase,
    Cause::HeadStalled,
    Cause::HeadSilent,
    Cause::PositionLost,
    Cause::NotPassed,
];

impl Drawn {
    /// Draws the dive of a seed. `kinds` are the kinds of its causes, as indices of [`KINDS`].
    pub fn of(seed: u64, kinds: &[usize]) -> Self {
        let mut draw = Draw::new(seed);
        let causes: Vec<Cause> = kinds.iter().map(|kind| KINDS[*kind]).collect();
        let has = |cause: Cause| causes.contains(&cause);
        let mut tunnel = tunnel(&mut draw);
        while has(Cause::OutOfRange) && tunnel.near_m > 2.4 && tunnel.range_m == 5 && tunnel.far_m < 2.6 {
            tunnel = self::tunnel(&mut draw);
        }
        let several = has(Cause::Phase) || has(Cause::HeadSilent);
        let count = if several { 2 + draw.below(3) } else { 1 + draw.below(4) };
        let side_by_side = draw.below(2) == 0;
        let mode = if has(Cause::AngularStep) { 1 + draw.below(2) } else { draw.below(4) };
        let (mode, turn_s, step_deg) = MODES[mode];
        let step_m = tunnel.far_m * step_deg.to_radians();
        // Ratio of the distance between passes (T_x) to the step along the wall (T_y).
        let ratio = if has(Cause::AngularStep) { draw.between(0.8, 1.1) } else { draw.between(2.5, 5.0) };
        let gap_s = turn_s / count as f64;
        let speed_mps = (ratio * step_m / gap_s).clamp(0.03, 0.35);
        let length_m = (speed_mps * draw.between(110.0, 150.0)).clamp(9.0, 22.0);
        let mut drawn = Self {
            seed,
            noise: seed,
            injected: Vec::new(),
            end_m: START_M + length_m,
            speed_mps,
            target_m: 1.3 * math::hypot(speed_mps * gap_s, step_m),
            margin: draw.between(1.12, 1.35),
            tunnel,
            mode,
            heads: heads(count, side_by_side),
            hull: if has(Cause::Occluded) { HULL } else { "" },
            way: if draw.below(3) == 0 { "filter" } else { "direct" },
            in_each_others_way: !has(Cause::Occluded) && side_by_side && draw.below(2) == 0,
            swaying: draw.below(2) == 0,
            at_most: None,
            again: None,
        };
        for cause in causes {
            let injected = drawn.inject(cause, &mut draw);
            drawn.injected.push(injected);
        }
        drawn
    }

    /// The same dive with other random noise, which the number `noise` selects.
    #[must_use]
    pub fn with_noise(&self, noise: u64) -> Self {
        Self { noise: self.seed + 1_000_000 * noise, ..self.clone() }
    }

    /// The same dive without the causes that `without` selects, and with a speed limit (m/s) on a stretch.
    ///
    /// If a roll angle `again_deg` is given, the vehicle also passes this stretch again, rolled by this angle.
    #[must_use]
    pub fn changed(
        &self,
        without: &dyn Fn(&Injected) -> bool,
        over_m: [f64; 2],
        at_most_mps: f64,
        again_deg: Option<f64>,
    ) -> Self {
        let injected = self.injected.iter().filter(|injected| !without(injected)).cloned().collect();
        let at_most = (at_most_mps > 0.0).then_some((over_m, at_most_mps));
        Self { injected, at_most, again: again_deg.map(|deg| (over_m, deg)), ..self.clone() }
    }

    fn over_m(&self, draw: &mut Draw, least_m: f64, most_m: f64) -> [f64; 2] {
        let most_m = most_m.min(0.5 * (self.end_m - START_M));
        let length_m = draw.between(least_m.min(most_m), most_m);
        let from_m = draw.between(START_M + 2.5, self.end_m - 2.5 - length_m);
        [from_m, from_m + length_m]
    }

    fn inject(&self, cause: Cause, draw: &mut Draw) -> Injected {
        let count = self.heads.len();
        match cause {
            Cause::TooFast => {
                Injected::TooFast { over_m: self.over_m(draw, 3.0, 8.0), factor: draw.between(1.7, 3.5) }
            }
            Cause::AngularStep => Injected::AngularStep { mode: "fastest" },
            Cause::MissingReturns => {
                let far_m = self.tunnel.near_m + 0.5 * (self.tunnel.far_m - self.tunnel.near_m);
                let keys = if draw.below(4) == 0 && self.tunnel.far_m - self.tunnel.near_m > 0.5 {
                    format!("far_from_m = {far_m:.2}\nfar_to_m = {far_m:.2}\n")
                } else {
                    let share = draw.between(0.3, 0.6);
                    format!("share = {share:.2}\nmean_run = {}\n", 15 + draw.below(45))
                };
                Injected::MissingReturns { keys }
            }
            Cause::OutOfRange => {
                let short = if self.tunnel.range_m == 10 { 5 } else { 2 };
                Injected::OutOfRange { range_m: short }
            }
            Cause::Occluded => Injected::Occluded,
            Cause::OffAxis if draw.below(4) == 0 => {
                let off_m = 0.6 * self.tunnel.near_m;
                let angle = draw.between(0.0, TAU);
                let by_m = [off_m * math::cos(angle), 0.8 * off_m * math::sin(angle)];
                Injected::Aside { over_m: self.over_m(draw, 4.0, 9.0), by_m }
            }
            Cause::OffAxis => Injected::Swing {
                over_m: self.over_m(draw, 4.0, 9.0),
                yaw_deg: draw.between(9.0, 18.0),
                every_s: draw.between(5.0, 9.0),
            },
            Cause::Phase => {
                let mut offsets_deg = vec![0.0; count];
                // With these offsets, all heads always look in almost the same direction, so their passes leave gaps.
                for (head, offset_deg) in offsets_deg.iter_mut().enumerate().skip(1) {
                    let together_deg = 360.0 * head as f64 / count as f64;
                    *offset_deg = math::wrap_signed(together_deg * draw.between(0.7, 1.0), 360.0);
                }
                Injected::Phase { offsets_deg }
            }
            Cause::HeadStalled => {
                Injected::HeadStalled { head: draw.below(count), per_hour: draw.between(60.0, 150.0) }
            }
            Cause::HeadSilent => {
                let mut heads: Vec<usize> = (0..count).collect();
                while heads.len() > 1 && draw.below(4) != 0 {
                    heads.remove(draw.below(heads.len()));
                }
                Injected::HeadSilent { heads, over_m: self.over_m(draw, 4.0, 9.0) }
            }
            Cause::PositionLost => {
                let sensor = if self.way == "direct" { draw.one_of(&["tether", "imu"]) } else { "imu" };
                Injected::PositionLost { sensor, over_m: self.over_m(draw, 4.0, 8.0) }
            }
            Cause::NotPassed | Cause::Unknown => Injected::NotPassed,
        }
    }

    /// Vehicle file with the injected causes that `is_in` selects.
    pub fn vehicle(&self, is_in: &dyn Fn(usize) -> bool) -> String {
        let (mut mode, mut range_m) = (self.mode, self.tunnel.range_m);
        for injected in self.present(is_in) {
            match injected {
                Injected::AngularStep { mode: coarse } => mode = coarse,
                Injected::OutOfRange { range_m: short } => range_m = *short,
                _ => {}
            }
        }
        let mut text = format!(
            "target_m = {:.4}\n[tunnel]\n{}\nlength_m = 60\n[navigation]\nway = \"{}\"\nslack_sd_m = 0.01\n\
             [heads]\nplanned_speed_mps = {:.4}\n{}",
            self.target_m, self.tunnel.keys, self.way, self.speed_mps, self.hull
        );
        for (head, place) in self.heads.iter().enumerate() {
            write!(
                text,
                "[[sensors]]\nid = \"sonar_{head}\"\nplugin = \"imagenex881\"\nmode = \"{mode}\"\n\
                 range_m = {range_m}\nmin_range_m = 0.35\n{place}"
            )
            .unwrap();
        }
        text + SENSORS
    }

    /// Scene file with the injected causes that `is_in` selects.
    pub fn scene(&self, is_in: &dyn Fn(usize) -> bool) -> String {
        let path = self.path(is_in);
        let mut text = format!("seed = {}\nvehicle = \"vehicle.toml\"\n{}", self.noise, path.text());
        text.push_str(
            "[effects.motion_within_turn]\n[effects.range_noise]\nsd_m = 0.01\n\
             [effects.imu_noise]\ngyro_degps_rthz = 0.003\n",
        );
        if self.swaying {
            text.push_str(
                "[effects.pilot_drift]\nacross_m = 0.08\nup_m = 0.05\nyaw_deg = 0.7\nperiod_s = 25\n",
            );
        }
        if self.in_each_others_way {
            text.push_str("[effects.occlusion]\n");
        }
        for injected in self.present(is_in) {
            effect(injected, &path, self.heads.len(), &mut text);
        }
        text
    }

    fn present(&self, is_in: &dyn Fn(usize) -> bool) -> impl Iterator<Item = &Injected> {
        self.injected.iter().enumerate().filter(move |(k, _)| is_in(*k)).map(|(_, injected)| injected)
    }

    fn path(&self, is_in: &dyn Fn(usize) -> bool) -> Path {
        let mut ends = vec![START_M, self.end_m];
        for injected in self.present(is_in) {
            match injected {
                Injected::TooFast { over_m, .. } | Injected::Aside { over_m, .. } => ends.extend(over_m),
                Injected::Swing { over_m, every_s, .. } => {
                    let every_m = every_s * self.speed_mps;
                    let count = math::floor_to_i64((over_m[1] - over_m[0]) / every_m);
                    ends.extend((0..=count).map(|k| over_m[0] + k as f64 * every_m));
                }
                _ => {}
            }
        }
        let limits = self.at_most.map_or([self.end_m; 2], |(over_m, _)| over_m);
        ends.extend(limits.into_iter().filter(|x_m| (START_M..self.end_m).contains(x_m)));
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|b, a| *b - *a < 0.02);
        let mut points = Vec::new();
        for (k, x_m) in ends.iter().enumerate() {
            let before_m = k.checked_sub(1).map_or(*x_m, |k| f64::midpoint(ends[k], *x_m));
            points.push(self.point(is_in, *x_m, before_m));
        }
        let turns_back = self.present(is_in).any(|injected| *injected == Injected::NotPassed);
        let last_m = if turns_back { self.end_m - ON_M } else { self.end_m + ON_M };
        points.push(self.point(&|_| false, last_m, last_m));
        if let Some(([from_m, to_m], roll_deg)) = self.again {
            // If heads are mounted at different places along the hull, they are in phase only while the vehicle moves
            // forwards. Passes that are rolled to the left and to the right therefore need two forward runs.
            let from_m = from_m.max(START_M);
            let to_m = to_m.min(self.end_m + ON_M);
            let sides_deg: &[f64] = if roll_deg > 0.0 { &[-roll_deg, roll_deg] } else { &[0.0] };
            let mut at_m = last_m;
            for roll_deg in sides_deg {
                for x_m in [at_m - ROLLS_OVER_M, from_m, from_m + 0.2, to_m] {
                    points.push(Point { roll_deg: *roll_deg, ..self.point(&|_| false, x_m, from_m) });
                }
                at_m = to_m;
            }
        }
        Path(points)
    }

    fn point(&self, is_in: &dyn Fn(usize) -> bool, x_m: f64, before_m: f64) -> Point {
        let mut point = Point {
            x_m,
            place_m: self.tunnel.middle_m,
            yaw_deg: 0.0,
            roll_deg: 0.0,
            speed_mps: self.speed_mps,
        };
        for injected in self.present(is_in) {
            match injected {
                Injected::TooFast { over_m, factor } if (over_m[0]..over_m[1]).contains(&before_m) => {
                    point.speed_mps *= factor;
                }
                // The vehicle moves to the offset, and later back, between neighbouring points of the path.
                Injected::Aside { over_m, by_m } if (over_m[0]..=over_m[1]).contains(&x_m) => {
                    point.place_m = [point.place_m[0] + by_m[0], point.place_m[1] + by_m[1]];
                }
                Injected::Swing { over_m, yaw_deg, every_s } if (over_m[0]..=over_m[1]).contains(&x_m) => {
                    let turn = math::floor_to_i64((x_m - over_m[0]) / (every_s * self.speed_mps) + 0.5);
                    point.yaw_deg = if turn % 2 == 0 { *yaw_deg } else { -yaw_deg };
                }
                _ => {}
            }
        }
        if let Some((over_m, at_most_mps)) = self.at_most
            && (over_m[0]..over_m[1]).contains(&before_m)
        {
            point.speed_mps = point.speed_mps.min(at_most_mps);
        }
        point
    }
}

/// A point of the vehicle's path, with the speed towards this point.
#[derive(Debug, Clone, Copy)]
struct Point {
    x_m: f64,
    place_m: [f64; 2],
    yaw_deg: f64,
    roll_deg: f64,
    speed_mps: f64,
}

struct Path(Vec<Point>);

impl Path {
    fn text(&self) -> String {
        let mut text = "[trajectory]\nkind = \"waypoints\"\n".to_owned();
        for Point { x_m, place_m: [y_m, z_m], yaw_deg, roll_deg, speed_mps } in &self.0 {
            writeln!(
                text,
                "[[trajectory.waypoints]]\nchainage_m = {x_m:.4}\nplace_m = [{y_m:.3}, {z_m:.3}]\n\
                 yaw_deg = {yaw_deg:.2}\nroll_deg = {roll_deg:.1}\nspeed_mps = {speed_mps:.4}"
            )
            .unwrap();
        }
        text
    }

    /// Time at which the vehicle first reaches a chainage, seconds after the start of the dive.
    fn time_s(&self, x_m: f64) -> f64 {
        let mut at_s = 0.0;
        for pair in self.0.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let way_m = math::hypot(
                to.x_m - from.x_m,
                math::hypot(to.place_m[0] - from.place_m[0], to.place_m[1] - from.place_m[1]),
            );
            if x_m <= to.x_m {
                return at_s + way_m / to.speed_mps * (x_m - from.x_m) / (to.x_m - from.x_m);
            }
            at_s += way_m / to.speed_mps;
        }
        at_s
    }
}

/// Writes the simulator effect of an injected cause, if it has one.
fn effect(injected: &Injected, path: &Path, count: usize, text: &mut String) {
    let dies = |sensors: &str, over_m: [f64; 2]| {
        let [from_s, to_s] = over_m.map(|x_m| path.time_s(x_m));
        let for_s = to_s - from_s;
        format!(
            "[[effects.device_faults]]\nkind = \"die\"\nsensors = [{sensors}]\nfrom_s = {from_s:.2}\nfor_s = {for_s:.2}\n"
        )
    };
    let sonars =
        |heads: &[usize]| heads.iter().map(|head| format!("\"sonar_{head}\"")).collect::<Vec<_>>().join(", ");
    let effect = match injected {
        Injected::MissingReturns { keys } => {
            let all: Vec<usize> = (0..count).collect();
            format!("[effects.missing_returns]\nsensors = [{}]\n{keys}", sonars(&all))
        }
        Injected::Occluded => "[effects.occlusion]\n".to_owned(),
        Injected::Phase { offsets_deg } => {
            format!("[effects.start_phase_error]\noffsets_deg = {offsets_deg:.1?}\n")
        }
        Injected::HeadStalled { head, per_hour } => format!(
            "[effects.head_stalls]\nper_hour = {per_hour:.0}\nseconds = [5, 14]\nsensors = [{}]\n",
            sonars(&[*head])
        ),
        Injected::HeadSilent { heads, over_m } => dies(&sonars(heads), *over_m),
        Injected::PositionLost { sensor, over_m } => dies(&format!("\"{sensor}\""), *over_m),
        Injected::TooFast { .. }
        | Injected::AngularStep { .. }
        | Injected::OutOfRange { .. }
        | Injected::Aside { .. }
        | Injected::Swing { .. }
        | Injected::NotPassed => String::new(),
    };
    text.push_str(&effect);
}
