//! Order: which tasks come before which, and which victims have to wait for others.

use super::Victim;
use crate::scenario::{Scenario, Task};

/// The order of a scenario's tasks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Order {
    /// By task, a bit for each task that comes before it.
    before: Vec<u32>,
}

impl Order {
    /// The order of a valid scenario; `None` where every task may be done at any time.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let number = |name: &String| scenario.tasks.iter().position(|task| task.name == *name);
        let mask = |task: &Task| task.after.iter().filter_map(number).fold(0, |mask, task| mask | 1 << task);
        let before: Vec<u32> = scenario.tasks.iter().map(mask).collect();
        before.iter().any(|mask| *mask != 0).then_some(Self { before })
    }

    /// Whether a victim has to wait: one of a task that comes before its own is among `victims`, and appeared
    /// no later than it.
    #[must_use]
    pub fn is_blocked(&self, victim: &Victim, victims: &[Option<Victim>]) -> bool {
        let before = self.before[victim.task as usize];
        let blocks =
            |other: &Victim| before >> other.task & 1 == 1 && other.appeared_step <= victim.appeared_step;
        before != 0 && victims.iter().flatten().any(blocks)
    }

    /// The slots whose victims have to wait, as bits.
    #[must_use]
    pub fn blocked(&self, victims: &[Option<Victim>]) -> u64 {
        let waits = |slot: &usize| victims[*slot].is_some_and(|victim| self.is_blocked(&victim, victims));
        (0..victims.len()).filter(waits).fold(0, |mask, slot| mask | 1 << slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec2;

    fn order(before: &[u32]) -> Order {
        Order { before: before.to_vec() }
    }

    #[test]
    fn tasks_without_an_order_have_none() {
        let mut scenario = Scenario::default();
        assert_eq!(Order::new(&scenario), None);
        scenario.tasks[0].after = vec!["task_2".into()];
        assert_eq!(Order::new(&scenario), Some(order(&[0b10, 0])));
    }

    #[test]
    fn a_victim_waits_for_those_before_it_that_came_no_later() {
        let order = order(&[0b10, 0, 0b11]);
        let victim = |task, step| Some(Victim::new(0, task, step, Vec2::zeros()));
        assert_eq!(order.blocked(&[victim(0, 5), victim(1, 5)]), 0b01, "at the same step");
        assert_eq!(order.blocked(&[victim(0, 5), victim(1, 6)]), 0, "it came later");
        assert_eq!(order.blocked(&[victim(0, 5), None, victim(0, 9)]), 0, "no task before it is there");
        assert_eq!(order.blocked(&[victim(2, 9), victim(0, 7), victim(1, 8)]), 0b001);
        assert_eq!(order.blocked(&[victim(2, 9), victim(2, 7), victim(0, 8)]), 0b001);
    }
}
