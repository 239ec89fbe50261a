//! The rules of areas in which victims appear: of all tasks, and of a task of its own.

use super::check::{broken, within};
use super::{Scenario, Situation};
use crate::error::Result;

impl Scenario {
    /// Refuses an area that goes beyond the places where victims may be, or whose corners are exchanged.
    pub(super) fn validate_area(&self, key: &str, area: Option<[f64; 4]>) -> Result<()> {
        let Some(area) = area else { return Ok(()) };
        let most = self.arena_half_width_m - self.wall_clearance_m;
        for (index, value) in area.into_iter().enumerate() {
            within(&format!("{key}[{index}]"), value, -most, most, "m")?;
        }
        for (low, high) in [(0, 2), (1, 3)] {
            if area[low] > area[high] {
                let rule = format!("must be at most {key}[{high}], which is {}", area[high]);
                return broken(&format!("{key}[{low}]"), &area[low], &rule);
            }
        }
        Ok(())
    }

    /// Refuses areas of tasks out of range, with too few of the listed places, and arrivals outside of them.
    pub(super) fn validate_task_areas(&self) -> Result<()> {
        for (index, task) in self.tasks.iter().enumerate() {
            let key = format!("tasks[{index}].area_m");
            self.validate_area(&key, task.area_m)?;
            let Some(area) = task.area_m else { continue };
            let found = self.victim_places_m.iter().filter(|at| task.holds(at)).count();
            let least = self.places_needed(index);
            if !self.victim_places_m.is_empty() && found < least {
                let rule = format!(
                    "has {found} of victim_places_m in it; must have at least {least}, or a victim of task {:?} \
                     may find all of them taken",
                    task.name
                );
                return broken(&key, &format!("{area:?}"), &rule);
            }
            let outside = |place: &[f64; 2]| !task.holds(place);
            let away = self.arrivals.iter().position(|one| one.task == task.name && outside(&one.position_m));
            if let Some(arrival) = away {
                let rule = format!("must be in the area of its task {:?}: {key} = {area:?}", task.name);
                let at = self.arrivals[arrival].position_m;
                return broken(&format!("arrivals[{arrival}].position_m"), &format!("{at:?}"), &rule);
            }
        }
        Ok(())
    }

    /// How many listed places a task must have, so that its victims find a free one whatever the others took.
    fn places_needed(&self, index: usize) -> usize {
        if matches!(self.situation, Situation::Single | Situation::Mixed) {
            return self.num_victims(); // all of them may be of this task
        }
        let (task, slots) = (&self.tasks[index], self.num_victims() / self.tasks.len());
        let others = self.tasks.iter().enumerate().filter(|(other, _)| *other != index);
        let taken = others.map(|(_, other)| {
            let shared = self.victim_places_m.iter().filter(|at| task.holds(at) && other.holds(at));
            shared.count().min(slots)
        });
        slots + taken.sum::<usize>()
    }
}
