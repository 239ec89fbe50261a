//! The planner: simulated annealing (Kirkpatrick, Gelatt & Vecchi 1983) over the order of the tasks.
//!
//! A move puts a task elsewhere in the order, or swaps two. Only the tasks from the first change on are
//! given out anew, and no further than it takes to see that the move will be refused.

use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::error::{Error, Result};
use crate::instance::Instance;
use crate::order::{Trace, schedule_of};
use crate::schedule::Schedule;
use crate::simple::below;

/// First and last temperature, in makespans of the order that the search begins with.
const TEMPERATURES: (f64, f64) = (0.008, 0.002);
/// Share of moves that put a task elsewhere; the others swap two.
const MOVED: f64 = 0.4;
/// Tasks that are given out, at most, between two looks at the clock.
const TASKS_PER_LOOK: usize = 8192;
/// Time between two polls of the caller.
const POLL_EVERY: Duration = Duration::from_millis(100);

/// When a search ends: at the first of the two. At least one must be there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Orders to try. With this limit alone, a search gives the same bits on every machine.
    pub evaluations: Option<u64>,
    /// Seconds.
    pub seconds: Option<f64>,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The best schedule.
    pub schedule: Schedule,
    /// Orders that were tried.
    pub evaluations: u64,
}

/// Looks for the schedule with the least makespan, beginning with an order of all tasks. Calls `poll` now and
/// then; true ends the search.
///
/// # Errors
/// [`Error::Limit`] without any limit or with one that is no limit, [`Error::Interrupted`] if the poll ended
/// it.
pub fn plan(
    instance: &Instance,
    order: Vec<usize>,
    seed: u64,
    limits: Limits,
    poll: &dyn Fn() -> bool,
) -> Result<Plan> {
    let mut clock = Clock::new(limits, poll)?;
    let mut search = Search::new(instance, order, seed);
    let per_look = (TASKS_PER_LOOK / instance.tasks.len()).max(1) as u64;
    while let Some(done) = clock.share_done(search.evaluations)? {
        let left = limits.evaluations.map_or(u64::MAX, |most| most - search.evaluations);
        search.go_on(done, per_look.min(left));
    }
    Ok(Plan { schedule: schedule_of(instance, &search.best.0), evaluations: search.evaluations })
}

/// How much of its limits a search has used.
struct Clock<'a> {
    limits: Limits,
    began: Instant,
    poll: &'a dyn Fn() -> bool,
    polled: Instant,
}

impl<'a> Clock<'a> {
    fn new(limits: Limits, poll: &'a dyn Fn() -> bool) -> Result<Self> {
        let refused = |name, value, rule| Err(Error::Limit { name, value, rule });
        if limits.evaluations.is_none() && limits.seconds.is_none() {
            return refused("seconds", "none".into(), "must be given where no number of evaluations is");
        }
        if let Some(seconds) = limits.seconds.filter(|seconds| !(0.0..=1e6).contains(seconds)) {
            return refused("seconds", format!("{seconds:?}"), "must be 0.0 to 1e6");
        }
        let now = Instant::now();
        Ok(Self { limits, began: now, poll, polled: now })
    }

    /// The share that is done; none at the end. It goes by evaluations if they are limited, so that the
    /// clock changes nothing but when the search ends.
    fn share_done(&mut self, evaluations: u64) -> Result<Option<f64>> {
        let now = Instant::now();
        if now - self.polled >= POLL_EVERY {
            self.polled = now;
            if (self.poll)() {
                return Err(Error::Interrupted);
            }
        }
        let tried = self.limits.evaluations.map(|most| evaluations as f64 / most as f64);
        let spent = self.limits.seconds.map(|most| (now - self.began).as_secs_f64() / most);
        // Of no time and no evaluation at all, 0 / 0, everything is spent.
        let is_over = |share: Option<f64>| share.is_some_and(|share| share >= 1.0 || share.is_nan());
        Ok(if is_over(tried) || is_over(spent) { None } else { tried.or(spent) })
    }
}

/// A search under way.
struct Search<'a> {
    instance: &'a Instance,
    random: ChaCha8Rng,
    order: Vec<usize>,
    trace: Trace,
    /// An order that is tried, and how far it got.
    tried: (Vec<usize>, Trace),
    /// The best order and its makespan.
    best: (Vec<usize>, f64),
    temperatures: (f64, f64),
    evaluations: u64,
}

impl<'a> Search<'a> {
    fn new(instance: &'a Instance, order: Vec<usize>, seed: u64) -> Self {
        let mut trace = Trace::new(instance);
        for (done, task) in order.iter().enumerate() {
            trace.give_out(instance, done, *task);
        }
        let makespan = trace.makespan(order.len());
        let mut tried = Trace::new(instance);
        tried.follow(&trace, instance.robots.len(), 0);
        Self {
            instance,
            random: ChaCha8Rng::seed_from_u64(seed),
            tried: (order.clone(), tried),
            best: (order.clone(), makespan),
            temperatures: (TEMPERATURES.0 * makespan, TEMPERATURES.1 * makespan),
            order,
            trace,
            evaluations: 0,
        }
    }

    /// Tries so many more orders; `done` is the share of the search that is over.
    fn go_on(&mut self, done: f64, evaluations: u64) {
        let (first, last) = self.temperatures;
        let temperature = if first > 0.0 { first * libm::pow(last / first, done) } else { 0.0 };
        for _ in 0..evaluations {
            self.try_one(temperature);
        }
        self.evaluations += evaluations;
    }

    fn try_one(&mut self, temperature: f64) {
        let tasks = self.order.len();
        let (from, to) = (below(&mut self.random, tasks), below(&mut self.random, tasks));
        let order = &mut self.tried.0;
        if unit(&mut self.random) >= MOVED {
            order.swap(from, to);
        } else if from < to {
            order[from..=to].rotate_left(1);
        } else {
            order[to..=from].rotate_right(1);
        }
        let (first, last) = (from.min(to), from.max(to));
        // The rule of Metropolis, its random number drawn first.
        let limit = self.trace.makespan(tasks) - temperature * libm::log(unit(&mut self.random));
        if self.is_within(limit, first) {
            let robots = self.instance.robots.len();
            self.order[first..=last].copy_from_slice(&self.tried.0[first..=last]);
            self.trace.follow(&self.tried.1, robots, first + 1);
            if self.trace.makespan(tasks) < self.best.1 {
                self.best = (self.order.clone(), self.trace.makespan(tasks));
            }
        } else {
            self.tried.0[first..=last].copy_from_slice(&self.order[first..=last]);
        }
    }

    /// Gives out the tried order from the first task that is another one. Whether its makespan is allowed.
    fn is_within(&mut self, limit: f64, first: usize) -> bool {
        let (order, trace) = &mut self.tried;
        trace.start_at(&self.trace, self.instance.robots.len(), first);
        for (done, task) in order.iter().enumerate().skip(first) {
            trace.give_out(self.instance, done, *task);
            if trace.makespan(done + 1) > limit {
                return false;
            }
        }
        true
    }
}

/// Uniform in `(0, 1)`, an odd multiple of 2⁻³³.
fn unit(random: &mut ChaCha8Rng) -> f64 {
    (f64::from(random.next_u32()) + 0.5) / 4_294_967_296.0
}
