//! The batches that the benchmarks time.

use innerattn_env::batch::{Autoreset, Batch, Options};
use innerattn_env::rules::Rules;
use innerattn_env::scenario::Scenario;

/// A batch of worlds under seed 0.
///
/// # Panics
/// If the scenario is not valid, or there are no such threads.
#[must_use]
pub fn batch(scenario: Scenario, num_envs: usize, num_threads: usize) -> Batch {
    let options = Options {
        num_envs,
        seed: 0,
        num_threads: Some(num_threads),
        first_env: 0,
        autoreset: Autoreset::SameStep,
    };
    let rules = Rules::new(scenario).expect("a valid scenario");
    Batch::new(rules, options).expect("a batch")
}
