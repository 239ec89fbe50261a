//! Arrivals: how many victims come in a control step, whatever becomes of those that are there.

use std::iter::repeat_n;

use super::steps_of;
use crate::geometry::Vec2;
use crate::rng::{Purpose, Stream};
use crate::scenario::{Arrival, Scenario, Situation};

/// Words of the stream for each task and step.
const WORDS: u64 = 2;

/// A victim that arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Due {
    /// Index of its task.
    pub task: usize,
    /// Where it is, m; a random place if absent.
    pub place: Option<Vec2>,
}

/// The arrivals of a scenario.
#[derive(Debug, Clone)]
pub struct Arrivals {
    /// By task, how many arrive at random in a control step on average; none from a list.
    expected: Vec<f64>,
    /// Those of a list in order of time, with the steps done when they arrive.
    listed: Vec<(u32, Due)>,
}

impl Arrivals {
    /// The arrivals of a valid scenario; `None` where victims come when others are gone.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let expected = scenario.tasks.iter().map(|task| task.arrival_rate_hz * scenario.dt_s).collect();
        match scenario.situation {
            Situation::Poisson => Some(Self { expected, listed: vec![] }),
            Situation::Listed => Some(Self { expected: vec![], listed: listed(scenario) }),
            Situation::Single | Situation::Double | Situation::Mixed => None,
        }
    }

    /// The victims that arrive with the last of `step` steps of an episode. The stream of arrivals has two
    /// words for each step and task, so this is the same whenever it is asked for.
    pub fn due(&self, step: u32, seed: u64, world: u64, episode: u64) -> impl Iterator<Item = Due> {
        let words = WORDS * u64::from(step) * self.expected.len() as u64;
        let mut stream = Stream::new(seed, world, episode, Purpose::Arrivals).resume(words);
        let random = self.expected.iter().enumerate().filter(move |_| step > 0); // no time has passed
        let random = random.flat_map(move |(task, expected)| {
            repeat_n(Due { task, place: None }, poisson(*expected, stream.fine_unit()))
        });
        let earlier = self.listed.partition_point(|(then, _)| *then < step);
        let listed = self.listed[earlier..].iter().take_while(move |(then, _)| *then == step);
        random.chain(listed.map(|(_, due)| *due))
    }

    /// Whether all of a list have arrived with the last of `step` steps of an episode.
    #[must_use]
    pub fn all_came(&self, step: u32) -> bool {
        self.listed.last().is_none_or(|(then, _)| *then <= step)
    }
}

/// The arrivals of a scenario's list, in order of time.
fn listed(scenario: &Scenario) -> Vec<(u32, Due)> {
    let number = |name: &str| scenario.tasks.iter().position(|task| task.name == name).unwrap_or_default();
    let reach = (scenario.arena_half_width_m - scenario.wall_clearance_m) as f32;
    let of = |arrival: &Arrival| {
        let place = arrival.position_m.map(|value| (value as f32).clamp(-reach, reach));
        let due = Due { task: number(&arrival.task), place: Some(place.into()) };
        (steps_of(arrival.at_s, scenario.dt_s), due)
    };
    let mut listed: Vec<(u32, Due)> = scenario.arrivals.iter().map(of).collect();
    listed.sort_by_key(|(step, _)| *step); // those of one step keep their order
    listed
}

/// The number of which a `share` of all draws are no larger, from a Poisson distribution.
fn poisson(expected: f64, share: f64) -> usize {
    let (mut count, mut chance) = (0, (-expected).exp());
    let mut together = chance;
    while share >= together && chance > 0.0 {
        count += 1;
        chance *= expected / count as f64;
        together += chance;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrivals(rates: [f64; 2]) -> Arrivals {
        let mut scenario = Scenario { situation: Situation::Poisson, ..Scenario::default() };
        for (task, rate) in scenario.tasks.iter_mut().zip(rates) {
            task.arrival_rate_hz = rate;
        }
        Arrivals::new(&scenario).expect("arrivals")
    }

    #[test]
    fn counts_are_the_quantiles_of_their_distribution() {
        assert_eq!(poisson(0.0, 1.0 - f64::EPSILON), 0);
        let e = (-1.0_f64).exp();
        for (share, count) in
            [(0.0, 0), (e - 1e-9, 0), (e + 1e-9, 1), (2.0 * e + 1e-9, 2), (2.5 * e + 1e-9, 3)]
        {
            assert_eq!(poisson(1.0, share), count, "{share}");
        }
        assert!((95..=105).contains(&poisson(100.0, 0.5)));
        assert!(poisson(100.0, 1.0 - f64::EPSILON) < 600, "it ends where sums are short of 1");
    }

    /// Mean and variance of a Poisson distribution are alike, and tasks and steps know nothing of each other.
    #[test]
    fn arrivals_are_poisson_at_the_rate_of_each_task() {
        let arrivals = arrivals([4.0, 0.5]);
        let counts = |task: usize| -> Vec<f64> {
            let in_step = |step| arrivals.due(step, 1, 2, 3).filter(|one| one.task == task).count() as f64;
            (1..=40_000).map(in_step).collect()
        };
        let both = [counts(0), counts(1)];
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let product = |a: &[f64], b: &[f64]| mean(&a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>());
        for (counts, expected) in both.iter().zip([0.4, 0.05]) {
            let error = 4.0 * (expected / 4e4_f64).sqrt();
            assert!((mean(counts) - expected).abs() < error, "{}", mean(counts));
            let variance = product(counts, counts) - mean(counts).powi(2);
            assert!((variance - expected).abs() < 3.0 * error, "{variance}");
            let later = product(&counts[1..], &counts[..counts.len() - 1]) - mean(counts).powi(2);
            assert!(later.abs() < 4.0 * expected / 200.0, "{later}");
        }
        let together = product(&both[0], &both[1]) - mean(&both[0]) * mean(&both[1]);
        assert!(together.abs() < 4.0 * (0.4 * 0.05_f64).sqrt() / 200.0, "{together}");
    }

    #[test]
    fn nothing_arrives_at_the_start_or_without_a_rate() {
        assert!(Arrivals::new(&Scenario::default()).is_none());
        assert_eq!(arrivals([100.0, 100.0]).due(0, 1, 2, 3).count(), 0);
        assert_eq!((1..999).map(|step| arrivals([0.0, 0.0]).due(step, 1, 2, 3).count()).sum::<usize>(), 0);
        let (busy, one) = (arrivals([9.0, 2.0]), arrivals([0.0, 2.0]));
        for step in 1..999 {
            let second = |of: &Arrivals| of.due(step, 1, 2, 3).filter(|one| one.task == 1).count();
            assert_eq!(second(&busy), second(&one), "another task moves it");
        }
    }

    #[test]
    fn a_list_is_due_at_its_times_in_order() {
        let mut scenario = Scenario { situation: Situation::Listed, ..Scenario::default() };
        let arrival = |at_s, task: &str, x| Arrival { at_s, task: task.into(), position_m: [x, 0.5] };
        scenario.arrivals = vec![
            arrival(0.31, "task_2", 0.1),
            arrival(0.0, "task_2", 0.2),
            arrival(0.3, "task_1", 0.3),
            arrival(0.4, "task_1", 0.4),
        ];
        let arrivals = Arrivals::new(&scenario).expect("arrivals");
        let due = |step| -> Vec<(usize, f32)> {
            let found = arrivals.due(step, 1, 2, 3);
            found.map(|due| (due.task, due.place.expect("its place").x)).collect()
        };
        let all: Vec<_> = (0..9).map(due).collect();
        let empty = vec![];
        assert_eq!(all[0], [(1, 0.2)]);
        assert_eq!(all[3], [(0, 0.3)]);
        assert_eq!(all[4], [(1, 0.1), (0, 0.4)], "the first step that reaches the time, in the list's order");
        assert!((0..9).all(|step| arrivals.all_came(step) == (step >= 4)));
        assert!([1, 2, 5, 6, 7, 8].iter().all(|step| all[*step] == empty));
    }
}
