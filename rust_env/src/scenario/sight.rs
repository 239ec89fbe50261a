//! How far robots see, and whether obstacles are in the way.

use super::Scenario;
use super::check::{broken, within};
use crate::error::Result;

/// Shortest and farthest sight, m: the radius of the smallest robot, and more than any arena is wide.
const SIGHTS_M: (f64, f64) = (0.005, 1000.0);

impl Scenario {
    /// Whether there is something in an arena that some robot does not see.
    #[must_use]
    pub fn has_limited_sight(&self) -> bool {
        self.occlusion || self.robots.iter().any(|robot| robot.sight_m.is_some())
    }

    /// Refuses sights out of range, and occlusion where nothing hides anything.
    pub(super) fn validate_sight(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
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
