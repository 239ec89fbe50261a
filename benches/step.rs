//! Env-steps per second of a batch in pure Rust: both engines, random actions, 25-step episodes.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use innerattn_benches::batch;
use innerattn_env::batch::StepBuffers;
use innerattn_env::reward::NUM_COMPONENTS;
use innerattn_env::rng::{Purpose, Stream};
use innerattn_env::robot::Commands;
use innerattn_env::scenario::{Engine, Scenario};

const ROUNDS: usize = 64;

fn random_actions(envs: usize, robots: usize) -> Vec<Vec<i64>> {
    let mut stream = Stream::new(7, 0, 0, Purpose::Start);
    (0..ROUNDS).map(|_| (0..envs * robots).map(|_| stream.below(5) as i64).collect()).collect()
}

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    for (threads, engine) in [1, 2].iter().flat_map(|t| [Engine::Rapier, Engine::Discs].map(|e| (*t, e))) {
        for (envs, substeps) in [(1, 6), (32, 6), (1024, 1), (1024, 2), (1024, 6), (4096, 6)] {
            if engine == Engine::Discs && substeps != 6 {
                continue; // it has none
            }
            let scenario = Scenario { engine, substeps, ..Scenario::default() };
            let mut batch = batch(scenario, envs, threads);
            let (robots, width) = (batch.rules().team.len(), batch.rules().layout.width());
            let actions = random_actions(envs, robots);
            let mut obs = vec![0.0; envs * robots * width];
            let mut final_obs = obs.clone();
            let mut reward = vec![0.0; envs * robots];
            let mut components = vec![0.0; envs * robots * NUM_COMPONENTS];
            let (mut terminated, mut truncated) = (vec![false; envs], vec![false; envs]);
            group.throughput(Throughput::Elements(envs as u64));
            let name = format!("{engine:?}, {threads} threads, {substeps} substeps");
            let mut round = 0;
            group.bench_function(BenchmarkId::new(name, envs), |bencher| {
                bencher.iter(|| {
                    let buffers = StepBuffers {
                        obs: &mut obs,
                        final_obs: &mut final_obs,
                        reward: &mut reward,
                        components: &mut components,
                        terminated: &mut terminated,
                        truncated: &mut truncated,
                    };
                    round += 1;
                    batch.step(Commands::Discrete(&actions[round % ROUNDS]), buffers).expect("valid actions")
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, step);
criterion_main!(benches);
