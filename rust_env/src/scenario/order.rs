//! The rules of the order of tasks.

use super::check::broken;
use super::{Scenario, Task};
use crate::error::Result;
use crate::matching::bits;

impl Scenario {
    /// Refuses tasks after unknown ones, after themselves, and after each other.
    pub(super) fn validate_order(&self) -> Result<()> {
        for (index, task) in self.tasks.iter().enumerate() {
            let key = format!("tasks[{index}].after");
            for (place, name) in task.after.iter().enumerate() {
                let value = format!("{name:?}");
                if *name == task.name {
                    return broken(&key, &value, "a task cannot come after itself");
                }
                if task.after[..place].contains(name) {
                    return broken(&key, &value, "is named twice");
                }
                if !self.tasks.iter().any(|other| other.name == *name) {
                    let names: Vec<&str> = self.tasks.iter().map(|task| task.name.as_str()).collect();
                    let rule = format!("no such task; the scenario has {}", names.join(", "));
                    return broken(&key, &value, &rule);
                }
            }
        }
        match self.task_of_a_cycle() {
            Some(task) => broken(
                &format!("tasks[{task}].after"),
                &format!("[{}]", self.tasks[task].after.join(", ")),
                &format!("{:?} would come after itself; the order must have no cycle", self.tasks[task].name),
            ),
            None => Ok(()),
        }
    }

    /// The first task that comes before itself by others; `None` where there is none.
    fn task_of_a_cycle(&self) -> Option<usize> {
        let number = |name: &String| self.tasks.iter().position(|task| task.name == *name);
        let of =
            |task: &Task| task.after.iter().filter_map(number).fold(0, |mask, task| mask | 1_u64 << task);
        let before: Vec<u64> = self.tasks.iter().map(of).collect();
        let earlier = |mask: u64| bits(mask).fold(mask, |mask, task| mask | before[task]);
        let comes_before_itself = |task: &usize| {
            let all = before.iter().fold(before[*task], |mask, _| earlier(mask));
            all >> task & 1 == 1
        };
        (0..before.len()).find(comes_before_itself)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The task of a cycle where each task, by number, comes after those listed.
    fn found(after: &[&[usize]]) -> Option<usize> {
        let task = |(number, after): (usize, &&[usize])| Task {
            after: after.iter().map(|other| format!("t{other}")).collect(),
            ..Task::new(&format!("t{number}"), vec!["food".to_string()])
        };
        let tasks = after.iter().enumerate().map(task).collect();
        Scenario { tasks, ..Scenario::default() }.task_of_a_cycle()
    }

    #[test]
    fn cycles_are_found_and_nothing_else() {
        assert_eq!(found(&[&[1], &[]]), None);
        assert_eq!(found(&[&[0]]), Some(0));
        assert_eq!(found(&[&[1], &[2], &[1]]), Some(1), "task 0 is only behind it");
        assert_eq!(found(&[&[1, 2], &[2], &[], &[0, 1, 2]]), None);
        let ring: Vec<Vec<usize>> = (0..32).map(|task| vec![(task + 1) % 32]).collect();
        let ring: Vec<&[usize]> = ring.iter().map(Vec::as_slice).collect();
        assert_eq!(found(&ring), Some(0));
        assert_eq!(found(&[&ring[..31], &[&[]]].concat()), None);
    }
}
