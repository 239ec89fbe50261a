//! Schedules, and what comes of them: an exact simulation, event by event.

use crate::coalition::fills;
use crate::error::{Error, Result};
use crate::instance::Instance;

/// For each robot, the tasks that it goes to, in order.
pub type Schedule = Vec<Vec<usize>>;

/// What comes of a schedule.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// When the robots begin to work on each task.
    pub starts: Vec<f64>,
    /// When each robot is back at its depot; 0 for one that never leaves.
    pub returns: Vec<f64>,
    /// When the last robot is back.
    pub makespan: f64,
}

/// Plays a schedule: a robot goes to its next task at once and waits there until all needs are filled.
///
/// # Errors
/// [`Error::Schedule`] if a task is not served by exactly the robots that it needs, [`Error::Deadlock`] if
/// robots wait for each other for ever.
pub fn simulate(instance: &Instance, schedule: &Schedule) -> Result<Outcome> {
    let (robots, tasks) = (instance.robots.len(), instance.tasks.len());
    check(instance, schedule)?;
    let mut free = vec![0.0_f64; robots];
    let mut place: Vec<usize> = (0..robots).collect();
    let mut next = vec![0; robots];
    let mut waiting: Vec<Vec<usize>> = vec![vec![]; tasks];
    let mut starts = vec![0.0_f64; tasks];
    let mut moving: Vec<usize> = (0..robots).collect();
    while let Some(robot) = moving.pop() {
        let Some(task) = schedule[robot].get(next[robot]).copied() else { continue };
        starts[task] = starts[task].max(free[robot] + instance.travel(place[robot], task));
        waiting[task].push(robot);
        if waiting[task].len() < instance.tasks[task].needs.len() {
            continue;
        }
        for robot in std::mem::take(&mut waiting[task]) {
            free[robot] = starts[task] + instance.tasks[task].duration;
            place[robot] = instance.place_of(task);
            next[robot] += 1;
            moving.push(robot);
        }
    }
    refuse_deadlock(&waiting)?;
    let way_home = |robot: usize| schedule[robot].last().map_or(0.0, |task| instance.travel(robot, *task));
    let returns: Vec<f64> = (0..robots).map(|robot| free[robot] + way_home(robot)).collect();
    let makespan = returns.iter().copied().fold(0.0, f64::max);
    Ok(Outcome { starts, returns, makespan })
}

/// Whether each task has the robots that it needs, and no others.
fn check(instance: &Instance, schedule: &Schedule) -> Result<()> {
    let refused = |text: String| Err(Error::Schedule(text));
    if schedule.len() != instance.robots.len() {
        return refused(format!("has {} robots: must have {}", schedule.len(), instance.robots.len()));
    }
    let skills: Vec<u32> = instance.robots.iter().map(|robot| robot.skills).collect();
    let mut served: Vec<Vec<usize>> = vec![vec![]; instance.tasks.len()];
    for (robot, tasks) in schedule.iter().enumerate() {
        for task in tasks {
            let Some(there) = served.get_mut(*task) else {
                let most = instance.tasks.len() - 1;
                return refused(format!("robot {robot} goes to task {task}: must be 0 to {most}"));
            };
            if there.last() == Some(&robot) {
                return refused(format!("robot {robot} goes to task {task} twice"));
            }
            there.push(robot);
        }
    }
    for (index, (task, robots)) in instance.tasks.iter().zip(&served).enumerate() {
        if robots.len() != task.needs.len() || !fills(&task.needs, &skills, robots) {
            let needs = &task.needs;
            return refused(format!("robots {robots:?} go to task {index}: must fill its needs {needs:?}"));
        }
    }
    Ok(())
}

/// Most waiting robots that a message names.
const MOST_NAMED: usize = 8;

fn refuse_deadlock(waiting: &[Vec<usize>]) -> Result<()> {
    let stuck = waiting.iter().enumerate().flat_map(|(task, robots)| {
        robots.iter().map(move |robot| format!("robot {robot} waits at task {task}"))
    });
    let mut stuck: Vec<String> = stuck.collect();
    if stuck.is_empty() {
        return Ok(());
    }
    stuck.truncate(MOST_NAMED);
    Err(Error::Deadlock(stuck.join(", ")))
}
