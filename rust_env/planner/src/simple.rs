//! Plain schedules to compare others with.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::coalition::first_of;
use crate::instance::Instance;
use crate::order::{Trace, add};
use crate::schedule::Schedule;

/// The order in which always that task comes next which can begin soonest; the first of equals.
#[must_use]
pub fn greedy_order(instance: &Instance) -> Vec<usize> {
    let mut trace = Trace::new(instance);
    let mut left: Vec<usize> = (0..instance.tasks.len()).collect();
    let mut order = vec![];
    while !left.is_empty() {
        let mut best = (0, f64::INFINITY, 0);
        for (index, task) in left.iter().enumerate() {
            let (start, mask) = trace.coalition(instance, order.len(), *task);
            if start < best.1 {
                best = (index, start, mask);
            }
        }
        let (index, start, mask) = best;
        let task = left.remove(index);
        trace.send(instance, order.len(), task, start, mask);
        order.push(task);
    }
    order
}

/// Tasks in a random order, each with a random coalition.
#[must_use]
pub fn random_schedule(instance: &Instance, seed: u64) -> Schedule {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let skills: Vec<u32> = instance.robots.iter().map(|robot| robot.skills).collect();
    let mut schedule = vec![vec![]; instance.robots.len()];
    for task in shuffled(instance.tasks.len(), &mut random) {
        let robots = shuffled(instance.robots.len(), &mut random);
        add(&mut schedule, first_of(&instance.tasks[task].needs, &skills, &robots), task);
    }
    schedule
}

/// The numbers below `count` in a random order (Fisher & Yates).
fn shuffled(count: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        numbers.swap(last, below(random, last + 1));
    }
    numbers
}

/// Uniform integer in `0..n`, `n` at least 1 (bias below n/2³²).
pub(crate) fn below(random: &mut ChaCha8Rng, n: usize) -> usize {
    ((u64::from(random.next_u32()) * n as u64) >> 32) as usize
}
