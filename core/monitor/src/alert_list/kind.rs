//! Kinds of alerts, their classes and priorities.

use serde::{Deserialize, Serialize};

use crate::observations::ObservedKind;
pub use headrace_vehicle::AlertClass;

/// Urgency of an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Priority {
    /// Caution: for information; needs no acknowledgement.
    Caution,
    /// Warning: the situation needs attention before it becomes worse.
    Warning,
    /// Alarm: the situation needs action now.
    Alarm,
    /// Emergency alarm: the vehicle may be lost.
    EmergencyAlarm,
}

impl Priority {
    /// Word used for the priority in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Caution => "caution",
            Self::Warning => "warning",
            Self::Alarm => "alarm",
            Self::EmergencyAlarm => "emergency_alarm",
        }
    }
}

/// Kind of an alert in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ListKind {
    /// Sections are flagged as missed.
    Missed,
    /// Newly judged sections are undecided: they neither pass nor fail.
    CannotSay,
    /// The speed is over v_max.
    TooFast,
    /// No speed meets the coverage target.
    NoSpeed,
    /// The present turn of the heads misses the target although the speed is within v_max.
    TurnFails,
    /// There is no position.
    NoPosition,
    /// The position error is too large.
    PositionDoubtful,
    /// No profiling head gives readings.
    NoSonar,
    /// No sensor delivers data.
    NoData,
    /// A sensor gives no readings.
    SensorSilent,
    /// A head doesn't turn.
    SensorStalled,
    /// Successive returns of a head disagree, so they are noise.
    HeadScattered,
    /// A head's range stays constant although it must change at the vehicle's place.
    HeadConstant,
    /// A head contradicts the design where other heads agree with it.
    HeadOutvoted,
    /// The cable counter differs from the inertial unit or from a velocity log, so one of them is wrong.
    CableDoubted,
    /// Ranges contradict a setting of the vehicle file.
    SettingDoubted,
    /// Samples fall beyond either end of the tunnel.
    OutsideTunnel,
    /// A section can't pass, because its samples or its area contradict the design profile.
    ProfileContradicted,
    /// A log recording fails.
    NotRecorded,
    /// Little cable is left on the drum.
    CableLeft,
    /// Little of the planned dive time is left.
    TimeLeft,
    /// Little battery charge is left.
    BatteryLeft,
    /// A head turns and pings without detecting the wall.
    SensorDeaf,
    /// A sensor repeats its last reading.
    SensorHung,
    /// The measured ranges have not confirmed the pitch and yaw of all heads yet.
    MountsUnverified,
    /// The program got no computing time, so data arrived late or were lost.
    ComputerStalled,
    /// A sensor sends packets, but all its readings are withheld.
    SensorWithheld,
}

impl ListKind {
    /// All kinds of alerts.
    pub const ALL: [Self; 27] = [
        Self::Missed,
        Self::CannotSay,
        Self::TooFast,
        Self::NoSpeed,
        Self::TurnFails,
        Self::NoPosition,
        Self::PositionDoubtful,
        Self::NoSonar,
        Self::NoData,
        Self::SensorSilent,
        Self::SensorStalled,
        Self::HeadScattered,
        Self::HeadConstant,
        Self::HeadOutvoted,
        Self::CableDoubted,
        Self::SettingDoubted,
        Self::OutsideTunnel,
        Self::ProfileContradicted,
        Self::NotRecorded,
        Self::CableLeft,
        Self::TimeLeft,
        Self::BatteryLeft,
        Self::SensorDeaf,
        Self::SensorHung,
        Self::MountsUnverified,
        Self::ComputerStalled,
        Self::SensorWithheld,
    ];

    /// Word used for the alert kind in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Missed => "missed",
            Self::CannotSay => "cannot_say",
            Self::TooFast => "too_fast",
            Self::NoSpeed => "no_speed",
            Self::TurnFails => "turn_fails",
            Self::NoPosition => "no_position",
            Self::PositionDoubtful => "position_doubtful",
            Self::NoSonar => "no_sonar",
            Self::NoData => "no_data",
            Self::SensorSilent => "sensor_silent",
            Self::SensorStalled => "sensor_stalled",
            Self::HeadScattered => "head_scattered",
            Self::HeadConstant => "head_constant",
            Self::HeadOutvoted => "head_outvoted",
            Self::CableDoubted => "cable_doubted",
            Self::SettingDoubted => "setting_doubted",
            Self::OutsideTunnel => "outside_tunnel",
            Self::ProfileContradicted => "profile_contradicted",
            Self::NotRecorded => "not_recorded",
            Self::CableLeft => "cable_left",
            Self::TimeLeft => "time_left",
            Self::BatteryLeft => "battery_left",
            Self::SensorDeaf => "sensor_deaf",
            Self::SensorHung => "sensor_hung",
            Self::MountsUnverified => "mounts_unverified",
            Self::ComputerStalled => "computer_stalled",
            Self::SensorWithheld => "sensor_withheld",
        }
    }

    /// Class of the alert kind, which decides muting and hold times.
    pub fn class(self) -> AlertClass {
        match self {
            Self::Missed | Self::CannotSay => AlertClass::Coverage,
            Self::TooFast | Self::NoSpeed | Self::TurnFails => AlertClass::Speed,
            Self::NoPosition | Self::PositionDoubtful | Self::CableDoubted => AlertClass::Position,
            Self::NoSonar
            | Self::NoData
            | Self::SensorSilent
            | Self::SensorStalled
            | Self::SensorDeaf
            | Self::SensorHung
            | Self::SensorWithheld
            | Self::HeadScattered
            | Self::HeadConstant
            | Self::HeadOutvoted
            | Self::ComputerStalled => AlertClass::Sensor,
            Self::NotRecorded => AlertClass::Recording,
            Self::SettingDoubted
            | Self::MountsUnverified
            | Self::OutsideTunnel
            | Self::ProfileContradicted
            | Self::CableLeft
            | Self::TimeLeft
            | Self::BatteryLeft => AlertClass::Setting,
        }
    }

    /// Priority of the alert when it is raised. It may rise later as cable, time or charge runs out.
    pub fn priority(self) -> Priority {
        match self {
            Self::CannotSay | Self::TurnFails | Self::MountsUnverified => Priority::Caution,
            Self::TooFast
            | Self::NoSpeed
            | Self::PositionDoubtful
            | Self::SensorSilent
            | Self::SensorStalled
            | Self::SensorDeaf
            | Self::SensorHung
            | Self::SensorWithheld
            | Self::HeadScattered
            | Self::HeadConstant
            | Self::HeadOutvoted
            | Self::SettingDoubted
            | Self::ComputerStalled
            | Self::CableLeft
            | Self::TimeLeft
            | Self::BatteryLeft => Priority::Warning,
            Self::Missed
            | Self::NoPosition
            | Self::NoSonar
            | Self::NoData
            | Self::CableDoubted
            | Self::OutsideTunnel
            | Self::ProfileContradicted
            | Self::NotRecorded => Priority::Alarm,
        }
    }

    /// Kind of the observation that the alert reports; `None` for other alerts.
    pub(super) fn observed(self) -> Option<ObservedKind> {
        ObservedKind::ALL.into_iter().find(|kind| Self::from(*kind) == self)
    }

    /// Whether an alert of this kind may name a sensor.
    ///
    /// For the cable counter, the sensor is the velocity log that it differs from, if any.
    pub(super) fn may_name_a_sensor(self) -> bool {
        self.is_of_sensor() || self == Self::CableDoubted
    }

    /// Whether each sensor has its own alert of this kind.
    pub(super) fn is_of_sensor(self) -> bool {
        matches!(
            self,
            Self::SensorSilent
                | Self::SensorStalled
                | Self::SensorDeaf
                | Self::SensorHung
                | Self::SensorWithheld
                | Self::HeadScattered
                | Self::HeadConstant
                | Self::HeadOutvoted
        )
    }
}

impl From<ObservedKind> for ListKind {
    fn from(kind: ObservedKind) -> Self {
        match kind {
            ObservedKind::OutsideTunnel => Self::OutsideTunnel,
            ObservedKind::ProfileContradicted => Self::ProfileContradicted,
            ObservedKind::HeadScattered => Self::HeadScattered,
            ObservedKind::HeadConstant => Self::HeadConstant,
            ObservedKind::HeadOutvoted => Self::HeadOutvoted,
            ObservedKind::CableDoubted => Self::CableDoubted,
            ObservedKind::SettingDoubted => Self::SettingDoubted,
        }
    }
}
