//! Driver of a Ping echosounder. It sends the settings first, and then gets a distance in each ping interval.
//!
//! The device must acknowledge each setting. The driver requests distances, or the device sends them continuously.

use std::collections::VecDeque;

use headrace_sensor::driver::{Carrier, Cutter, DeviceHealth, Driver, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};

use crate::codec::{Addressed, DeviceInformation, Frame, Frames, MAX_FRAME_BYTES, Message, id};
use crate::settings::{Polling, Settings};

/// Carriers over which a Ping echosounder can be connected.
pub const CARRIERS: [Carrier; 3] = [Carrier::Serial, Carrier::Udp, Carrier::Tcp];

/// Longest usual gap between the bytes of a frame.
const SILENCE: DurNs = DurNs::from_millis(50);
/// Timeout for the device's answer to a setting or request. Source: Ping protocol, 50 ms, plus an allowance for a
/// bridge.
const ANSWER_TIME: DurNs = DurNs::from_millis(150);
/// Time that the device has to answer a distance request, in addition to the ping interval.
const PING_TIME: DurNs = DurNs::from_millis(250);
/// Maximum number of times that a setting is sent. If no acknowledgement comes, the driver sends the next setting.
const TRIES: u32 = 4;
/// Interval at which the speed of sound setting is checked, because other clients of a UDP bridge can change it.
const LOOK_PERIOD: DurNs = DurNs::from_millis(10_000);

const ECHOSOUNDER: u8 = 1;

/// Purpose of the message in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// A setting or a query about the device, by message id.
    Setting(u16),
    /// A distance request.
    Distance,
}

/// Driver of a Ping echosounder.
pub struct PingDriver {
    settings: Settings,
    cutter: Cutter<Frames, MAX_FRAME_BYTES>,
    /// Messages to send before the next distance request.
    to_say: VecDeque<(Asked, Vec<u8>)>,
    asked: Option<(Asked, MonoNs)>,
    /// Encoded setting or query that awaits an answer, and the number of times that the driver may still send it.
    again: Option<(Vec<u8>, u32)>,
    next_at: MonoNs,
    look_at: MonoNs,
    device: Option<DeviceInformation>,
    refused: Option<String>,
}

impl PingDriver {
    /// Creates a driver with these settings.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            cutter: Cutter::new(Frames, SILENCE),
            to_say: VecDeque::new(),
            asked: None,
            again: None,
            next_at: MonoNs(0),
            look_at: MonoNs(0),
            device: None,
            refused: None,
        }
    }

    /// Queues the settings and queries that are sent when the line opens.
    fn greet(&mut self) {
        let settings = self.settings;
        let interval_ms = u16::try_from(settings.interval.0 / 1_000_000).unwrap_or(u16::MAX);
        self.to_say.clear();
        self.will_say(&Message::GeneralRequest(id::PROTOCOL_VERSION));
        self.will_say(&Message::GeneralRequest(id::DEVICE_INFORMATION));
        self.will_say(&Message::ContinuousStop(id::PROFILE));
        self.will_say(&Message::SetSpeedOfSound(settings.sound_speed_mmps()));
        self.will_say(&Message::SetPingInterval(interval_ms));
        if let Some(scan) = settings.scan {
            self.will_say(&Message::SetModeAuto(false));
            self.will_say(&Message::SetRange(scan));
        }
        if let Some(gain) = settings.gain {
            self.will_say(&Message::SetGain(gain));
        }
        self.will_say(&Message::SetPingEnable(true));
        if settings.polling == Polling::Continuous {
            self.will_say(&Message::ContinuousStart(id::PROFILE));
        }
    }

    fn will_say(&mut self, message: &Message) {
        let about = if let Message::GeneralRequest(about) = message { *about } else { message.id() };
        self.to_say.extend(self.encoded(message).map(|bytes| (Asked::Setting(about), bytes)));
    }

    /// Encodes a message to the device. Messages of a host are far shorter than the longest frame.
    fn encoded(&self, message: &Message) -> Option<Vec<u8>> {
        let addressed = Addressed { source: 0, destination: self.settings.device_id, message: *message };
        addressed.encode().ok().map(|bytes| bytes.as_slice().to_vec())
    }

    /// Sends the next queued message, or a distance request that is due.
    fn next(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        if now >= self.look_at {
            self.look_at = now + LOOK_PERIOD;
            self.will_say(&Message::GeneralRequest(id::SPEED_OF_SOUND));
        }
        let is_due = self.settings.polling == Polling::Asked && now >= self.next_at;
        if self.to_say.is_empty() && is_due {
            let next = self.next_at + self.settings.interval;
            self.next_at = if next > now { next } else { now + self.settings.interval };
            let question = self.encoded(&Message::GeneralRequest(id::DISTANCE));
            self.to_say.extend(question.map(|bytes| (Asked::Distance, bytes)));
        }
        if let Some((asked, bytes)) = self.to_say.pop_front() {
            wire.send(&bytes);
            self.asked = Some((asked, now));
            self.again = matches!(asked, Asked::Setting(_)).then_some((bytes, TRIES - 1));
        }
    }

    /// Handles a timeout. Settings are sent again, because a device that missed a setting measures differently.
    fn give_up(&mut self, asked: Asked, now: MonoNs, wire: &mut dyn Wire) {
        self.asked = None;
        let Some((bytes, tries)) = self.again.take().filter(|(_, tries)| *tries > 0) else { return };
        wire.send(&bytes);
        self.asked = Some((asked, now));
        self.again = Some((bytes, tries - 1));
    }

    /// Handles a message from the device.
    fn answered(&mut self, frame: &Frame<'_>) {
        let awaited = self.asked;
        let answers = |asked: Asked| awaited.is_some_and(|(awaited, _)| awaited == asked);
        let done = match Message::decode(frame) {
            Ok(Message::Ack(about)) => answers(Asked::Setting(about)),
            Ok(Message::Nack { nacked_id, text }) => {
                self.refused = Some(format!("refuses message {nacked_id}: {}", text.as_str()));
                answers(Asked::Setting(nacked_id)) || (nacked_id == id::DISTANCE && answers(Asked::Distance))
            }
            Ok(Message::Distance(_) | Message::DistanceSimple(_) | Message::Profile(_)) => {
                self.refused = None;
                answers(Asked::Distance)
            }
            Ok(Message::DeviceInformation(device)) => {
                self.device = Some(device);
                answers(Asked::Setting(id::DEVICE_INFORMATION))
            }
            Ok(Message::SpeedOfSound(mmps)) => {
                if mmps != self.settings.sound_speed_mmps() {
                    self.will_say(&Message::SetSpeedOfSound(self.settings.sound_speed_mmps()));
                }
                answers(Asked::Setting(id::SPEED_OF_SOUND))
            }
            Ok(other) => answers(Asked::Setting(other.id())),
            Err(_) => false,
        };
        if done {
            self.asked = None;
            self.again = None;
        }
    }

    /// Timeout for the device's answer to this message.
    fn timeout(&self, asked: Asked) -> DurNs {
        match asked {
            Asked::Setting(_) => ANSWER_TIME,
            Asked::Distance => self.settings.interval + PING_TIME,
        }
    }

    fn complaint(&self) -> Option<String> {
        let other = self.device.filter(|device| device.device_type != ECHOSOUNDER);
        other
            .map(|device| match device.device_type {
                2 => "is a Ping360 and not an echosounder; check connect".to_owned(),
                other => format!("is a device of type {other}; an echosounder is of type {ECHOSOUNDER}"),
            })
            .or_else(|| self.refused.clone())
    }
}

impl Driver for PingDriver {
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.greet();
        self.device = None;
        self.refused = None;
        self.asked = None;
        self.again = None;
        self.next_at = now;
        self.look_at = now + LOOK_PERIOD;
        self.next(now, wire);
    }

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.cutter.flush(&mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        let mut frames = Vec::new();
        self.cutter.push(received, bytes, &mut |piece| {
            wire.deliver(piece.received, piece.bytes);
            if piece.is_frame {
                frames.push(piece.bytes.to_vec());
            }
        });
        for frame in frames.iter().filter_map(|bytes| Frame::parse(bytes)) {
            self.answered(&frame);
        }
        // The next setting is sent at once, without waiting for a wake-up.
        if self.asked.is_none() && !self.to_say.is_empty() {
            self.next(received, wire);
        }
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.cutter.accepts(bytes, |_| true)
    }

    fn due(&self) -> Option<MonoNs> {
        let next = match self.asked {
            Some((asked, at)) => at + self.timeout(asked),
            None if self.settings.polling == Polling::Asked => self.next_at.min(self.look_at),
            None => self.look_at,
        };
        Some(self.cutter.settles().map_or(next, |settles| next.min(settles)))
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.heard(now, &[], wire);
        if let Some((asked, at)) = self.asked
            && now.since(at) >= self.timeout(asked)
        {
            self.give_up(asked, now, wire);
        }
        if self.asked.is_none() {
            self.next(now, wire);
        }
    }

    fn awaits(&self) -> bool {
        self.asked.is_some()
    }

    fn health(&self) -> DeviceHealth {
        let identity = self.device.map(|device| {
            let DeviceInformation { firmware_major, firmware_minor, firmware_patch, revision, .. } = device;
            let kind = if device.device_type == ECHOSOUNDER { "Ping echosounder" } else { "Ping device" };
            format!(
                "{kind}, revision {revision}, firmware {firmware_major}.{firmware_minor}.{firmware_patch}"
            )
        });
        let good_frames = self.cutter.counts().good_frames;
        DeviceHealth { good_frames, identity, complaint: self.complaint(), ..DeviceHealth::default() }
    }
}

#[cfg(test)]
mod tests;
