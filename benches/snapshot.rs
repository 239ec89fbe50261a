//! Snapshots taken and restored, by size of the batch, in pure Rust.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use innerattn_benches::batch;
use innerattn_env::scenario::Scenario;

fn snapshot(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("snapshot");
    for envs in [1, 32, 1024, 4096] {
        let mut batch = batch(Scenario::default(), envs, 1);
        let image = batch.snapshot();
        group.throughput(Throughput::Elements(envs as u64));
        group.bench_function(BenchmarkId::new("take", envs), |bencher| bencher.iter(|| batch.snapshot()));
        group.bench_function(BenchmarkId::new("restore", envs), |bencher| {
            bencher.iter(|| batch.restore(&image).expect("its own image"));
        });
    }
    group.finish();
}

criterion_group!(benches, snapshot);
criterion_main!(benches);
