//! Short dives of all kinds, each drawn from a seed.

use std::fmt::Write as _;

use headrace_geometry::math;

/// Kind of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A dive without errors.
    Ideal,
    /// Noise on all sensors, a drifting pilot, missing returns, and false returns.
    Noisy,
    /// Heads that sweep back and forth in sectors.
    Sectors,
    /// Heads whose view of the wall is blocked by the hull and by other heads.
    Occluded,
    /// A vehicle that goes forward, back, and forward again.
    Reversing,
    /// A vehicle that is stationary for a while.
    Parked,
    /// A fast vehicle, with long gaps in the returns and heads that stall.
    Sparse,
    /// A cavern whose ends lie beyond the range of every head.
    Wide,
}

const KINDS: [Kind; 8] = [
    Kind::Ideal,
    Kind::Noisy,
    Kind::Sectors,
    Kind::Occluded,
    Kind::Reversing,
    Kind::Parked,
    Kind::Sparse,
    Kind::Wide,
];

/// Random numbers from a seed (SplitMix64).
pub struct Draw(u64);

impl Draw {
    /// Creates the stream of random numbers that belongs to a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// A random number from 0 to below 1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A random number from `from` to below `to`.
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// A random whole number from 0 to below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        usize::try_from(math::floor_to_i64(self.unit() * count as f64)).unwrap()
    }

    /// One of the values, at random.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }
}

/// The vehicle file and scene file of a drawn dive.
#[derive(Debug, Clone)]
pub struct Seeded {
    /// Seed from which the dive is drawn.
    pub seed: u64,
    /// Kind of the dive.
    pub kind: Kind,
    /// Vehicle file, TOML.
    pub vehicle: String,
    /// Scene file, TOML.
    pub scene: String,
}

/// Draws a tunnel. Returns its table for the vehicle file, a range setting that reaches the walls, and the largest
/// offset of a vehicle from the centre line, m.
fn tunnel(kind: Kind, draw: &mut Draw) -> (String, u32, f64) {
    if kind == Kind::Wide {
        let width_m = draw.between(30.0, 36.0);
        return (format!("profile = \"rectangle\"\nwidth_m = {width_m:.2}\nheight_m = 4"), 5, 0.3);
    }
    match draw.below(4) {
        0 => ("profile = \"ceran\"".to_owned(), 10, 0.5),
        1 => (format!("profile = \"circle\"\nradius_m = {:.2}", draw.between(1.2, 3.0)), 5, 0.3),
        2 => {
            let [width_m, height_m] = [draw.between(2.5, 5.0), draw.between(2.5, 4.0)];
            (format!("profile = \"rectangle\"\nwidth_m = {width_m:.2}\nheight_m = {height_m:.2}"), 5, 0.4)
        }
        _ => ("profile = \"arch\"\nwidth_m = 4\nheight_m = 4\narch_radius_m = 2.5".to_owned(), 5, 0.4),
    }
}

fn vehicle(kind: Kind, draw: &mut Draw, speed_mps: f64) -> (String, f64) {
    let (tunnel, range_m, aside_m) = tunnel(kind, draw);
    let heads = match kind {
        Kind::Sectors | Kind::Occluded => 2 + draw.below(3),
        _ => 1 + draw.below(4),
    };
    let target_m = draw.between(0.25, 1.6);
    let section_m = draw.one_of(&[0.1, 0.2, 0.25, 0.25, 0.25, 0.5]);
    let way = draw.one_of(&["direct", "direct", "filter"]);
    let layout = if kind == Kind::Sectors { "sector_offset" } else { "phase_shift" };
    let planned = draw.one_of(&[0.0, speed_mps]);
    let mut text = format!(
        "target_m = {target_m:.3}\nsection_m = {section_m}\n[tunnel]\n{tunnel}\nlength_m = 40\n\
         [navigation]\nway = \"{way}\"\nslack_sd_m = 0.01\n[heads]\nlayout = \"{layout}\"\nplanned_speed_mps = {planned:.3}\n"
    );
    if kind == Kind::Occluded {
        let up_m = draw.one_of(&[0.12, -0.3]);
        let top_m = up_m + 0.18;
        writeln!(text, "[[hull]]\nleast_m = [-0.6, -0.2, {up_m}]\nmost_m = [0.6, 0.2, {top_m}]").unwrap();
    }
    let mode = match kind {
        Kind::Sparse => draw.one_of(&["slow", "medium"]),
        _ => draw.one_of(&["medium", "fast", "faster", "fastest", "fastest"]),
    };
    // Heads are all at one place, or one behind the other, or side by side. If they are side by side, some of them face
    // aft.
    let places = if kind == Kind::Occluded { 2 } else { draw.below(3) };
    for head in 0..heads {
        let place = match places {
            0 => "[0, 0, 0]\nangles_deg = [0, 0, 0]".to_owned(),
            1 => format!("[{}, 0, 0]\nangles_deg = [0, 0, 0]", 0.55 - 0.3 * head as f64),
            _ => {
                let (x, yaw) = if head < 2 { (0.55, 0) } else { (-0.55, 180) };
                let y = if head % 2 == 0 { 0.15 } else { -0.15 };
                format!("[{x}, {y}, 0]\nangles_deg = [0, 0, {yaw}]")
            }
        };
        write!(
            text,
            "[[sensors]]\nid = \"sonar_{head}\"\nplugin = \"imagenex881\"\nmode = \"{mode}\"\n\
             range_m = {range_m}\nmin_range_m = 0.35\nposition_m = {place}\n"
        )
        .unwrap();
    }
    text.push_str(SENSORS);
    (text, aside_m)
}

/// Tables of the sensors that determine the vehicle's position.
pub const SENSORS: &str = r#"[[sensors]]
id = "left"
plugin = "ping1d"
angles_deg = [0, 0, 90]
[[sensors]]
id = "right"
plugin = "ping1d"
angles_deg = [0, 0, -90]
[[sensors]]
id = "up"
plugin = "ping1d"
angles_deg = [0, -90, 0]
[[sensors]]
id = "down"
plugin = "ping1d"
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

fn effects(kind: Kind, draw: &mut Draw) -> String {
    let mut text = "[effects]\nmotion_within_turn = {}\n".to_owned();
    if draw.below(3) == 0 {
        text.push_str("start_phase_error = {}\n");
    }
    match kind {
        Kind::Noisy => text.push_str(
            "range_noise = { sd_m = 0.02 }\nmissing_returns = { share = 0.05, mean_run = 3 }\n\
             outliers = { share = 0.02 }\nimu_noise = { attitude_deg = 0.2 }\ntether_slack = { reach_m = 0.02 }\n\
             pilot_drift = { across_m = 0.15, up_m = 0.1, yaw_deg = 4, pitch_deg = 2, period_s = 12 }\n\
             line_delay = { latency_ms = 3, jitter_ms = 4 }\n",
        ),
        Kind::Occluded => text.push_str("occlusion = {}\n"),
        Kind::Sectors => text.push_str("sector_end_slowing = {}\n"),
        Kind::Sparse => text.push_str(
            "missing_returns = { share = 0.25, mean_run = 25 }\nhead_stalls = { per_hour = 300, seconds = [1, 6] }\n\
             skipped_steps = { per_thousand = 3 }\n",
        ),
        Kind::Ideal | Kind::Reversing | Kind::Parked | Kind::Wide => {}
    }
    text
}

fn trajectory(kind: Kind, draw: &mut Draw, speed_mps: f64, place: [f64; 2]) -> String {
    let start_m = draw.between(3.0, 4.0);
    let legs: Vec<(f64, f64)> = match kind {
        Kind::Parked => {
            let mut text = "[trajectory]\nkind = \"waypoints\"\n".to_owned();
            let mut chainage_m = start_m;
            for stay_s in [0.0, draw.between(2.0, 12.0), 0.0] {
                writeln!(
                    text,
                    "[[trajectory.waypoints]]\nchainage_m = {chainage_m:.4}\nplace_m = [{:.3}, {:.3}]\n\
                     stay_s = {stay_s:.2}\nspeed_mps = {speed_mps:.4}",
                    place[0], place[1]
                )
                .unwrap();
                chainage_m += draw.between(1.0, 2.0);
            }
            return text;
        }
        Kind::Reversing => {
            let out_m = draw.between(1.5, 2.8);
            let back_m = out_m * draw.between(0.4, 1.0);
            vec![
                (out_m, speed_mps),
                (back_m, -speed_mps * draw.between(0.6, 1.2)),
                (back_m + draw.between(0.5, 1.5), speed_mps * draw.between(0.5, 1.0)),
            ]
        }
        Kind::Sparse => vec![(draw.between(4.0, 7.0), speed_mps)],
        _ => {
            let first_m = draw.between(1.0, 2.5);
            vec![(first_m, speed_mps), (draw.between(1.0, 2.0), speed_mps * draw.between(0.6, 2.0))]
        }
    };
    let mut text =
        format!("[trajectory]\nstart_m = {start_m:.4}\nplace_m = [{:.3}, {:.3}]\n", place[0], place[1]);
    for (distance_m, speed_mps) in legs {
        writeln!(text, "[[trajectory.legs]]\ndistance_m = {distance_m:.4}\nspeed_mps = {speed_mps:.4}")
            .unwrap();
    }
    text
}

/// The dive that belongs to a seed.
pub fn seeded(seed: u64) -> Seeded {
    let mut draw = Draw::new(seed);
    let kind = KINDS[usize::try_from(seed).unwrap() % KINDS.len()];
    let speed_mps = match kind {
        Kind::Sparse => draw.between(0.3, 0.6),
        Kind::Reversing => draw.between(0.2, 0.4),
        _ => draw.between(0.1, 0.35),
    };
    let (vehicle, aside_m) = vehicle(kind, &mut draw, speed_mps);
    let centre = centre(&vehicle);
    let place = if draw.below(3) == 0 { centre } else { centre.map(|c| c + draw.between(-aside_m, aside_m)) };
    let way = trajectory(kind, &mut draw, speed_mps, place);
    let effects = effects(kind, &mut draw);
    let scene = format!("seed = {seed}\nvehicle = \"vehicle.toml\"\n{way}{effects}");
    Seeded { seed, kind, vehicle, scene }
}

/// Reference point of the tunnel's cross-section in a vehicle file, m.
fn centre(vehicle: &str) -> [f64; 2] {
    crate::scenes::scene_from(
        "vehicle = \"vehicle.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 1\nspeed_mps = 0.1\n",
        &|_| Ok(vehicle.as_bytes().to_vec()),
    )
    .vehicle
    .tunnel
    .profile
    .reference()
}
