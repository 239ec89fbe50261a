//! Who hears whom, when, and what robots tell each other.

use serde::{Deserialize, Serialize};

use super::Scenario;
use super::check::{broken, counts, within};
use crate::error::Result;

/// Shortest and farthest range, m: those of sight.
const RANGES_M: (f64, f64) = (0.005, 1000.0);
/// Longest delay, steps.
pub const MAX_DELAY_STEPS: usize = 20;

/// What robots tell each other without being asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Share {
    /// Nothing.
    #[default]
    Nothing,
    /// Which victims they see.
    Victims,
}

/// How a team communicates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Communication {
    /// How far a robot is heard, from centre to centre when it sends, m; everywhere if absent.
    pub range_m: Option<f64>,
    /// Control steps from sending to hearing.
    pub delay_steps: u32,
    /// The chance that what one robot sends to another in a step does not arrive.
    pub loss: f64,
    /// What robots tell each other.
    pub share: Share,
}

impl Communication {
    /// Whether some robots do not hear others, or not at once.
    #[must_use]
    pub fn limits(&self) -> bool {
        self.range_m.is_some() || self.delay_steps > 0 || self.loss > 0.0
    }
}

impl Scenario {
    /// Refuses ranges, delays and losses out of range, and sharing what all see.
    pub(super) fn validate_communication(&self) -> Result<()> {
        let Some(found) = &self.communication else { return Ok(()) };
        if let Some(range) = found.range_m {
            within("communication.range_m", range, RANGES_M.0, RANGES_M.1, "m")?;
        }
        counts("communication.delay_steps", found.delay_steps as usize, 0, MAX_DELAY_STEPS)?;
        if !(0.0..1.0).contains(&found.loss) {
            return broken("communication.loss", &found.loss, "must be at least 0 and below 1");
        }
        if found.share == Share::Victims && !self.has_limited_sight() {
            let rule = "must be \"nothing\" where no sight_m and no occlusion limits what robots see";
            return broken("communication.share", &"\"victims\"", rule);
        }
        Ok(())
    }
}
