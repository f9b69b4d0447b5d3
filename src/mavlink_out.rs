//! `--mavlink-out`: sends the state of the dive to ground stations such as QGroundControl and, through
//! BlueOS, Cockpit.
//!
//! Heartbeats follow the loop's ticks, so they stop if the loop stops. Each alert is sent once, as a text.

use std::collections::BTreeSet;
use std::net::UdpSocket;
use std::thread::{self, JoinHandle};

use crossbeam::channel::{Receiver, Sender, bounded};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_mavlink::out::{Gravity, Speaker};
use headrace_monitor::alert_list::{AlertChange, Priority};
use headrace_monitor::live_state::{LiveState, PositionState};
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;

use crate::failure::Failure;
use crate::follower::Follower;

/// Interval between heartbeats, in the loop's time. Source: MAVLink, "Heartbeat/Connection Protocol".
const HEARTBEAT_EVERY: DurNs = DurNs(1_000_000_000);
/// Interval between messages with the dive's figures, in the loop's time.
const FIGURES_EVERY: DurNs = DurNs(500_000_000);
/// Maximum number of MAVLink frames in the queue. It corresponds to about ten seconds.
const WAITING: usize = 256;

/// Follower that sends the state of the dive over MAVLink.
pub(crate) struct MavlinkOut {
    speaker: Speaker,
    frames: Option<Sender<Vec<u8>>>,
    thread: Option<JoinHandle<()>>,
    heartbeat: Option<MonoNs>,
    figures: Option<MonoNs>,
    /// Numbers of the alerts whose texts have been sent.
    sent: BTreeSet<u32>,
}

impl MavlinkOut {
    /// Starts to send to an address, as a component of the vehicle that has this MAVLink system id.
    ///
    /// Errors: a socket or thread can't be created. An address at which nobody listens is not an error.
    pub(crate) fn start(to: &str, system_id: u8) -> Result<Self, Failure> {
        let failed = |source| Failure::System { what: "starting MAVLink's output", source };
        let socket =
            UdpSocket::bind(if to.starts_with('[') { "[::]:0" } else { "0.0.0.0:0" }).map_err(failed)?;
        let (sender, frames) = bounded(WAITING);
        let to = to.to_owned();
        let send = move || send_all(&socket, &to, &frames);
        let thread = thread::Builder::new().name("mavlink-out".to_owned()).spawn(send).map_err(failed)?;
        Ok(Self {
            speaker: Speaker::new(system_id),
            frames: Some(sender),
            thread: Some(thread),
            heartbeat: None,
            figures: None,
            sent: BTreeSet::new(),
        })
    }

    /// Hands a MAVLink frame to the sending thread. If the queue is full, the frame is dropped, since a newer
    /// one follows.
    fn send(&self, frame: Vec<u8>) {
        if let Some(frames) = &self.frames {
            frames.try_send(frame).ok();
        }
    }

    fn end_sending(&mut self) {
        drop(self.frames.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("MAVLink's output has ended early");
        }
    }
}

/// Whether the interval since `last` is over. In a replay time may go back.
fn is_due(last: &mut Option<MonoNs>, now: MonoNs, every: DurNs) -> bool {
    let due = last.is_none_or(|last| !(0..every.0).contains(&now.since(last).0));
    if due {
        *last = Some(now);
    }
    due
}

impl Follower for MavlinkOut {
    fn notice(&mut self, notice: &Notice, dive: &Loop) {
        let Notice::Listed { change: AlertChange::Raised, alert, .. } = notice else { return };
        if !self.sent.insert(alert.number) {
            return;
        }
        let gravity = match alert.priority {
            Priority::EmergencyAlarm => Gravity::Emergency,
            Priority::Alarm => Gravity::Alarm,
            Priority::Warning => Gravity::Warning,
            Priority::Caution => Gravity::Caution,
        };
        let around = dive.view().surroundings();
        let (text, advice) = (alert.text(&around), alert.advice(&around));
        let text = if advice.is_empty() { text } else { format!("{text} -> {advice}") };
        for frame in self.speaker.text(gravity, &text) {
            self.send(frame);
        }
    }

    fn tick(&mut self, dive: &Loop) {
        let state = dive.view().live_state();
        let now = state.now;
        if is_due(&mut self.heartbeat, now, HEARTBEAT_EVERY) {
            let frame = self.speaker.heartbeat(state.at.is_some());
            self.send(frame);
        }
        if is_due(&mut self.figures, now, FIGURES_EVERY) {
            // The milliseconds wrap after 49 days, as in every MAVLink clock.
            let time_ms = u32::try_from(now.0 / 1_000_000 % (1 << 32)).unwrap_or(0);
            let unacknowledged = dive.view().alert_list().counts().unacknowledged;
            for (name, value) in figures(state, unacknowledged) {
                if let Some(frame) = self.speaker.figure(name, time_ms, value) {
                    self.send(frame);
                }
            }
        }
    }

    fn end(&mut self, _: &Loop) {
        self.end_sending();
    }
}

impl Drop for MavlinkOut {
    fn drop(&mut self) {
        self.end_sending();
    }
}

/// Figures of the dive, by their MAVLink names. A missing figure is NaN. `docs/reference/screens.md` has the
/// table with their units.
#[expect(clippy::cast_possible_truncation, reason = "MAVLink's figures are of single precision")]
fn figures(state: &LiveState, unacknowledged: u32) -> [(&'static str, f32); 12] {
    let known = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
    let is_now = !state.is_old();
    let now = |value: Option<f64>| known(value.filter(|_| is_now));
    let has_position = is_now && !matches!(state.position, PositionState::None(_));
    let lamp = state.condition().lamp() as u8;
    [
        ("HR_LAMP", f32::from(lamp)),
        ("HR_AGE_S", known(state.age().map(DurNs::as_secs_f64))),
        ("HR_SPEED", now(state.speed_mps)),
        ("HR_VMAX", now(state.v_max_mps())),
        ("HR_TURN_T", now(state.advice.and_then(|advice| advice.predicted_t_m))),
        ("HR_CHAIN", known(state.chainage_m.filter(|_| has_position))),
        ("HR_POS_SD", known(Some(state.pass_sd_m).filter(|_| has_position))),
        ("HR_PASS_M", known(Some(state.metres.pass_m))),
        ("HR_MISS_M", known(Some(state.metres.fail_m))),
        ("HR_CANT_M", known(Some(state.metres.cannot_say_m))),
        ("HR_OPEN_M", known(Some(state.metres.open_m))),
        ("HR_ALERTS", unacknowledged as f32),
    ]
}

/// Sends MAVLink frames as they come. At the end of a dive, sends the remaining frames before it returns.
fn send_all(socket: &UdpSocket, to: &str, frames: &Receiver<Vec<u8>>) {
    let mut failed: u64 = 0;
    for frame in frames {
        if let Err(error) = socket.send_to(&frame, to) {
            // The error means that nobody listens, or that there is no route. The dive goes on, because the fault may
            // pass.
            if failed == 0 {
                tracing::warn!(%error, to, "MAVLink can't be sent; retrying");
            }
            failed += 1;
        }
    }
    if failed > 0 {
        tracing::info!(failed, "MAVLink frames not sent");
    }
}
