//! Faults, described: which kinds there are, what their values mean, and what a scenario may say.

use serde::{Deserialize, Serialize};

use crate::check::{broken, counts, within};
use crate::error::Result;

/// What can go wrong with a robot (paper, sections I and II.B).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The drive's force is this share of the full one; 1 is healthy.
    MotorGain,
    /// The speed cap is this share of the full one; 1 is healthy.
    SpeedLimit,
    /// The drive's direction is turned by this angle, rad, counterclockwise; 0 is healthy.
    HeadingBias,
    /// Deviation of the error, on each axis, in where the robot takes itself to be, m; 0 is healthy.
    PositionNoise,
    /// Deviation of the error, on each axis, in the robot's sense of its own velocity, m/s; 0 is healthy.
    VelocityNoise,
    /// Share of control steps in which its sensors give what they took in the step before; 0 is healthy.
    FrozenSensor,
    /// Share of control steps in which it sees nothing but what it knows of itself: abilities,
    /// availability and, where they are seen, faults; 0 is healthy.
    Blackout,
    /// Share of control steps in which it neither drives nor helps, but is still in the way; 0 is healthy.
    Unavailable,
    /// Share of control steps in which it hears nothing of its teammates; 0 is healthy.
    LostCommunication,
}

/// Number of kinds.
pub const NUM_KINDS: usize = 9;

/// All kinds, in the order of [`Levels`].
pub const KINDS: [Kind; NUM_KINDS] = [
    Kind::MotorGain,
    Kind::SpeedLimit,
    Kind::HeadingBias,
    Kind::PositionNoise,
    Kind::VelocityNoise,
    Kind::FrozenSensor,
    Kind::Blackout,
    Kind::Unavailable,
    Kind::LostCommunication,
];

/// One robot's values of all kinds, indexed by `Kind as usize`.
pub type Levels = [f32; NUM_KINDS];

/// The levels of a robot without faults.
pub const HEALTHY: Levels = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

impl Kind {
    /// Its name, as in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MotorGain => "motor_gain",
            Self::SpeedLimit => "speed_limit",
            Self::HeadingBias => "heading_bias",
            Self::PositionNoise => "position_noise",
            Self::VelocityNoise => "velocity_noise",
            Self::FrozenSensor => "frozen_sensor",
            Self::Blackout => "blackout",
            Self::Unavailable => "unavailable",
            Self::LostCommunication => "lost_communication",
        }
    }

    /// Least and most value, and its unit.
    #[must_use]
    pub fn range(self) -> (f64, f64, &'static str) {
        match self {
            Self::HeadingBias => (-std::f64::consts::PI, std::f64::consts::PI, "rad"),
            Self::PositionNoise => (0.0, 10.0, "m"),
            Self::VelocityNoise => (0.0, 10.0, "m/s"),
            _ => (0.0, 1.0, ""),
        }
    }

    /// What two faults of this kind come to: factors multiply, angles add up, errors and strikes are
    /// independent of each other, and errors no larger than one fault's may be.
    #[must_use]
    pub fn combined(self, one: f32, other: f32) -> f32 {
        match self {
            Self::MotorGain | Self::SpeedLimit => one * other,
            Self::HeadingBias => {
                let turn = std::f32::consts::TAU;
                let sum = one + other;
                if sum.abs() > turn / 2.0 { sum - turn.copysign(sum) } else { sum }
            }
            Self::PositionNoise | Self::VelocityNoise => one.hypot(other).min(self.range().1 as f32),
            _ => one + other * (1.0 - one),
        }
    }
}

/// One fault of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Name of the robot.
    pub robot: String,
    /// What goes wrong.
    pub kind: Kind,
    /// How badly; see [`Kind`] for meaning and unit.
    pub value: f64,
    /// Control step of the episode at which it begins, or with a rate, from which on it may begin.
    #[serde(default)]
    pub onset_step: u32,
    /// How often it begins while it is not there, 1/s; at `onset_step`, once, if absent.
    #[serde(default)]
    pub onset_rate_hz: Option<f64>,
    /// Control steps it lasts; to the end of the episode if absent.
    #[serde(default)]
    pub duration_steps: Option<u32>,
}

impl Fault {
    /// Checks every value; `place` is the fault's key in the scenario.
    ///
    /// # Errors
    /// [`crate::error::Error::Scenario`] for the first rule that is broken.
    pub fn validate(&self, place: &str, robots: &[&str], episode_steps: u32) -> Result<()> {
        if !robots.contains(&self.robot.as_str()) {
            let rule = format!("no such robot; the team has {}", robots.join(", "));
            return broken(&format!("{place}.robot"), &format!("{:?}", self.robot), &rule);
        }
        let (low, high, unit) = self.kind.range();
        within(&format!("{place}.value ({})", self.kind.name()), self.value, low, high, unit)?;
        if self.onset_step >= episode_steps {
            let rule = format!("must be before the end of the episode of {episode_steps} control steps");
            return broken(&format!("{place}.onset_step"), &self.onset_step, &rule);
        }
        if let Some(rate) = self.onset_rate_hz {
            within(&format!("{place}.onset_rate_hz"), rate, 1e-6, 1000.0, "1/s")?;
        }
        match self.duration_steps {
            Some(steps) => counts(&format!("{place}.duration_steps"), steps as usize, 1, 1_000_000),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_stand_in_the_order_of_their_numbers() {
        for (index, kind) in KINDS.into_iter().enumerate() {
            assert_eq!(kind as usize, index);
            assert_eq!(serde_json::to_string(&kind).ok(), Some(format!("\"{}\"", kind.name())));
        }
    }

    #[test]
    fn a_healthy_level_changes_no_other() {
        for kind in KINDS {
            let (low, high, _) = kind.range();
            for value in [low, 0.3, high].map(|value| value as f32) {
                let found = kind.combined(value, HEALTHY[kind as usize]);
                assert!((found - value).abs() < 1e-6, "{} {value}", kind.name());
            }
        }
        assert!((Kind::HeadingBias.combined(3.0, 1.0) - (4.0 - std::f32::consts::TAU)).abs() < 1e-6);
        assert!((Kind::Blackout.combined(0.5, 0.5) - 0.75).abs() < 1e-6);
        assert!((Kind::PositionNoise.combined(3.0, 4.0) - 5.0).abs() < 1e-6);
        assert_eq!(Kind::PositionNoise.combined(8.0, 8.0).to_bits(), 10.0_f32.to_bits());
        for share in [0.0, 0.1, 0.3, 0.7, 1.0] {
            // What strikes always does so beside anything else.
            assert_eq!(Kind::Blackout.combined(1.0, share).to_bits(), 1.0_f32.to_bits());
            assert_eq!(Kind::Blackout.combined(share, 1.0).to_bits(), 1.0_f32.to_bits());
        }
        assert!((Kind::MotorGain.combined(0.5, 0.5) - 0.25).abs() < 1e-6);
    }
}
