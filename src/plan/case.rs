//! The inspection to plan, from a vehicle file or from options alone, and the results of its planning.

use std::path::{Path, PathBuf};

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::margin::ExpectedErrors;
use headrace_sampling::plan::{Answer, Briefing, InLine, Inspection, Planner, Question};
use headrace_sensor::SensorConfig;
use headrace_sensor::device::Device;
use headrace_simulator::position_error_model;
use headrace_vehicle::TunnelConfig;

use crate::cli::Plan;
use crate::failure::Failure;
use crate::files;
use crate::tunnel_option;
use crate::vehicle_file;

/// Plugin of the heads that are assumed without a vehicle file.
const USUAL_HEAD: &str = "imagenex881";
/// Range setting of the heads that are assumed without a vehicle file, m. Source: the maker's table of modes.
const USUAL_RANGE_M: f64 = 10.0;

/// An inspection to be planned, with the names of its tunnel, heads and layout.
pub(super) struct Case {
    pub(super) inspection: Inspection,
    pub(super) heads: Vec<String>,
    pub(super) tunnel: String,
    pub(super) range_m: f64,
    pub(super) question: Question,
    /// Expected position errors; `None` without a vehicle file.
    pub(super) errors: Option<ExpectedErrors>,
    /// Files from which the inspection was read.
    pub(super) inputs: Vec<PathBuf>,
}

type Head = (HeadSpec, Vec<HeadMode>);

impl Case {
    /// Creates the case from the options, which override the vehicle file.
    pub(super) fn of(args: &Plan) -> Result<Self, Failure> {
        let load = files::beside(Path::new(""));
        let tunnel = args.tunnel.as_deref().map(|tunnel| tunnel_option::parse(tunnel, &load)).transpose()?;
        match (&args.vehicle, tunnel) {
            (Some(path), tunnel) => Self::of_vehicle(path, tunnel, args),
            (None, Some(tunnel)) => Ok(Self::new(tunnel, ideal_heads(args)?, args)),
            (None, None) => Err(Failure::Usage("plan: needs --tunnel or --vehicle".to_owned())),
        }
    }

    fn of_vehicle(path: &Path, tunnel: Option<TunnelConfig>, args: &Plan) -> Result<Self, Failure> {
        let (_, vehicle) = vehicle_file::read(path)?;
        let configs = vehicle.sensors.iter().zip(&vehicle.sensor_configs);
        let ids = configs.filter(|(sensor, _)| sensor.head().is_some()).map(|(_, config)| config.id.clone());
        let heads = ids.zip(heads_of(path, &vehicle.sensors, args.range)?).collect();
        let name = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        let errors =
            position_error_model::expected_errors(&vehicle, &name, &KINDS, &files::bytes_beside(path));
        let errors = errors.map_err(|why| Failure::Usage(format!("plan: {why}")))?;
        let mut inputs = vehicle_file::files(path, &vehicle);
        let mut case = Self::new(tunnel.unwrap_or(vehicle.tunnel), heads, args);
        case.question.target_m = case.question.target_m.or(Some(vehicle.target.max_hole_m));
        case.inspection.hull = vehicle.hull;
        case.inspection.layout = args.layout.unwrap_or(vehicle.layout);
        case.inspection.sound_speed_mps = vehicle.site.sound_speed_mps;
        inputs.extend_from_slice(&case.inputs);
        Ok(Self { errors, inputs, ..case })
    }

    /// Creates the case of heads without a hull, in water of the default site.
    fn new(tunnel: TunnelConfig, heads: Vec<(String, Head)>, args: &Plan) -> Self {
        let (ids, heads): (Vec<String>, Vec<Head>) = heads.into_iter().unzip();
        let range_m = heads.iter().map(|(spec, _)| spec.range_m[1]).fold(0.0, f64::max);
        let inspection = Inspection {
            length_m: args.length.unwrap_or(tunnel.length_m),
            place: args.at.unwrap_or(tunnel.profile.reference()),
            profile: tunnel.profile,
            heads,
            hull: Vec::new(),
            layout: args.layout.unwrap_or(HeadLayout::PhaseShift),
            drift_m: args.drift,
            yaw_rad: args.yaw.to_radians(),
            yaw_rate_radps: args.yaw_rate.to_radians(),
            sound_speed_mps: Site::default().sound_speed_mps,
        };
        let question = Question {
            target_m: args.target,
            speed_mps: args.speed,
            time_s: args.hours.map(|hours| hours * 3600.0),
        };
        Self {
            inspection,
            heads: ids,
            tunnel: tunnel.name,
            range_m,
            question,
            errors: None,
            inputs: args.tunnel.as_deref().and_then(tunnel_option::file).into_iter().collect(),
        }
    }
}

/// Heads of a vehicle, each with its modes. `range_m` overrides the range setting.
fn heads_of(path: &Path, sensors: &[Box<dyn Device>], range_m: Option<f64>) -> Result<Vec<Head>, Failure> {
    let mut heads = Vec::new();
    for sensor in sensors {
        let Some(mut spec) = sensor.head() else { continue };
        let modes = sensor.modes(range_m).map_err(|why| Failure::Usage(format!("--range: {why}")))?;
        spec.range_m[1] = range_m.unwrap_or(spec.range_m[1]);
        heads.push((spec, modes));
    }
    if heads.is_empty() {
        return Err(Failure::Usage(format!("plan: {} has no profiling head", path.display())));
    }
    Ok(heads)
}

/// Heads that are all at the vehicle's origin, as the closed formulas assume.
fn ideal_heads(args: &Plan) -> Result<Vec<(String, Head)>, Failure> {
    let kind = KINDS.iter().find(|kind| kind.name() == USUAL_HEAD);
    let kind = kind.ok_or_else(|| Failure::Usage(format!("plan: this build has no {USUAL_HEAD}")))?;
    let range_m = args.range.unwrap_or(USUAL_RANGE_M);
    let head = |number: u32| {
        let id = format!("head_{number}");
        let config = SensorConfig {
            id: id.clone(),
            plugin: USUAL_HEAD.to_owned(),
            connect: String::new(),
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            latency: DurNs::ZERO,
        };
        // The plan covers all modes of the head, so the mode that is set here has no effect.
        let own = Document::new("plan", "mode = \"slow\"").root()?;
        let device = kind.configure(&config, &own)?;
        let mut heads = heads_of(Path::new("plan"), &[device], Some(range_m))?;
        heads.pop().map(|head| (id, head)).ok_or_else(|| Failure::Usage("plan: no head".to_owned()))
    };
    (0..args.heads).map(head).collect()
}

/// Results of one run of `headrace plan`, with its input.
pub(super) struct Findings {
    pub(super) planner: Planner,
    /// Ids of the heads.
    pub(super) heads: Vec<String>,
    pub(super) tunnel: String,
    /// Range setting of the heads, m.
    pub(super) range_m: f64,
    /// Shortest and longest footprint of a beam along the perimeter, m.
    pub(super) footprints_m: [f64; 2],
    pub(super) question: Question,
    pub(super) answers: Vec<Answer>,
    /// Index of the mode shown in the briefing and the charts, and its speed, m/s; `None` if no mode gives a
    /// speed.
    pub(super) shown: Option<(usize, f64)>,
    pub(super) briefing: Briefing,
    /// Gain in speed if the heads were in one line along the hull; `None` if the gain isn't worth reporting.
    pub(super) in_line: Option<InLine>,
}

/// A speed rounded down to 1 mm/s for printing, m/s. The printed speed thus meets the target, too.
pub(super) fn printed_mps(speed_mps: f64) -> f64 {
    let down = (speed_mps * 1000.0 + 1e-6).floor() / 1000.0;
    if down > 0.0 { down } else { speed_mps }
}
