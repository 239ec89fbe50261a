//! Faults: which kinds there are, what each does, and what a scenario may say of one. To add a kind, add
//! a row to the table of kinds here.

use serde::{Deserialize, Serialize};

/// What a fault of one kind is.
pub struct Spec {
    /// Its name, as in a scenario.
    pub name: &'static str,
    /// Least and most value.
    pub range: (f64, f64),
    /// Unit of the value; empty for a share.
    pub unit: &'static str,
    /// The value that changes nothing.
    pub healthy: f32,
    /// What the value means, in a few words.
    pub meaning: &'static str,
    /// What the values of two faults of this kind on one robot come to.
    pub combine: fn(f32, f32) -> f32,
    /// What a value does.
    pub effect: Effect,
}

/// What the value of a fault does.
pub enum Effect {
    /// Changes how the robot drives.
    Drive(fn(&mut Drive, f32)),
    /// Is the standard deviation of a normal error, on each axis, in what the robot senses of itself:
    /// see [`crate::fault_state::FaultState::senses`].
    SensorError,
    /// Is the share of control steps that the fault strikes, each step by itself: see
    /// [`crate::fault_state::FaultState::is_struck`].
    Strike,
}

/// How a robot drives: the default is a healthy robot's way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Share of the force that is left.
    pub force: f32,
    /// Share of the speed cap that is left.
    pub speed: f32,
    /// Angle by which the direction is turned, rad, counterclockwise.
    pub turn: f32,
}

impl Default for Drive {
    fn default() -> Self {
        Self { force: 1.0, speed: 1.0, turn: 0.0 }
    }
}

/// Writes the enum of the kinds and the table of their specifications from one list.
macro_rules! kinds {
    ($($kind:ident { $($spec:tt)* })*) => {
        /// What can go wrong with a robot (paper, sections I and II.B); [`SPECS`] describes each kind.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[allow(missing_docs)]
        pub enum Kind { $($kind),* }

        /// All kinds, in the order of [`Levels`].
        pub const KINDS: [Kind; NUM_KINDS] = [$(Kind::$kind),*];

        /// What each kind is, indexed by `Kind as usize`.
        pub const SPECS: &[Spec] = &[$(Spec { $($spec)* }),*];
    };
}

kinds! {
    MotorGain {
        name: "motor_gain",
        range: (0.0, 1.0),
        unit: "",
        healthy: 1.0,
        meaning: "share of the drive's force that is left",
        combine: product,
        effect: Effect::Drive(|drive, share| drive.force *= share),
    }
    SpeedLimit {
        name: "speed_limit",
        range: (0.0, 1.0),
        unit: "",
        healthy: 1.0,
        meaning: "share of the speed cap that is left",
        combine: product,
        effect: Effect::Drive(|drive, share| drive.speed *= share),
    }
    HeadingBias {
        name: "heading_bias",
        range: (-std::f64::consts::PI, std::f64::consts::PI),
        unit: "rad",
        healthy: 0.0,
        meaning: "angle by which the drive's direction is turned, counterclockwise",
        combine: sum_of_angles,
        effect: Effect::Drive(|drive, angle| drive.turn += angle),
    }
    PositionNoise {
        name: "position_noise",
        range: (0.0, MOST_ERROR),
        unit: "m",
        healthy: 0.0,
        meaning: "standard deviation, on each axis, of the error in the robot's sense of its position",
        combine: independent_errors,
        effect: Effect::SensorError,
    }
    VelocityNoise {
        name: "velocity_noise",
        range: (0.0, MOST_ERROR),
        unit: "m/s",
        healthy: 0.0,
        meaning: "standard deviation, on each axis, of the error in the robot's sense of its velocity",
        combine: independent_errors,
        effect: Effect::SensorError,
    }
    FrozenSensor {
        name: "frozen_sensor",
        range: (0.0, 1.0),
        unit: "",
        healthy: 0.0,
        meaning: "share of control steps in which its sensors repeat what they gave in the step before",
        combine: either,
        effect: Effect::Strike,
    }
    Blackout {
        name: "blackout",
        range: (0.0, 1.0),
        unit: "",
        healthy: 0.0,
        meaning: "share of control steps in which it sees nothing but its own abilities, availability and, \
                  where they are observed, faults",
        combine: either,
        effect: Effect::Strike,
    }
    Unavailable {
        name: "unavailable",
        range: (0.0, 1.0),
        unit: "",
        healthy: 0.0,
        meaning: "share of control steps in which it neither drives nor helps, but is still in the way",
        combine: either,
        effect: Effect::Strike,
    }
    LostCommunication {
        name: "lost_communication",
        range: (0.0, 1.0),
        unit: "",
        healthy: 0.0,
        meaning: "share of control steps in which it hears nothing of its teammates",
        combine: either,
        effect: Effect::Strike,
    }
}

/// Most standard deviation of an error, m or m/s.
const MOST_ERROR: f64 = 10.0;

/// Number of kinds.
pub const NUM_KINDS: usize = SPECS.len();

/// One robot's values of all kinds, indexed by `Kind as usize`.
pub type Levels = [f32; NUM_KINDS];

/// The levels of a robot without faults.
pub const HEALTHY: Levels = {
    let mut levels = [0.0; NUM_KINDS];
    let mut kind = 0;
    while kind < NUM_KINDS {
        levels[kind] = SPECS[kind].healthy;
        kind += 1;
    }
    levels
};

/// Shares multiply.
#[must_use]
pub fn product(one: f32, other: f32) -> f32 {
    one * other
}

/// Angles add up, into −π to π.
#[must_use]
pub fn sum_of_angles(one: f32, other: f32) -> f32 {
    let turn = std::f32::consts::TAU;
    let sum = one + other;
    if sum.abs() > turn / 2.0 { sum - turn.copysign(sum) } else { sum }
}

/// The standard deviation of two independent errors, no larger than one fault's may be.
#[must_use]
pub fn independent_errors(one: f32, other: f32) -> f32 {
    libm::hypotf(one, other).min(MOST_ERROR as f32)
}

/// The share of steps in which at least one of two independent faults strikes.
#[must_use]
pub fn either(one: f32, other: f32) -> f32 {
    one + other * (1.0 - one)
}

impl Kind {
    /// What this kind is.
    #[must_use]
    pub const fn spec(self) -> &'static Spec {
        &SPECS[self as usize]
    }

    /// Its name, as in a scenario.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.spec().name
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
    /// How badly; see [`SPECS`] for meaning and unit.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_has_one_name_and_one_number() {
        for (index, kind) in KINDS.into_iter().enumerate() {
            assert_eq!(kind as usize, index);
            assert_eq!(serde_json::to_string(&kind).ok(), Some(format!("\"{}\"", kind.name())));
        }
    }

    #[test]
    fn healthy_values_change_nothing() {
        for spec in SPECS {
            let (low, high) = spec.range;
            assert!((low..=high).contains(&f64::from(spec.healthy)), "{}", spec.name);
            for value in [low, 0.3, high].map(|value| value as f32) {
                let found = (spec.combine)(value, spec.healthy);
                assert!((found - value).abs() < 1e-6, "{} {value}", spec.name);
            }
            if let Effect::Drive(change) = spec.effect {
                let mut drive = Drive::default();
                change(&mut drive, spec.healthy);
                assert_eq!(drive, Drive::default(), "{}", spec.name);
            }
        }
    }

    #[test]
    fn faults_of_one_kind_combine() {
        assert!((sum_of_angles(3.0, 1.0) - (4.0 - std::f32::consts::TAU)).abs() < 1e-6);
        assert!((either(0.5, 0.5) - 0.75).abs() < 1e-6);
        assert!((independent_errors(3.0, 4.0) - 5.0).abs() < 1e-6);
        assert_eq!(independent_errors(8.0, 8.0).to_bits(), 10.0_f32.to_bits());
        assert!((product(0.5, 0.5) - 0.25).abs() < 1e-6);
        for share in [0.0, 0.1, 0.3, 0.7, 1.0] {
            // What strikes always does so beside anything else.
            assert_eq!(either(1.0, share).to_bits(), 1.0_f32.to_bits());
            assert_eq!(either(share, 1.0).to_bits(), 1.0_f32.to_bits());
        }
    }
}
