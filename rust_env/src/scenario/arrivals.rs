//! Victims that arrive whatever becomes of others, and the rules of them.

use serde::{Deserialize, Serialize};

use super::check::{broken, counts, within};
use super::{MAX_ARRIVAL_RATE_HZ, MAX_ARRIVALS, MAX_TIME_S, MAX_VICTIMS, Scenario, Situation, steps_of};
use crate::error::Result;

/// A victim that arrives at a given time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arrival {
    /// When it arrives, s after the start of an episode.
    pub at_s: f64,
    /// Name of its task.
    pub task: String,
    /// Where it is, m.
    pub position_m: [f64; 2],
}

impl Scenario {
    /// Refuses rates and lists out of range or of another situation, and more slots than there may be.
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
        let key = "arrivals (their number)";
        counts(key, self.arrivals.len(), 0, MAX_ARRIVALS)?;
        if self.situation != Situation::Listed && !self.arrivals.is_empty() {
            return broken(key, &self.arrivals.len(), "must be 0 but where situation = \"listed\"");
        }
        if self.situation != Situation::Listed && self.end_when_done {
            return broken("end_when_done", &true, "must be false but where situation = \"listed\"");
        }
        let somewhere = self.obstacles.iter().position(|obstacle| obstacle.position_m.is_none());
        if let (Situation::Listed, Some(index)) = (self.situation, somewhere) {
            let rule = "must be given where situation = \"listed\", or it might be where a victim arrives";
            return broken(&format!("obstacles[{index}].position_m"), &"none", rule);
        }
        (0..self.arrivals.len()).try_for_each(|index| self.validate_arrival(index))
    }

    /// Refuses an arrival of no task, at no time, outside the walls, or beside too many at the same time.
    fn validate_arrival(&self, index: usize) -> Result<()> {
        let Arrival { at_s, task, position_m } = &self.arrivals[index];
        let key = |name: &str| format!("arrivals[{index}].{name}");
        within(&key("at_s"), *at_s, 0.0, MAX_TIME_S, "s")?;
        if !self.tasks.iter().any(|other| other.name == *task) {
            let names: Vec<&str> = self.tasks.iter().map(|task| task.name.as_str()).collect();
            let rule = format!("no such task; the scenario has {}", names.join(", "));
            return broken(&key("task"), &format!("{task:?}"), &rule);
        }
        let most = self.arena_half_width_m - self.wall_clearance_m;
        for (axis, value) in position_m.iter().enumerate() {
            within(&key(&format!("position_m[{axis}]")), *value, -most, most, "m")?;
        }
        let step = |at_s: f64| steps_of(at_s, self.dt_s);
        let beside = |other: &&Arrival| other.task == *task && step(other.at_s) == step(*at_s);
        let count = self.arrivals[..=index].iter().filter(beside).count();
        if count > self.max_victims {
            let most = self.max_victims;
            let rule = format!("{count} of task {task:?} in one control step; at most max_victims = {most}");
            return broken(&key("at_s"), at_s, &rule);
        }
        Ok(())
    }
}
