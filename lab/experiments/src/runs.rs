//! Simulated dives for the experiments of Jorge et al. 2021: the paper's vehicle, a straight stretch, and the effects
//! of the paper's simulation.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::device::Sense;
use headrace_simulator::{Scene, SceneError, Simulation};

/// The speed of the runs, m/s, which Jorge et al. 2021 state in §7.2.
pub(crate) const SPEED_MPS: f64 = 0.197;

/// Settings of a simulated dive.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setting {
    /// Number of heads. One head means VITA 1, more heads mean VITA 2.
    pub heads: u8,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Layout of the heads: phase shift or sector offset.
    pub layout: HeadLayout,
    /// Whether the heads' phases account for the dive's speed and the heads' positions along the hull.
    pub aligned: bool,
    /// Whether neighbouring heads occlude the wall from each other.
    pub occlusion: bool,
    /// Distance travelled, m.
    pub length_m: f64,
    /// Additional lines in the scene's table of effects; SONARS is a placeholder for the heads' ids.
    pub effects: String,
    /// Random seed.
    pub seed: u64,
}

/// A ping of a head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    /// Head number.
    pub head: u16,
    /// Angle of the head in the sensor's frame, radians.
    pub angle_rad: f64,
    /// Position of the head.
    pub from: Point3<Tunnel>,
    /// Measured position of the wall.
    pub at: Point3<Tunnel>,
    /// Arc length of the true hit, m.
    pub arc_m: f64,
    /// Whether the hit is on the wall, not on the vehicle.
    pub of_wall: bool,
}

/// A simulated dive.
pub(crate) struct Dive {
    /// The tunnel's profile.
    pub profile: Profile,
    /// All pings with an echo: a list for each head, in time order.
    pub heads: Vec<Vec<Sample>>,
    /// Angle between consecutive pings of a head, radians.
    pub step_rad: f64,
    /// Time between consecutive pings of a head, s.
    pub ping_period_s: f64,
}

/// Returns the shipped vehicle file with this name.
fn vehicle(name: &str) -> Result<Vec<u8>, String> {
    let text = match name {
        "vita1.toml" => include_str!("../../../deploy/vehicles/vita1.toml"),
        "vita2-2.toml" => include_str!("../../../deploy/vehicles/vita2-2.toml"),
        "vita2-3.toml" => include_str!("../../../deploy/vehicles/vita2-3.toml"),
        "vita2-4.toml" => include_str!("../../../deploy/vehicles/vita2-4.toml"),
        _ => return Err("is not built in".to_owned()),
    };
    Ok(text.into())
}

impl Setting {
    /// Simulates the dive.
    ///
    /// Errors: the scene can't be read; none for 1 to 4 heads and existing modes and effects.
    pub(crate) fn dive(&self) -> Result<Dive, SceneError> {
        let text = scene_text(self);
        let scene = Scene::parse(Document::new("experiment", &text), &KINDS, &vehicle, Some(self.seed))?;
        run(&scene)
    }
}

fn run(scene: &Scene) -> Result<Dive, SceneError> {
    let mut simulation = Simulation::with_truth(scene)?;
    let mut heads: Vec<Vec<Sample>> = Vec::new();
    let numbers: Vec<u16> =
        (0..).zip(&scene.facts().sensors).filter(|(_, s)| s.sense == Sense::Head).map(|(n, _)| n).collect();
    heads.resize(numbers.len(), Vec::new());
    while simulation.advance() {
        for row in simulation.take_truth() {
            let Some(head) = numbers.iter().position(|number| *number == row.source) else { continue };
            let Some(sounding) = row.sounding else { continue };
            let (Some(at), Some((hit, arc_m))) = (sounding.measured_point(), sounding.wall) else {
                continue;
            };
            let of_wall = (at - sounding.origin).norm() > 0.5 * hit.range_m;
            let (angle_rad, from) = (sounding.measured.angle_rad, sounding.origin);
            if let (Some(samples), Ok(number)) = (heads.get_mut(head), u16::try_from(head)) {
                samples.push(Sample { head: number, angle_rad, from, at, arc_m, of_wall });
            }
        }
    }
    let spec = scene.vehicle.heads().first().copied();
    Ok(Dive {
        profile: scene.vehicle.tunnel.profile.clone(),
        heads,
        step_rad: spec.map_or(0.0, |spec| spec.step_rad),
        ping_period_s: spec.map_or(0.0, |spec| spec.ping_period_s),
    })
}

fn scene_text(setting: &Setting) -> String {
    let vehicle = match setting.heads {
        1 => "vita1.toml".to_owned(),
        heads => format!("vita2-{heads}.toml"),
    };
    let layout =
        HeadLayout::NAMES.iter().find(|(_, layout)| *layout == setting.layout).map_or("", |(name, _)| name);
    // With a planned speed of zero, the phases don't depend on the heads' positions along the hull.
    let planned_mps = if setting.aligned { SPEED_MPS } else { 0.0 };
    let layout = if setting.heads == 1 { String::new() } else { format!("heads.layout = \"{layout}\"\n") };
    let occlusion = if setting.occlusion { "occlusion = {}\n" } else { "" };
    let sonars: Vec<String> = (0..setting.heads).map(|head| format!("\"sonar_{head}\"")).collect();
    format!(
        "name = \"experiment\"\nvehicle = \"{vehicle}\"\n[vehicle_changes]\ntunnel.profile = \"ceran-blueprint\"\n\
         {layout}heads.planned_speed_mps = {planned_mps}\nsensors.all.mode = \"{}\"\n[trajectory]\nstart_m = 5\n\
         [[trajectory.legs]]\ndistance_m = {}\nspeed_mps = {SPEED_MPS}\n[effects]\nmotion_within_turn = {{}}\n{occlusion}{}\n",
        setting.mode.to_lowercase(),
        setting.length_m,
        setting.effects.replace("SONARS", &sonars.join(", "))
    )
}
