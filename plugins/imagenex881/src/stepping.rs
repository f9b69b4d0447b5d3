//! Motion of a head. With each command the head pings at its position and then steps, within the command's sector.

use crate::codec::{COUNTS_PER_TURN, Command, ZERO_COUNT};
use crate::settings::counts_of_rad;

/// Position of a ping, and direction of the step after it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ping {
    /// Head position of the ping, 0 to 1199.
    pub position: u16,
    /// Whether the step after the ping increases the position.
    pub clockwise: bool,
}

/// Position and direction of a head.
#[derive(Debug, Clone)]
pub struct Head {
    position: i32,
    growing: bool,
}

impl Head {
    /// Creates a head at `position` (0 to 1199) that steps towards larger positions if `growing` is set.
    pub fn new(position: i32, growing: bool) -> Self {
        Self { position: position.rem_euclid(COUNTS_PER_TURN), growing }
    }

    /// Present head position, 0 to 1199.
    pub fn position(&self) -> i32 {
        self.position
    }

    /// Whether the next step increases the position.
    pub fn growing(&self) -> bool {
        self.growing
    }

    /// Executes one command: pings at the position, then steps.
    pub fn obey(&mut self, command: &Command) -> Ping {
        self.growing ^= command.reverse;
        let next = self.next_position(command);
        let position = u16::try_from(self.position).unwrap_or(0);
        self.position = next;
        Ping { position, clockwise: self.growing }
    }

    /// Position after the command's step. The head reverses at the ends of a sector narrower than a full turn.
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
