//! Deadlines: how long a victim waits for its rescue before it is lost.

use super::{Victim, steps_of};
use crate::rng::{Purpose, Stream};
use crate::scenario::{Deadline, Scenario, Task};

/// The deadlines of a scenario's tasks.
#[derive(Debug, Clone)]
pub struct Deadlines {
    /// By task, the least and the largest, s; none where its victims wait for ever.
    of_task: Vec<Option<[f64; 2]>>,
    dt_s: f64,
    /// The longest of all, in control steps.
    longest: f32,
}

impl Deadlines {
    /// The deadlines of a valid scenario; `None` where no task has one.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let range = |task: &Task| task.deadline_s.map(Deadline::range);
        let of_task: Vec<Option<[f64; 2]>> = scenario.tasks.iter().map(range).collect();
        let longest = of_task.iter().flatten().map(|range| range[1]).reduce(f64::max)?;
        let longest = steps_of(longest, scenario.dt_s) as f32;
        Some(Self { of_task, dt_s: scenario.dt_s, longest })
    }

    /// Steps done in the episode when the victim is lost; `u32::MAX` for never. The stream of deadlines has
    /// one word for each victim of the episode, so this is the same whenever it is asked for.
    #[must_use]
    pub fn step_of(&self, victim: &Victim, seed: u64, world: u64, episode: u64) -> u32 {
        let Some([low, high]) = self.of_task[victim.task as usize] else { return u32::MAX };
        let mut stream = Stream::new(seed, world, episode, Purpose::Deadlines).resume(u64::from(victim.id));
        let seconds = low + (high - low) * f64::from(stream.unit());
        victim.appeared_step.saturating_add(steps_of(seconds, self.dt_s))
    }

    /// Time that the victim has left after `step` steps, as a share of the longest deadline; 1 for one
    /// that waits for ever.
    #[must_use]
    pub fn share_left(&self, victim: &Victim, step: u32) -> f32 {
        (victim.deadline_step.saturating_sub(step) as f32 / self.longest).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec2;

    fn deadlines(of: [Option<Deadline>; 2]) -> Option<Deadlines> {
        let mut scenario = Scenario::default();
        for (task, deadline) in scenario.tasks.iter_mut().zip(of) {
            task.deadline_s = deadline;
        }
        Deadlines::new(&scenario)
    }

    #[test]
    fn a_task_without_a_deadline_waits_for_ever() {
        assert!(deadlines([None, None]).is_none());
        let some = deadlines([None, Some(Deadline::Same(1.2))]).expect("one has");
        let (endless, mut mortal) =
            (Victim::new(0, 0, 5, Vec2::zeros()), Victim::new(1, 1, 5, Vec2::zeros()));
        assert_eq!(some.step_of(&endless, 1, 2, 3), u32::MAX);
        assert_eq!(some.share_left(&endless, 7).to_bits(), 1_f32.to_bits());
        mortal.deadline_step = some.step_of(&mortal, 1, 2, 3);
        assert_eq!(mortal.deadline_step, 17);
        let left = [5, 8, 17, 30].map(|step| (some.share_left(&mortal, step) * 12.0).round() as i32);
        assert_eq!(left, [12, 9, 0, 0]);
    }

    #[test]
    fn deadlines_are_drawn_evenly_and_for_each_victim_by_itself() {
        let some = deadlines([Some(Deadline::Between([1.0, 3.0])), None]).expect("one has");
        let step = |id| some.step_of(&Victim::new(id, 0, 0, Vec2::zeros()), 1, 2, 3);
        let steps: Vec<u32> = (0..20_000).map(step).collect();
        assert_eq!(step(77), steps[77]);
        let share = |steps: &[u32], least| steps.iter().filter(|step| **step <= least).count();
        assert!(steps.iter().all(|step| (10..=30).contains(step)));
        assert!(share(&steps, 15).abs_diff(5000) < 250 && share(&steps, 25).abs_diff(15_000) < 250);
        let lag = steps.windows(2).filter(|pair| (pair[0] <= 20) == (pair[1] <= 20)).count();
        assert!(lag.abs_diff(10_000) < 300, "neighbours are alike {lag} times of 20,000");
    }
}
