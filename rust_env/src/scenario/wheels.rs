//! Robots on wheels: how fast they turn and speed up.

use std::f64::consts::PI;

use super::check::{broken, within};
use super::{DriveMode, Robot, Scenario};
use crate::error::Result;

/// Highest turn rate unless a scenario says so, rad/s.
pub fn default_max_turn_rad_s() -> f64 {
    4.0
}

/// Acceleration along the heading, or of a wheel, unless a scenario says so, m/s².
pub fn default_acceleration_m_s2() -> f64 {
    5.0
}

/// Acceleration of the turn rate unless a scenario says so, rad/s².
pub fn default_turn_acceleration_rad_s2() -> f64 {
    20.0
}

impl Robot {
    /// Whether it drives along a heading.
    #[must_use]
    pub fn has_wheels(&self) -> bool {
        matches!(self.drive, DriveMode::Unicycle | DriveMode::Differential)
    }

    /// Distance of its two wheels, m.
    #[must_use]
    pub fn track_m(&self) -> f64 {
        self.wheel_base_m.unwrap_or(2.0 * self.radius_m)
    }
}

impl Scenario {
    /// Whether some robot has a heading.
    #[must_use]
    pub fn has_wheels(&self) -> bool {
        self.robots.iter().any(Robot::has_wheels)
    }

    /// Refuses wheels out of range, and turns that a control period cannot tell from others.
    pub(super) fn validate_wheels(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            let key = |name: &str| format!("robots[{index}].{name}");
            within(&key("max_turn_rad_s"), robot.max_turn_rad_s, 0.01, 1e4, "rad/s")?;
            within(&key("acceleration_m_s2"), robot.acceleration_m_s2, 0.01, 1e5, "m/s^2")?;
            let turn = robot.turn_acceleration_rad_s2;
            within(&key("turn_acceleration_rad_s2"), turn, 0.01, 1e6, "rad/s^2")?;
            if let Some(base) = robot.wheel_base_m {
                within(&key("wheel_base_m"), base, 0.005, 20.0, "m")?;
                let most = 2.0 * robot.radius_m;
                if base > most * (1.0 + 1e-12) {
                    let rule = format!("must be at most {most} m: both wheels are on its disc");
                    return broken(&key("wheel_base_m"), &base, &rule);
                }
            }
            if robot.has_wheels() && robot.max_turn_rad_s * self.dt_s > PI * (1.0 + 1e-12) {
                let rule = format!(
                    "must be at most {:.6} rad/s: no robot may turn by more than half a circle in a control \
                     period (dt_s = {} s)",
                    PI / self.dt_s,
                    self.dt_s
                );
                return broken(&key("max_turn_rad_s"), &robot.max_turn_rad_s, &rule);
            }
        }
        Ok(())
    }
}
