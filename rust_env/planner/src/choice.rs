//! Orders under way, and what is known of each task that could come next: what a learnt policy chooses by.
//!
//! Nothing depends on the number or the name of a robot, a task or a skill. Times are in the instance's own
//! unit, see [`unit_of`], so that a policy does not depend on the units of a file either.

use crate::instance::{Instance, MAX_SKILLS};
use crate::order::Trace;

/// Numbers that are known of a task; see [`Unfinished::features`].
pub const FEATURES: usize = 18;

/// A time that is typical of an instance: the mean duration, and the mean way from anywhere to a task.
#[must_use]
pub fn unit_of(instance: &Instance) -> f64 {
    let tasks = 0..instance.tasks.len();
    let duration = mean(tasks.clone().map(|task| instance.tasks[task].duration));
    let way = mean(tasks.map(|task| mean(instance.travel_to(task).iter().copied())));
    if duration + way > 0.0 { duration + way } else { 1.0 }
}

/// An order of the tasks of an instance, as far as it goes.
pub struct Unfinished {
    trace: Trace,
    order: Vec<usize>,
    /// The tasks that are not in it, by number.
    open: Vec<usize>,
    unit: f64,
    /// For each skill, how many robots have it.
    able: [f64; MAX_SKILLS],
}

impl Unfinished {
    /// An order without any task yet.
    #[must_use]
    pub fn new(instance: &Instance) -> Self {
        let has = |skill: usize| instance.robots.iter().filter(move |robot| robot.skills >> skill & 1 == 1);
        Self {
            trace: Trace::new(instance),
            order: vec![],
            open: (0..instance.tasks.len()).collect(),
            unit: unit_of(instance),
            able: std::array::from_fn(|skill| has(skill).count() as f64),
        }
    }

    /// The tasks so far.
    #[must_use]
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// The tasks that could come next, by number.
    #[must_use]
    pub fn open(&self) -> &[usize] {
        &self.open
    }

    /// When the last robot would be back if nothing came any more.
    #[must_use]
    pub fn makespan(&self) -> f64 {
        self.trace.makespan(self.order.len())
    }

    /// Puts an open task at the end. Whether it was open.
    pub fn take(&mut self, instance: &Instance, task: usize) -> bool {
        let Ok(index) = self.open.binary_search(&task) else { return false };
        self.open.remove(index);
        self.trace.give_out(instance, self.order.len(), task);
        self.order.push(task);
        true
    }

    /// Writes what is known of each task into its row; rows of tasks that are not open are 0.
    ///
    /// For the coalition that the task would get now: when it begins, after the first that can and after
    /// now; how long it works, how many it needs, its ways there, its waiting, the ways home (most and mean),
    /// and how much longer the makespan would be. For the task: the way to the nearest open one and the mean
    /// way; the work that waits for the scarcest of its skills, the mean over them, and when it could be done.
    /// For all: how many tasks are done, how far the robots are apart in time, the work that waits, the
    /// makespan so far.
    pub fn features(&mut self, instance: &Instance, rows: &mut [f32]) {
        rows.fill(0.0);
        let done = self.order.len();
        let stands = self.trace.stands(instance, done);
        let now = mean(stands.iter().map(|(free, _)| *free));
        let first_free = stands.iter().fold(f64::INFINITY, |least, (free, _)| least.min(*free));
        let (work, ready) = self.waiting_work(instance, &stands);
        let all_work = mean(work.iter().copied().filter(|work| *work > 0.0));
        let makespan = self.makespan();
        let share = done as f64 / instance.tasks.len() as f64;
        let found: Vec<(f64, u64)> =
            self.open.iter().map(|task| self.trace.coalition(instance, done, *task)).collect();
        let soonest = found.iter().fold(f64::INFINITY, |least, (start, _)| least.min(*start));
        let most_needs = instance.tasks.iter().map(|task| task.needs.len()).max().unwrap_or(1) as f64;
        for (task, (start, mask)) in self.open.iter().zip(&found) {
            let it = &instance.tasks[*task];
            let ways = instance.travel_to(*task);
            let robots = || (0..stands.len()).filter(|robot| mask >> robot & 1 == 1);
            let way = mean(robots().map(|robot| ways[stands[robot].1]));
            let home = robots().map(|robot| ways[robot]);
            let most_home = home.clone().fold(0.0, f64::max);
            let others = || self.open.iter().filter(|other| *other != task);
            let near = others().map(|other| ways[instance.place_of(*other)]);
            let nearest = near.clone().fold(f64::INFINITY, f64::min);
            let needs = || it.needs.iter().map(|need| usize::from(*need));
            let scarcest = needs().map(|skill| work[skill]).fold(0.0, f64::max);
            let last = needs().map(|skill| ready[skill] + work[skill]).fold(0.0, f64::max);
            let end = start + it.duration;
            let times = [
                start - soonest,
                start - now,
                it.duration,
                way,
                mean(robots().map(|robot| start - stands[robot].0 - ways[stands[robot].1])),
                most_home,
                mean(home),
                end + most_home - makespan,
                if nearest.is_finite() { nearest } else { 0.0 },
                mean(near),
                scarcest,
                mean(needs().map(|skill| work[skill])),
                last - now,
                now - first_free,
                all_work,
                makespan - now,
            ];
            let row = &mut rows[task * FEATURES..(task + 1) * FEATURES];
            for (to, time) in row.iter_mut().zip(times) {
                *to = (time / self.unit) as f32;
            }
            row[times.len()] = (it.needs.len() as f64 / most_needs) as f32;
            row[times.len() + 1] = share as f32;
        }
    }

    /// For each skill, the work of open tasks that waits for each robot that has it, and when these robots are
    /// free on average.
    fn waiting_work(
        &self,
        instance: &Instance,
        stands: &[(f64, usize)],
    ) -> ([f64; MAX_SKILLS], [f64; MAX_SKILLS]) {
        let mut work = [0.0; MAX_SKILLS];
        for task in &self.open {
            let it = &instance.tasks[*task];
            let way = mean(self.open.iter().map(|other| instance.travel(instance.place_of(*other), *task)));
            for need in &it.needs {
                work[usize::from(*need)] += (it.duration + way) / self.able[usize::from(*need)];
            }
        }
        let ready = std::array::from_fn(|skill| {
            let with = instance.robots.iter().zip(stands).filter(|(robot, _)| robot.skills >> skill & 1 == 1);
            mean(with.map(|(_, (free, _))| *free))
        });
        (work, ready)
    }
}

/// Of some numbers; 0 of none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}
