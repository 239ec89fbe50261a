//! Range sensors: how many rays a robot has, how far they reach, and what they meet.

use serde::{Deserialize, Serialize};

use super::check::{broken, counts, within};
use super::sight::{self, FULL_TURN_DEG};
use super::{Robot, Scenario};
use crate::error::Result;

/// Most rays of a sensor.
pub const MAX_RAYS: usize = 360;
/// Shortest and farthest range, m: those of sight.
const RANGES_M: (f64, f64) = (0.005, 1000.0);

/// Widest field of view below a full turn, degrees: of a wider one the first and the last ray are the same.
const WIDEST_FAN_DEG: f64 = 359.99;

/// A sensor that measures how far things are along rays from a robot's centre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeSensor {
    /// Number of rays.
    pub rays: usize,
    /// How far each reaches from the robot's centre, m.
    pub range_m: f64,
    /// The angle over which the rays spread, its middle straight ahead, degrees.
    #[serde(default = "sight::default_field_of_view_deg")]
    pub field_of_view_deg: f64,
    /// The layers whose robots and obstacles the rays meet; the robot's own if absent.
    #[serde(default)]
    pub layers: Option<Vec<String>>,
}

impl RangeSensor {
    /// The angle of each ray from straight ahead, counterclockwise, rad. All around, the first is straight ahead;
    /// over a narrower field of view, the first is its right edge and the last its left one.
    #[must_use]
    pub fn angles(&self) -> Vec<f64> {
        let (rays, field) = (self.rays as f64, self.field_of_view_deg.to_radians());
        let angle = |ray: f64| match self.rays {
            1 => 0.0,
            _ if self.is_all_around() => field * ray / rays,
            _ => 0.5 * field * (2.0 * ray + 1.0 - rays) / (rays - 1.0), // the same on both sides
        };
        (0..self.rays).map(|ray| angle(ray as f64)).collect()
    }

    /// Whether the rays go all around.
    #[must_use]
    pub fn is_all_around(&self) -> bool {
        self.field_of_view_deg >= FULL_TURN_DEG
    }

    /// Whether the rays of a robot in the layer `own` meet what is in `layer`.
    #[must_use]
    pub fn meets(&self, own: &str, layer: &str) -> bool {
        self.layers.as_ref().map_or(own == layer, |layers| layers.iter().any(|name| name == layer))
    }
}

impl Scenario {
    /// Most rays that a robot of the team has.
    #[must_use]
    pub fn max_rays(&self) -> usize {
        let rays = self.robots.iter().filter_map(|robot| robot.range_sensor.as_ref());
        rays.map(|sensor| sensor.rays).max().unwrap_or(0)
    }

    /// Refuses numbers of rays, ranges and fields of view out of range, and a front without a heading.
    pub(super) fn validate_range_sensors(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            if let Some(sensor) = &robot.range_sensor {
                self.validate_range_sensor(robot, sensor, |name| {
                    format!("robots[{index}].range_sensor.{name}")
                })?;
            }
        }
        Ok(())
    }

    fn validate_range_sensor(
        &self,
        robot: &Robot,
        sensor: &RangeSensor,
        key: impl Fn(&str) -> String,
    ) -> Result<()> {
        counts(&key("rays"), sensor.rays, 1, MAX_RAYS)?;
        within(&key("range_m"), sensor.range_m, RANGES_M.0, RANGES_M.1, "m")?;
        if sensor.range_m <= robot.radius_m {
            let rule = format!("must be above radius_m = {} m: it counts from its centre", robot.radius_m);
            return broken(&key("range_m"), &sensor.range_m, &rule);
        }
        let field = sensor.field_of_view_deg;
        robot.validate_field_of_view(&key("field_of_view_deg"), field)?;
        if sensor.rays > 1 && field > WIDEST_FAN_DEG && !sensor.is_all_around() {
            let rule = format!(
                "must be {FULL_TURN_DEG}, or at most {WIDEST_FAN_DEG}: the first ray would be the last one, too"
            );
            return broken(&key("field_of_view_deg"), &field, &rule);
        }
        match &sensor.layers {
            Some(layers) => self.validate_blocked(&key("layers"), layers),
            None => Ok(()),
        }
    }
}
