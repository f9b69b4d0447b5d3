//! An emulated head, polled once per ping period by an emulated host, or by a real host.

use std::collections::VecDeque;

use headrace_sensor::codec::{Bytes, Codec as _};
use headrace_sensor::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Sounding;
use headrace_sensor::sampling::head::HeadProgram;

use crate::codec::{
    Command, CommandCodec, Header, MAX_ECHO_BYTES, Model, Points, Return, SOUND_SPEED_MPS, Status, Tag,
};
use crate::program::Host;
use crate::settings::Settings;
use crate::stepping::{Head, Ping};

/// Echo strength of the point at the wall. All other points of an emulated echo are zero.
const ECHO: u8 = 127;

impl Ping {
    /// A head's answer to a command, with an echo at `range_m`, in metres at 1500 m/s.
    pub fn answer(self, command: &Command, range_m: Option<f64>) -> Return {
        let heard = range_m
            .filter(|range| *range > 0.0 && *range >= command.min_range_m)
            .filter(|range| *range <= f64::from(command.range_m));
        let tag = match command.points {
            _ if command.profile => Tag::Ipx,
            Points::P250 => Tag::Imx,
            Points::P500 => Tag::Igx,
        };
        let silent = Header {
            tag,
            head_id: command.head_id,
            status: Status(0x40),
            position: self.position,
            clockwise: self.clockwise,
            range_m: command.range_m,
            profile_counts: 0,
        };
        let count_m = f64::from(silent.count_mm(Model::Head881)) / 1000.0;
        let counts = heard.map_or(0, |range| math::round_to_i64(range / count_m));
        let header = Header { profile_counts: u16::try_from(counts).unwrap_or(0), ..silent };
        Return { header, echo: echo(tag, heard.map(|range| range / f64::from(command.range_m))) }
    }
}

/// An 8-bit echo with one point at the fraction `part` of the range setting.
fn echo(tag: Tag, part: Option<f64>) -> Bytes<MAX_ECHO_BYTES> {
    let points: usize = match tag {
        Tag::Ipx => return Bytes::default(),
        Tag::Igx => 500,
        _ => 252,
    };
    let mut strengths = [0; MAX_ECHO_BYTES];
    let point = part.and_then(|part| usize::try_from(math::floor_to_i64(part * points as f64)).ok());
    if let Some(strength) = point.and_then(|point| strengths.get_mut(point.min(points - 1))) {
        *strength = ECHO;
    }
    Bytes::new(strengths.get(..points).unwrap_or_default()).unwrap_or_default()
}

/// An emulated head, with an emulated host if no real host polls.
#[derive(Debug, Clone)]
pub struct HeadEmulator {
    settings: Settings,
    latency: DurNs,
    /// Ratio of a range that the head reports to the true range at the site.
    device_per_site: f64,
    /// The emulated host; `None` if a real host polls.
    host: Option<Host>,
    codec: CommandCodec,
    head: Head,
    ping_at: MonoNs,
    /// Soundings that a real host has requested and that the head hasn't started yet.
    waiting: Vec<Sounding>,
    asked: VecDeque<Asked>,
}

/// A command that has been executed but not yet answered.
#[derive(Debug, Clone)]
struct Asked {
    command: Command,
    ping: Ping,
}

impl HeadEmulator {
    /// Creates a head that is at the start of its scan program and pings as soon as it is switched on.
    ///
    /// Without a scan program, the head rotates continuously from angle 0 of the sensor frame.
    pub fn new(settings: Settings, latency: DurNs, setup: &EmulatorSetup) -> Self {
        let idle = HeadProgram { start_rad: 0.0, growing: true, sector: None };
        let program = setup.head.unwrap_or(idle);
        let host = Host::new(&settings, &program);
        let head = Head::new(settings.position(program.start_rad), host.growing());
        let device_per_site = SOUND_SPEED_MPS / setup.site.sound_speed_mps;
        Self {
            settings,
            latency,
            device_per_site,
            host: setup.polled.then_some(host),
            codec: CommandCodec::default(),
            head,
            ping_at: setup.start,
            waiting: Vec::new(),
            asked: VecDeque::new(),
        }
    }

    /// Makes the head execute the next command of the emulated host.
    fn asked_now(&mut self) -> Option<Asked> {
        let command = self.host.as_mut()?.next_command();
        Some(Asked { command, ping: self.head.obey(&command) })
    }

    /// Executes the commands in the bytes that a host sent at `at`. Each command begins a sounding.
    fn obey(&mut self, at: MonoNs, bytes: &[u8]) {
        let Self { settings, codec, head, asked, waiting, .. } = self;
        codec.push(bytes, &mut |command| {
            if command.head_id != settings.command.head_id {
                return;
            }
            let ping = head.obey(&command);
            waiting.push(Sounding::due(at, settings.sensor_rad(ping.position)));
            asked.push_back(Asked { command, ping });
        });
    }
}

impl Emulator<Sounding> for HeadEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Sounding>) {
        while let Some(host) = self.host.as_mut().filter(|_| self.ping_at < until) {
            // Settings are checked when they are read, so every command can be encoded.
            if let Ok(bytes) = host.next_command().encode() {
                self.obey(self.ping_at, &bytes);
            }
            self.ping_at = self.ping_at + self.settings.ping_period;
        }
        let begun = self.waiting.partition_point(|sounding| sounding.at < until);
        due.extend(self.waiting.drain(..begun));
    }

    fn hear(&mut self, at: MonoNs, bytes: &[u8], _: LineSink<'_>) {
        self.obey(at, bytes);
    }

    fn tell(&mut self, sounding: &Sounding, line: LineSink<'_>) {
        // Imported soundings arrive without a call of `begin`, so the command of the emulated host is requested here.
        let Some(Asked { command, ping }) = self.asked.pop_front().or_else(|| self.asked_now()) else {
            return;
        };
        if let Some(bytes) = self.host.as_ref().and_then(|_| command.encode().ok()) {
            line(Direction::Sent, sounding.at, &bytes);
        }
        let reported = self.settings.position(sounding.reported_rad);
        let ping = Ping { position: u16::try_from(reported).unwrap_or(ping.position), ..ping };
        let range_m = sounding.range_m.map(|range_m| range_m * self.device_per_site);
        if let Ok(answer) = ping.answer(&command, range_m).encode() {
            line(Direction::Received, sounding.at + self.latency, answer.as_slice());
        }
    }
}

#[cfg(test)]
mod tests;
