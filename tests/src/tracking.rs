//! Dives in which the navigation's estimates are recorded together with the true poses.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::sources::Consistency;
use headrace_fusion::filter::state::{ERRORS, Errors, State};
use headrace_fusion::relative::Relative;
use headrace_fusion::{Fix, Navigation, NoFix, Times};
use headrace_geometry::frames::Pose;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::MonoNs;
use headrace_monitor::App;
use headrace_monitor::report::Report;
use headrace_replay::SimulationFeed;
use headrace_replay::drive::{Pace, drive};
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;
use headrace_simulator::{START, Scene, Scenery, Simulation};
use headrace_vehicle::NavigationConfig;

/// Capacity of the queue for records of the navigation. A dive of an hour needs less.
const MOST_SAID: usize = 1 << 20;

/// A position fix that the loop requested, with the true pose at that time.
pub struct Tracked {
    /// Time for which the fix was requested.
    pub at: MonoNs,
    /// The position fix, or the reason why it is missing.
    pub fix: Result<Fix, NoFix>,
    /// True pose of the vehicle.
    pub truth: Pose,
}

/// State of the filter at the end of an epoch.
pub struct Epoch {
    /// Time of the filter's estimate.
    pub at: MonoNs,
    /// Factors of the covariance of the filter's estimate.
    pub factors: Box<Factors<ERRORS>>,
    /// Corrections that turn the filter's estimate into the truth. Only the corrections of the pose are known.
    pub errors: Errors,
}

/// Recorded position fixes and estimates of a dive's navigation.
pub struct Track {
    /// Position fixes in the order in which the loop requested them.
    pub fixes: Vec<Tracked>,
    /// Filter states at the ends of epochs, in time order.
    pub epochs: Vec<Epoch>,
    /// Consistency statistics after each fused measurement: time of the last epoch, number of the source, and
    /// statistics up to this measurement.
    pub consistency: Vec<(MonoNs, usize, Consistency)>,
    /// Report of the dive.
    pub report: Report,
}

/// A period of a dive in which some sources are silent.
#[derive(Debug, Clone, Default)]
pub struct Silence {
    /// Numbers of the silent sources.
    pub sources: Vec<usize>,
    /// Start of the silence, seconds from the beginning of the dive.
    pub from_s: f64,
    /// End of the silence, seconds from the beginning of the dive.
    pub to_s: f64,
}

enum Said {
    Fix(MonoNs, Result<Fix, NoFix>),
    Epoch(MonoNs, Box<(State, Factors<ERRORS>)>),
    Consistency(usize, Consistency),
}

/// A navigation whose filter states a test can observe.
pub trait Transparent: Navigation + 'static {
    /// Latest filter state and its time, if the navigation has a state.
    fn estimate(&self) -> Option<(MonoNs, State, Factors<ERRORS>)> {
        None
    }
}

impl Transparent for headrace_fusion::direct::DirectNavigation {}

impl Transparent for headrace_fusion::smooth::track::TrackNavigation {}

impl Transparent for FilterNavigation {
    fn estimate(&self) -> Option<(MonoNs, State, Factors<ERRORS>)> {
        self.running().map(|running| (running.at, running.state, running.factors))
    }
}

/// A navigation that always returns the true pose.
struct Truth(Scenery);

impl Stateful for Truth {
    fn save(&self, _: &mut Saver) {}

    fn restore(&mut self, _: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        Ok(())
    }
}

impl Navigation for Truth {
    fn update(&mut self, _: usize, _: &SensorInfo, _: Times, _: &Reading) {}

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        Ok(Fix {
            pose: self.0.pose(at),
            speed_mps: 0.0,
            relative: Relative::default(),
            revisit: Relative::default(),
            tie: 0,
            settled: 0,
        })
    }
}

impl Transparent for Truth {}

/// Simulates a scene and replays it with a navigation that knows the true pose, so that every sample is at its true
/// place.
pub fn true_dive(scene: &Scene) -> Track {
    let simulation = Simulation::new(scene).unwrap();
    dive(scene, Truth(simulation.scenery().unwrap().clone()), Silence::default())
}

struct RecordedNavigation<N> {
    inner: N,
    silence: Silence,
    last: Option<MonoNs>,
    consistencies: Vec<Consistency>,
    said: SyncSender<Said>,
}

/// A loop's snapshot doesn't include the recorded fixes and estimates.
impl<N: Transparent> Stateful for RecordedNavigation<N> {
    fn save(&self, to: &mut Saver) {
        self.inner.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.inner.restore(from)
    }
}

impl<N: Transparent> Navigation for RecordedNavigation<N> {
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading) {
        let at_s = times.received.since(START).as_secs_f64();
        let silent = self.silence.from_s..self.silence.to_s;
        if self.silence.sources.contains(&source) && silent.contains(&at_s) {
            return;
        }
        self.inner.update(source, sensor, times, reading);
        if let Some((at, state, factors)) = self.inner.estimate().filter(|(at, ..)| self.last != Some(*at)) {
            self.last = Some(at);
            self.said.try_send(Said::Epoch(at, Box::new((state, factors)))).unwrap();
        }
        if let (Some(consistency), Some(last)) =
            (self.inner.consistency(source), self.consistencies.get_mut(source))
            && *last != consistency
        {
            *last = consistency;
            self.said.try_send(Said::Consistency(source, consistency)).unwrap();
        }
    }

    fn end(&mut self) {
        self.inner.end();
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        let fix = self.inner.fix(at);
        self.said.try_send(Said::Fix(at, fix)).unwrap();
        fix
    }
}

/// The navigation filter with the settings of a scene's vehicle.
pub fn filter(scene: &Scene) -> FilterNavigation {
    let vehicle = &scene.vehicle;
    let settings = match vehicle.navigation {
        NavigationConfig::Filter(settings) => settings,
        NavigationConfig::Direct => Settings::default(),
    };
    FilterNavigation::new(vehicle.tunnel.profile.clone(), vehicle.site, settings)
}

/// Simulates a scene and replays it with the navigation `inner`, while some sources are silent.
pub fn dive(scene: &Scene, inner: impl Transparent, silence: Silence) -> Track {
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let (said, heard) = sync_channel(MOST_SAID);
    let consistencies = vec![Consistency::default(); vehicle.sensors.len()];
    let mut dive =
        app.arm(Box::new(RecordedNavigation { inner, silence, last: None, consistencies, said })).unwrap();
    let simulation = Simulation::new(scene).unwrap();
    drive(&mut dive, &mut SimulationFeed::new(simulation), Pace::default(), &mut |_| {}).unwrap();
    dive.finish(&mut |_, _| {});
    sort(scene, &heard, Report::of(&dive))
}

fn sort(scene: &Scene, heard: &Receiver<Said>, report: Report) -> Track {
    let simulation = Simulation::new(scene).unwrap();
    let truth = |at: MonoNs| simulation.pose(at).unwrap();
    let (mut fixes, mut epochs, mut consistency) = (Vec::new(), Vec::<Epoch>::new(), Vec::new());
    while let Ok(said) = heard.try_recv() {
        match said {
            Said::Fix(at, fix) => fixes.push(Tracked { at, fix, truth: truth(at) }),
            Said::Epoch(at, estimate) => {
                let (state, factors) = *estimate;
                let truth = truth(at);
                let errors =
                    state.errors_to(&State { position: truth.position, attitude: truth.attitude, ..state });
                epochs.push(Epoch { at, factors: Box::new(factors), errors });
            }
            Said::Consistency(source, counted) => {
                let at = epochs.last().map_or(START, |epoch| epoch.at);
                consistency.push((at, source, counted));
            }
        }
    }
    Track { fixes, epochs, consistency, report }
}
