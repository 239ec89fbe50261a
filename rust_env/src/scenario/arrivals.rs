//! The rules of victims that arrive whatever becomes of others.

use super::check::{broken, within};
use super::{MAX_ARRIVAL_RATE_HZ, MAX_VICTIMS, Scenario, Situation};
use crate::error::Result;

impl Scenario {
    /// Refuses rates out of range or of another situation, and more slots than there may be.
    pub(super) fn validate_arrivals(&self) -> Result<()> {
        for (index, task) in self.tasks.iter().enumerate() {
            let key = format!("tasks[{index}].arrival_rate_hz");
            within(&key, task.arrival_rate_hz, 0.0, MAX_ARRIVAL_RATE_HZ, "1/s")?;
            if task.arrival_rate_hz > 0.0 && self.situation != Situation::Poisson {
                return broken(&key, &task.arrival_rate_hz, "must be 0 but where situation = \"poisson\"");
            }
        }
        if self.num_victims() > MAX_VICTIMS {
            let (tasks, most) = (self.tasks.len(), MAX_VICTIMS / self.tasks.len());
            let rule = format!("must be at most {most}: {tasks} tasks have {MAX_VICTIMS} slots together");
            return broken("max_victims", &self.max_victims, &rule);
        }
        Ok(())
    }
}
