//! The host's side of an echosounder's line: settings first, each acknowledged, then a distance each interval, asked for or
//! sent by the device of its own accord.

use std::collections::VecDeque;

use headrace_sensor::driver::{Carrier, Cutter, DeviceHealth, Driver, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};

use crate::codec::{Addressed, DeviceInformation, Frame, Frames, MAX_FRAME_BYTES, Message, id};
use crate::settings::{Polling, Settings};

/// What may carry an echosounder's bytes.
pub const CARRIERS: [Carrier; 3] = [Carrier::Serial, Carrier::Udp, Carrier::Tcp];

/// A frame's bytes follow one another on the line.
const SILENCE: DurNs = DurNs::from_millis(50);
/// How long an answer to a setting or a question may take. Source: Ping protocol, 50 ms; a bridge adds to it.
const ANSWER_TIME: DurNs = DurNs::from_millis(150);
/// What a ping may take beyond the interval.
const PING_TIME: DurNs = DurNs::from_millis(250);
/// How often a setting is said that isn't acknowledged, before the next one's turn.
const TRIES: u32 = 4;
/// How often the speed of sound is asked for: other clients of a bridge can change it.
const LOOK_PERIOD: DurNs = DurNs::from_millis(10_000);

const ECHOSOUNDER: u8 = 1;

/// What the last message was for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// A setting, or a question about the device, by the id of the message.
    Setting(u16),
    /// A distance.
    Distance,
}

/// An echosounder's driver.
pub struct PingDriver {
    settings: Settings,
    cutter: Cutter<Frames, MAX_FRAME_BYTES>,
    /// Messages that come before the next distance.
    to_say: VecDeque<(Asked, Vec<u8>)>,
    asked: Option<(Asked, MonoNs)>,
    /// The setting in flight, and how often it may still be said.
    again: Option<(Vec<u8>, u32)>,
    next_at: MonoNs,
    look_at: MonoNs,
    device: Option<DeviceInformation>,
    refused: Option<String>,
}

impl PingDriver {
    /// For a device with these settings.
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

    /// What a device is told and asked when its line has been opened.
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

    /// A message to the device; what a host says is far shorter than the longest frame.
    fn encoded(&self, message: &Message) -> Option<Vec<u8>> {
        let addressed = Addressed { source: 0, destination: self.settings.device_id, message: *message };
        addressed.encode().ok().map(|bytes| bytes.as_slice().to_vec())
    }

    /// Says what is to be said, or asks for a distance that is due.
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

    /// Nothing has answered in time. A setting is said again: a device that hasn't heard it measures otherwise.
    fn give_up(&mut self, asked: Asked, now: MonoNs, wire: &mut dyn Wire) {
        self.asked = None;
        let Some((bytes, tries)) = self.again.take().filter(|(_, tries)| *tries > 0) else { return };
        wire.send(&bytes);
        self.asked = Some((asked, now));
        self.again = Some((bytes, tries - 1));
    }

    /// A message of the device, or of what was taken for it.
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

    /// How long the answer to what was asked may take.
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
                2 => "is a Ping360, no echosounder; connect leads to another device than this sensor"
                    .to_owned(),
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
        // The next setting needn't wait for a thread to be woken.
        if self.asked.is_none() && !self.to_say.is_empty() {
            self.next(received, wire);
        }
    }

    fn due(&self) -> Option<MonoNs> {
        let next = match self.asked {
            Some((asked, at)) => at + self.timeout(asked),
            None if self.settings.polling == Polling::Asked => self.next_at.min(self.look_at),
            None => self.look_at,
        };
        Some(self.cutter.gives_up().map_or(next, |gives_up| next.min(gives_up)))
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
        DeviceHealth { good_frames, identity, complaint: self.complaint() }
    }
}

#[cfg(test)]
mod tests;
