//! An emulated head, and the host that polls it: one command and one return each ping period.

use std::collections::VecDeque;

use headrace_core::app::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_core::app::measurement::Sounding;
use headrace_core::codec::{Bytes, Codec as _};
use headrace_core::math;
use headrace_core::sampling::head::HeadProgram;
use headrace_core::time::{DurNs, MonoNs};

use crate::codec::{
    COMMAND_BYTES, COUNTS_PER_TURN, Command, CommandCodec, Header, MAX_ECHO_BYTES, Model, Points, Return,
    Status, Tag, ZERO_COUNT, step_at_most, step_deg,
};
use crate::plugin::SOUND_SPEED_MPS;
use crate::settings::{Settings, counts_of_rad};

/// Strength of an emulated echo where the wall is; zero elsewhere.
const ECHO: u8 = 127;

/// The host's side: which command comes next, so that the head follows its program.
///
/// Sectors are kept with steps and reversals, not with the head's own sector switches: those know multiples of
/// 3 degrees only. Both ends of a sector are pinged; where the step doesn't divide it, the last one before an end is
/// shorter, and an end's ping isn't repeated.
#[derive(Debug, Clone)]
pub struct Host {
    command: Command,
    step_counts: i32,
    growing: bool,
    sector: Option<Sector>,
}

/// A sector in counts, and how far above its lower end the head is.
#[derive(Debug, Clone, Copy)]
struct Sector {
    size: i32,
    along: i32,
}

impl Host {
    /// For a head at the program's start that would step in the program's first direction.
    pub fn new(settings: &Settings, program: &HeadProgram) -> Self {
        let normal = settings.angle_sign > 0.0;
        Self {
            command: settings.command,
            step_counts: i32::from(settings.step_counts),
            growing: program.growing == normal,
            sector: program.sector.map(|(least_rad, size_rad)| {
                let above_least = program.start_rad - least_rad;
                let above_rad = if normal { above_least } else { size_rad - above_least };
                Sector::new(counts_of_rad(above_rad), counts_of_rad(size_rad))
            }),
        }
    }

    /// The next command. The head pings where it is, then steps as the command says.
    pub fn next_command(&mut self) -> Command {
        let Some(Sector { size, along }) = &mut self.sector else { return self.command };
        let to_end = |growing| if growing { *size - *along } else { *along };
        let reverse = to_end(self.growing) <= 0;
        self.growing ^= reverse;
        let step = step_at_most(self.step_counts.min(to_end(self.growing)));
        *along += if self.growing { i32::from(step) } else { -i32::from(step) };
        Command { reverse, step_deg: step_deg(step), ..self.command }
    }
}

impl Sector {
    fn new(above: i32, size: i32) -> Self {
        let size = size.clamp(0, COUNTS_PER_TURN);
        let inside = (0..=size).contains(&above);
        let along = if inside { above } else { above.rem_euclid(COUNTS_PER_TURN).min(size) };
        Self { size, along }
    }
}

/// Where a head pinged, and which way it went on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ping {
    /// Its position, 0 to 1199.
    pub position: u16,
    /// Whether positions grow.
    pub clockwise: bool,
}

impl Ping {
    /// The answer of a head that hears the wall at `range_m`, in metres at 1500 m/s.
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

/// The device: pings where it is, and steps.
#[derive(Debug, Clone)]
pub struct Head {
    position: i32,
    growing: bool,
}

impl Head {
    /// A head at `position` (0 to 1199) that would step towards growing positions, or the other way.
    pub fn new(position: i32, growing: bool) -> Self {
        Self { position: position.rem_euclid(COUNTS_PER_TURN), growing }
    }

    /// Obeys one command: pings where it is, and steps.
    pub fn obey(&mut self, command: &Command) -> Ping {
        self.growing ^= command.reverse;
        let next = self.next_position(command);
        let position = u16::try_from(self.position).unwrap_or(0);
        self.position = next;
        Ping { position, clockwise: self.growing }
    }

    /// Where the command's step leads; turns round at the ends of a sector narrower than the whole turn.
    fn next_position(&mut self, command: &Command) -> i32 {
        let step = command.step_counts();
        if command.sector_deg >= 360.0 {
            let stepped = if self.growing { self.position + step } else { self.position - step };
            return stepped.rem_euclid(COUNTS_PER_TURN);
        }
        let half = counts_of_deg(command.sector_deg) / 2;
        let centre = counts_of_deg(command.train_deg) + ZERO_COUNT;
        let turn = COUNTS_PER_TURN;
        let along = (self.position - centre + turn / 2).rem_euclid(turn) - turn / 2;
        let beyond = if self.growing { along >= half } else { along <= -half };
        self.growing ^= beyond;
        let stepped = if self.growing { (along + step).min(half) } else { (along - step).max(-half) };
        (centre + stepped).rem_euclid(turn)
    }
}

fn counts_of_deg(angle_deg: f64) -> i32 {
    counts_of_rad(angle_deg.to_radians())
}

/// An 8-bit echo of one point at `part` of the range setting.
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

/// Host and head on one line.
#[derive(Debug, Clone)]
pub struct HeadEmulator {
    settings: Settings,
    latency: DurNs,
    /// Metres as the head reckons them for a metre of the site's.
    device_per_site: f64,
    host: Host,
    codec: CommandCodec,
    head: Head,
    ping_at: MonoNs,
    asked: VecDeque<Asked>,
}

/// A command that has been obeyed but not yet answered.
#[derive(Debug, Clone)]
struct Asked {
    bytes: [u8; COMMAND_BYTES],
    command: Command,
    ping: Ping,
}

impl HeadEmulator {
    /// A head that is at its program's start when switched on, and pings at once. Without a program it turns on for
    /// ever from the sensor frame's 0.
    pub fn new(settings: Settings, latency: DurNs, setup: &EmulatorSetup) -> Self {
        let idle = HeadProgram { start_rad: 0.0, growing: true, sector: None };
        let program = setup.head.unwrap_or(idle);
        let host = Host::new(&settings, &program);
        let head = Head::new(settings.position(program.start_rad), host.growing);
        let device_per_site = SOUND_SPEED_MPS / setup.site.sound_speed_mps;
        let (codec, ping_at, asked) = (CommandCodec::default(), setup.start, VecDeque::new());
        Self { settings, latency, device_per_site, host, codec, head, ping_at, asked }
    }

    /// Sends the next command to the head, which obeys what the bytes say.
    fn ask(&mut self, due: &mut Vec<Sounding>) {
        let Self { settings, host, codec, head, ping_at, asked, .. } = self;
        // Settings are checked when they are read, so that each command has its bytes.
        let Ok(bytes) = host.next_command().encode() else { return };
        codec.push(&bytes, &mut |command| {
            let ping = head.obey(&command);
            due.push(Sounding::due(*ping_at, settings.sensor_rad(ping.position)));
            asked.push_back(Asked { bytes, command, ping });
        });
    }
}

impl Emulator<Sounding> for HeadEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Sounding>) {
        while self.ping_at < until {
            self.ask(due);
            self.ping_at = self.ping_at + self.settings.ping_period;
        }
    }

    fn tell(&mut self, sounding: &Sounding, line: LineSink<'_>) {
        let Some(Asked { bytes, command, ping }) = self.asked.pop_front() else { return };
        line(Direction::Sent, sounding.at, &bytes);
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
