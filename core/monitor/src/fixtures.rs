//! Fixtures for tests: a pipe, its coverage, its speed advice and a loop.

use crate::entities::Mounted;
use crate::messages::{Hidden, Outcome, PlacedPing};
use crate::resources::{Coverage, TunnelDesign};
use crate::run::Loop;
use crate::{App, SourceSpec};
use headrace_coverage::{
    Frontier, GridLayout, MissingSamples, Reach, SampleStore, Sections, Soundings, StoreLayout, WallLimits,
};
use headrace_fusion::Fix;
use headrace_fusion::direct::DirectNavigation;
use headrace_fusion::relative::Relative;
use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sampling::Target;
use headrace_sampling::advice::{Advice, Advisor, Looks, Task};
use headrace_sampling::head::{HeadSet, MAX_HEADS};
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::losses::LossRate;
use headrace_sampling::passes::Situation;
use headrace_sampling::swing::Swing;
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::device::{Decoder, SensorInfo, SensorKind};
use headrace_sensor::reading::{Decoded, Packet, SourceId};
use headrace_vehicle::Mission;
use serde::{Deserialize, Serialize};

/// A pipe of 3 m radius.
pub(crate) fn pipe() -> Profile {
    shapes::circle(3.0).unwrap()
}

/// Pipe of 3 m radius and 30 m length.
pub(crate) fn tunnel() -> TunnelDesign {
    let profile = pipe();
    let limits = WallLimits::new(profile.perimeter_m(), 1.0, 2.0);
    TunnelDesign { profile, site: Site::default(), length_m: 30.0, contradiction_m: 1.0, limits }
}

/// Empty coverage for a target of half a metre.
pub(crate) fn coverage() -> Coverage {
    let (perimeter_m, from_m, to_m) = (pipe().perimeter_m(), 0.0, 32.0);
    Coverage {
        store: SampleStore::new(StoreLayout { perimeter_m, from_m, to_m, cell_m: 0.25, capacity: 10_000 }),
        sections: Sections::new(0.25, Target::new(0.5), from_m, to_m),
        frontier: Frontier::default(),
        soundings: Soundings::new(GridLayout { perimeter_m, from_m, to_m, node_m: 0.5 }),
        unsure: None,
        missing_samples: MissingSamples::default(),
    }
}

/// A mount at the vehicle's origin, facing forward.
pub(crate) fn mount() -> Mount {
    Mount { position: Vec3::zero(), rotation: Rot::identity() }
}

/// A pose in the centre of the pipe, without roll, pitch and yaw.
pub(crate) fn pose(x_m: f64) -> Pose {
    let [y_m, z_m] = pipe().reference();
    Pose { position: Point3::new(x_m, y_m, z_m), attitude: Rot::identity() }
}

/// A fix in the centre of the pipe, at 0.1 m/s, with this chainage error between passes, m.
pub(crate) fn fix(x_m: f64, pass_error_m: f64) -> Fix {
    let relative = Relative::along(pass_error_m);
    Fix { pose: pose(x_m), speed_mps: 0.1, relative, revisit: relative, tie: 0, settled: 0 }
}

/// A vehicle without heads, at 0.1 m/s in the centre of the pipe. Without the chainage `x_m` it has no pose.
pub(crate) fn situation(x_m: Option<f64>) -> Situation {
    Situation {
        pose: x_m.map(pose),
        speed_mps: 0.1,
        pass_error_m: 0.0,
        layout: HeadLayout::PhaseShift,
        configured: 0,
        heads: [None; MAX_HEADS],
        deaf: HeadSet::default(),
        losses: [LossRate::default(); MAX_HEADS],
        lost_at_most: LossRate::default(),
    }
}

/// Target of half a metre at a confidence of two standard deviations, in a tunnel of 100 m.
pub(crate) fn task() -> Task {
    Task {
        target: Target::new(0.5),
        length_m: 100.0,
        layout: HeadLayout::PhaseShift,
        sound_speed_mps: 1447.0,
        looks: Looks::default(),
    }
}

/// Speed advice for a vehicle without heads.
pub(crate) fn advice(of: &Situation) -> Advice {
    Advisor::new(&pipe(), task(), &[], &[]).advise(of, Swing::default(), None)
}

/// A georeferenced ping with a return, from a head in the pipe's centre that has moved one angular step since its
/// previous ping. The head's angle counts from the pipe's floor.
pub(crate) fn heard(x_m: f64, angle_rad: f64, range_m: f64) -> PlacedPing {
    let origin = pose(x_m).position;
    let (sin, cos) = math::sin_cos(angle_rad);
    let point = Point3::new(x_m, origin.y() + range_m * sin, origin.z() - range_m * cos);
    let arc_m = pipe().arc_of([point.y(), point.z()]);
    PlacedPing { outcome: Outcome::Sample { point, arc_m }, ..pinged(x_m, angle_rad) }
}

/// A georeferenced ping without a return, aimed at wall within range, from a head in the pipe's centre.
pub(crate) fn pinged(x_m: f64, angle_rad: f64) -> PlacedPing {
    PlacedPing {
        head: 0,
        received: MonoNs(1_000_000_000),
        valid_at: MonoNs(1_000_000_000),
        fix: Some(fix(x_m, 0.0)),
        reach: Some(Reach { from_m: x_m, to_m: x_m }),
        single_step: true,
        new_sweep: false,
        standing: false,
        outcome: Outcome::Lost(headrace_coverage::Loss::Missing, None),
        angle_rad,
        hidden: Hidden::No,
        longest_m: 5.0,
        source: SourceId(0),
        origin: Some(pose(x_m).position),
    }
}

/// A decoder that never gives a reading.
#[derive(Serialize, Deserialize)]
struct Silent;

impl Decoder for Silent {
    fn decode(&mut self, _: Packet<'_>, _: &mut dyn FnMut(Decoded)) {}

    fn counts(&self) -> CodecCounts {
        CodecCounts::default()
    }
}

/// A loop with a head and a depth sensor, in a test pipe.
pub(crate) fn armed() -> Loop {
    let navigation = DirectNavigation::new(pipe(), Site::default());
    let mut app = App::new(Mission::new(pipe(), 1.0));
    for (id, kind) in [("head", SensorKind::Head), ("depth", SensorKind::Depth)] {
        let (id, decoder) = (id.to_owned(), Box::new(Silent));
        let spec = SourceSpec { id, plugin: String::new(), connect: String::new(), decoder, ring_bytes: 64 };
        let source = app.add_source(spec).unwrap();
        let sensor = app.entities[source.index()];
        let info = SensorInfo { kind, ..SensorInfo::other() };
        app.placer.world.entity_mut(sensor).insert(Mounted { source, info });
    }
    app.arm(Box::new(navigation)).unwrap()
}
