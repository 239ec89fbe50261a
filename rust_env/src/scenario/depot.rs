//! Loads of robots and the depots that refill them, and the rules of both.

use serde::{Deserialize, Serialize};

use super::Scenario;
use super::check::counts;
use super::spot::default_radius_m;
use crate::error::Result;

/// Largest load of a robot, rescues.
const MAX_LOAD: usize = 1000;

/// A place that refills the loads of the robots that stand on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depot {
    /// Place of its centre, m.
    pub position_m: [f64; 2],
    /// How near to it the centre of a robot must be, m.
    #[serde(default = "default_radius_m")]
    pub radius_m: f64,
}

impl Scenario {
    /// Whether some robots have a load.
    #[must_use]
    pub fn has_loads(&self) -> bool {
        self.robots.iter().any(|robot| robot.load.is_some())
    }

    /// Refuses loads out of range, and depots that are of no use whatever happens.
    pub(super) fn validate_loads(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            let Some(load) = robot.load else { continue };
            counts(&format!("robots[{index}].load"), load as usize, 1, MAX_LOAD)?;
        }
        let spots: Vec<_> = self.depots.iter().map(|one| (one.position_m, one.radius_m)).collect();
        self.validate_spots("depots", &spots, |robot| robot.load.is_some(), "load")
    }
}
