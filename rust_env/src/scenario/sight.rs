//! How far robots see, and whether obstacles are in the way.

use super::check::{broken, within};
use super::{Robot, Scenario};
use crate::error::Result;

/// Shortest and farthest sight, m: the radius of the smallest robot, and more than any arena is wide.
const SIGHTS_M: (f64, f64) = (0.005, 1000.0);

/// All around, degrees.
pub(super) const FULL_TURN_DEG: f64 = 360.0;

/// The field of view of a robot unless a scenario says so.
pub fn default_field_of_view_deg() -> f64 {
    FULL_TURN_DEG
}

impl Robot {
    /// Whether it sees less than everything that nothing hides.
    #[must_use]
    pub fn has_limited_sight(&self) -> bool {
        self.sight_m.is_some() || self.field_of_view_deg < FULL_TURN_DEG
    }

    /// Refuses a field of view (of this key) out of range, or without a heading.
    pub(super) fn validate_field_of_view(&self, key: &str, degrees: f64) -> Result<()> {
        within(key, degrees, 1.0, FULL_TURN_DEG, "degrees")?;
        if degrees < FULL_TURN_DEG && !self.has_wheels() {
            let rule = "must be 360 of a robot without a heading; drive = \"unicycle\" and \"differential\" have one";
            return broken(key, &degrees, rule);
        }
        Ok(())
    }
}

impl Scenario {
    /// Whether there is something in an arena that some robot does not see.
    #[must_use]
    pub fn has_limited_sight(&self) -> bool {
        self.occlusion || self.robots.iter().any(Robot::has_limited_sight)
    }

    /// Refuses sights out of range, and occlusion where nothing hides anything.
    pub(super) fn validate_sight(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            robot.validate_field_of_view(
                &format!("robots[{index}].field_of_view_deg"),
                robot.field_of_view_deg,
            )?;
            let Some(sight) = robot.sight_m else { continue };
            let key = format!("robots[{index}].sight_m");
            within(&key, sight, SIGHTS_M.0, SIGHTS_M.1, "m")?;
            if sight <= robot.radius_m {
                let rule =
                    format!("must be above radius_m = {} m: it counts from its centre", robot.radius_m);
                return broken(&key, &sight, &rule);
            }
        }
        if self.occlusion && self.obstacles.is_empty() && self.map.is_none() {
            return broken("occlusion", &true, "must be false where there are no obstacles to hide behind");
        }
        Ok(())
    }
}
