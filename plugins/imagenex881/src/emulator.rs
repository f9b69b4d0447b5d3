//! An emulated head, and the host that polls it: one command and one return each ping period.

use headrace_core::app::device::{Direction, Emulator, EmulatorSetup, Truth};
use headrace_core::codec::{Bytes, Codec as _};
use headrace_core::frames::{Mount, head_direction};
use headrace_core::math;
use headrace_core::sampling::head::HeadProgram;
use headrace_core::time::{DurNs, MonoNs};

use crate::codec::{
    COUNTS_PER_TURN, Command, CommandCodec, Header, MAX_ECHO_BYTES, MAX_RETURN_BYTES, Model, Points, Return,
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

/// The device: pings where it is, answers, and steps.
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

    /// Obeys one command. `range_m` gives the range at a position, in metres at 1500 m/s.
    pub fn answer(&mut self, command: &Command, range_m: impl FnOnce(u16) -> Option<f64>) -> Return {
        self.growing ^= command.reverse;
        let next = self.next_position(command);
        let position = u16::try_from(self.position).unwrap_or(0);
        self.position = next;
        let heard = range_m(position)
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
            position,
            clockwise: self.growing,
            range_m: command.range_m,
            profile_counts: 0,
        };
        let count_m = f64::from(silent.count_mm(Model::Head881)) / 1000.0;
        let counts = heard.map_or(0, |range| math::round_to_i64(range / count_m));
        let header = Header { profile_counts: u16::try_from(counts).unwrap_or(0), ..silent };
        Return { header, echo: echo(tag, heard.map(|range| range / f64::from(command.range_m))) }
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
    mount: Mount,
    latency: DurNs,
    host: Host,
    codec: CommandCodec,
    head: Head,
    ping_at: MonoNs,
    answer: Option<Bytes<MAX_RETURN_BYTES>>,
}

impl HeadEmulator {
    /// A head that is at its program's start when switched on, and pings at once. Without a program it turns on for
    /// ever from the sensor frame's 0.
    pub fn new(settings: Settings, mount: Mount, latency: DurNs, setup: &EmulatorSetup) -> Self {
        let idle = HeadProgram { start_rad: 0.0, growing: true, sector: None };
        let program = setup.head.unwrap_or(idle);
        let host = Host::new(&settings, &program);
        let head = Head::new(settings.position(program.start_rad), host.growing);
        let (codec, ping_at) = (CommandCodec::default(), setup.start);
        Self { settings, mount, latency, host, codec, head, ping_at, answer: None }
    }

    fn ask(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        let Self { settings, mount, host, codec, head, ping_at, answer, .. } = self;
        // Settings are checked when they are read, so that each command has its bytes.
        let Ok(bytes) = host.next_command().encode() else { return };
        line(Direction::Sent, *ping_at, &bytes);
        codec.push(&bytes, &mut |command| {
            let value = head.answer(&command, |position| {
                device_range_m(truth, mount, *ping_at, settings.sensor_rad(position))
            });
            *answer = value.encode().ok();
        });
    }
}

/// Range in metres that a head computes at an angle in its frame: along the beam's centre, with its own sound speed.
fn device_range_m(truth: &dyn Truth, mount: &Mount, at: MonoNs, sensor_rad: f64) -> Option<f64> {
    let pose = truth.pose(at);
    let direction = pose.attitude * (mount.rotation * head_direction(sensor_rad));
    let range_m = truth.range_m(pose.place(mount.position), direction)?;
    Some(range_m * (SOUND_SPEED_MPS / truth.site().sound_speed_mps))
}

impl Emulator for HeadEmulator {
    fn due(&self) -> MonoNs {
        if self.answer.is_some() { self.ping_at + self.latency } else { self.ping_at }
    }

    /// Sends a command, or receives its answer.
    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        match self.answer.take() {
            Some(answer) => line(Direction::Received, self.ping_at + self.latency, answer.as_slice()),
            None => self.ask(truth, line),
        }
        if self.answer.is_none() {
            self.ping_at = self.ping_at + self.settings.ping_period;
        }
    }
}

#[cfg(test)]
mod tests;
