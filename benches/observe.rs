//! Observations written per second, by size of the team, in pure Rust on one thread.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use innerattn_benches::batch;
use innerattn_env::scenario::{Robot, Scenario};

fn observe(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("observe");
    for robots in [4, 16, 64] {
        let scenario = Scenario { robots: team(robots), spawn_clearance_m: 0.05, ..Scenario::default() };
        let batch = batch(scenario, 256, 1);
        let mut obs = vec![0.0; 256 * robots * batch.rules().layout.width()];
        group.throughput(Throughput::Elements(256));
        group.bench_function(BenchmarkId::new("robots", robots), |bencher| {
            bencher.iter(|| batch.observe(&mut obs));
        });
    }
    group.finish();
}

/// The default team, repeated until it counts `robots`.
fn team(robots: usize) -> Vec<Robot> {
    let named = |(index, robot): (usize, &Robot)| Robot { name: format!("robot_{index}"), ..robot.clone() };
    Scenario::default().robots.iter().cycle().take(robots).enumerate().map(named).collect()
}

criterion_group!(benches, observe);
criterion_main!(benches);
