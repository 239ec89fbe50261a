//! Victims that callers move, or let appear in empty slots.

use std::iter::zip;

use super::Batch;
use crate::error::{Error, Result};
use crate::geometry::Vec2;
use crate::tasks::Victim;

impl Batch {
    /// Moves victims, changes their tasks, and lets new ones appear in empty slots. `present` and `tasks`
    /// are E × V, `places` E × V × 2 in m, all in C order; the task and the place of a slot that stays empty
    /// are not looked at. A victim that was there keeps its number and the step at which it appeared, and
    /// its service as long as it keeps its task; a new one gets the next number. Obstacles and robots are not looked at, and nothing is drawn.
    ///
    /// # Errors
    /// [`Error::Argument`] for too many or too few values; [`Error::Victim`] for a victim that is taken
    /// away, a task that the slot cannot have, and a place where no victim appears. Nothing has changed
    /// then.
    pub fn set_victims(&mut self, present: &[bool], tasks: &[i64], places: &[f32]) -> Result<()> {
        let slots = self.rules.scenario.num_victims();
        let rows = self.num_envs() * slots;
        for (found, wanted) in [(present.len(), rows), (tasks.len(), rows), (places.len(), 2 * rows)] {
            if found != wanted {
                let value = format!("{found} values");
                return Err(Error::Argument { name: "victims", value, rule: format!("must be {wanted}") });
            }
        }
        let at = places.chunks_exact(2).map(|pair| Vec2::new(pair[0], pair[1]));
        let wanted = zip(present, zip(tasks, at)).map(|(present, (task, at))| present.then_some((*task, at)));
        let wanted: Vec<Option<(i64, Vec2)>> = wanted.collect();
        let there = self.worlds().flat_map(|world| &world.victims).map(Option::is_some);
        for (index, (there, wanted)) in zip(there, &wanted).enumerate() {
            self.check_victim(index / slots, index % slots, there, *wanted)?;
        }
        let worlds = self.shards.iter_mut().flat_map(|shard| &mut shard.worlds);
        for (world, wanted) in zip(worlds, wanted.chunks_exact(slots)) {
            for (slot, wanted) in zip(&mut world.victims, wanted) {
                let Some((task, position)) = *wanted else { continue };
                let task = task as u32;
                let victim = match slot {
                    Some(victim) if victim.task == task => Victim { position, ..*victim },
                    Some(victim) => Victim::new(victim.id, task, victim.appeared_step, position),
                    None => Victim::new(world.appeared, task, world.step, position),
                };
                world.appeared += u32::from(slot.is_none());
                *slot = Some(victim);
            }
            world.set_deadlines(&self.rules);
            world.perceive(&self.rules);
        }
        Ok(())
    }

    /// Refuses what no victim of a slot can be; `there` is whether it has one now.
    fn check_victim(&self, env: usize, slot: usize, there: bool, wanted: Option<(i64, Vec2)>) -> Result<()> {
        let refuse = |field, value: String, rule| Err(Error::Victim { field, env, slot, value, rule });
        let Some((task, at)) = wanted else {
            let rule = "must be true: a victim leaves when it is rescued or lost".into();
            return if there { refuse("present", "false".into(), rule) } else { Ok(()) };
        };
        let allowed = self.rules.spawn.tasks_of_slot(slot);
        if !usize::try_from(task).is_ok_and(|task| allowed.contains(&task)) {
            let (least, most) = (allowed.start(), allowed.end());
            return refuse("task", task.to_string(), format!("must be in {least}..={most}"));
        }
        let most = self.rules.spawn.victim_reach();
        for (field, value) in [("x", at.x), ("y", at.y)] {
            if !(-most..=most).contains(&value) {
                return refuse(field, value.to_string(), format!("must be in -{most}..={most} m"));
            }
        }
        Ok(())
    }
}
