//! From an order of the tasks to a schedule. Tasks are given out in this order; each gets the coalition that
//! can begin soonest, and of the robots that come in time those that come last, so that the others stay
//! free. The way to their depots counts against them.
//!
//! Such a schedule never ends in a deadlock: robots meet tasks in one common order.

use crate::coalition::Offers;
use crate::instance::{Instance, MAX_ROBOTS};
use crate::schedule::Schedule;

/// What the way home weighs beside the time of arrival. It is more than 1, so that of robots that are at
/// their depots the nearest goes.
const WAY_HOME: f64 = 1.01;

/// How robots stand after some tasks of an order, for each number of tasks: rows, one after the other.
pub struct Trace {
    free: Vec<f64>,
    places: Vec<u32>,
    makespans: Vec<f64>,
    offers: Offers,
}

impl Trace {
    /// Before the first task all robots are at their depots; the other rows are not known yet.
    #[must_use]
    pub fn new(instance: &Instance) -> Self {
        let (robots, rows) = (instance.robots.len(), instance.tasks.len() + 1);
        let mut places = vec![0; rows * robots];
        for (robot, place) in places[..robots].iter_mut().enumerate() {
            *place = robot as u32;
        }
        let offers = Offers { arrivals: [0.0; MAX_ROBOTS], ranks: [0.0; MAX_ROBOTS] };
        Self { free: vec![0.0; rows * robots], places, makespans: vec![0.0; rows], offers }
    }

    /// Makespan of the first `done` tasks.
    #[must_use]
    pub fn makespan(&self, done: usize) -> f64 {
        self.makespans[done]
    }

    /// When each robot is free after `done` tasks, and its place then.
    pub(crate) fn stands(&self, instance: &Instance, done: usize) -> Vec<(f64, usize)> {
        let rows = done * instance.robots.len()..(done + 1) * instance.robots.len();
        self.free[rows.clone()]
            .iter()
            .zip(&self.places[rows])
            .map(|(free, at)| (*free, *at as usize))
            .collect()
    }

    /// Gives out `task` after `done` others. Returns its coalition, as a mask, and when it begins.
    pub fn give_out(&mut self, instance: &Instance, done: usize, task: usize) -> (u64, f64) {
        let (start, mask) = self.coalition(instance, done, task);
        self.send(instance, done, task, start, mask);
        (mask, start)
    }

    /// The coalition that `task` would get after `done` others: when it begins, and its mask.
    pub fn coalition(&mut self, instance: &Instance, done: usize, task: usize) -> (f64, u64) {
        let rows = done * instance.robots.len()..(done + 1) * instance.robots.len();
        let (free, places) = (&self.free[rows.clone()], &self.places[rows]);
        let travel = instance.travel_to(task);
        let offers = self.offers.arrivals.iter_mut().zip(&mut self.offers.ranks);
        for (robot, (arrival, rank)) in instance.candidates[task].robots().iter().zip(offers) {
            let robot = usize::from(*robot);
            *arrival = free[robot] + travel[places[robot] as usize];
            *rank = *arrival - WAY_HOME * travel[robot];
        }
        instance.candidates[task].soonest(&self.offers)
    }

    /// Lets the robots of a mask work on `task` from `start` on, after `done` others.
    pub fn send(&mut self, instance: &Instance, done: usize, task: usize, start: f64, mask: u64) {
        let robots = instance.robots.len();
        let row = done * robots;
        self.free.copy_within(row..row + robots, row + robots);
        self.places.copy_within(row..row + robots, row + robots);
        let end = start + instance.tasks[task].duration;
        let mut makespan = self.makespans[done];
        let mut left = mask;
        while left != 0 {
            let robot = left.trailing_zeros() as usize;
            left &= left - 1;
            self.free[row + robots + robot] = end;
            self.places[row + robots + robot] = instance.place_of(task) as u32;
            makespan = makespan.max(end + instance.travel(robot, task));
        }
        self.makespans[done + 1] = makespan;
    }

    /// Copies the row after the first `done` tasks from another trace.
    pub fn start_at(&mut self, other: &Self, robots: usize, done: usize) {
        let row = done * robots..(done + 1) * robots;
        self.free[row.clone()].copy_from_slice(&other.free[row.clone()]);
        self.places[row.clone()].copy_from_slice(&other.places[row]);
        self.makespans[done] = other.makespans[done];
    }

    /// Copies the rows after the first `from` tasks from another trace.
    pub fn follow(&mut self, other: &Self, robots: usize, from: usize) {
        let rows = from * robots..;
        self.free[rows.clone()].copy_from_slice(&other.free[rows.clone()]);
        self.places[rows.clone()].copy_from_slice(&other.places[rows]);
        self.makespans[from..].copy_from_slice(&other.makespans[from..]);
    }
}

/// The schedule of an order of all tasks.
#[must_use]
pub fn schedule_of(instance: &Instance, order: &[usize]) -> Schedule {
    let mut trace = Trace::new(instance);
    let mut schedule = vec![vec![]; instance.robots.len()];
    for (done, task) in order.iter().enumerate() {
        let (mask, _) = trace.give_out(instance, done, *task);
        add(&mut schedule, mask, *task);
    }
    schedule
}

/// Sends the robots of a mask to a task after all others.
pub fn add(schedule: &mut Schedule, mask: u64, task: usize) {
    for (robot, tasks) in schedule.iter_mut().enumerate() {
        if mask >> robot & 1 == 1 {
            tasks.push(task);
        }
    }
}
