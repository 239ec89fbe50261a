//! A world is small, and a step asks the system for next to no memory; what rapier asks for is told.
//! One test alone: another beside it would be counted, too.

#[path = "worlds/common.rs"]
mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use common::{Table, chance, options, random_drive};
use innerattn_env::batch::Batch;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Engine, Scenario};

/// The system's allocator, counting.
struct Counting;

static COUNT: AtomicUsize = AtomicUsize::new(0);
static BYTES: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Relaxed);
        BYTES.fetch_add(layout.size(), Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        BYTES.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of an env-step of 256 worlds over two episodes, new episodes included.
fn per_env_step(engine: Engine) -> f64 {
    const ENVS: usize = 256;
    let mut table = Table::new(Scenario { engine, ..Scenario::default() }, options(ENVS, 3));
    let mut chance = chance(8);
    let actions: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
    (0..25).for_each(|_| table.step(&actions));
    let before = COUNT.load(Relaxed);
    (0..50).for_each(|_| table.step(&actions));
    (COUNT.load(Relaxed) - before) as f64 / (50 * ENVS) as f64
}

/// Bytes that a batch holds for each world.
fn bytes_a_world(engine: Engine) -> usize {
    const ENVS: usize = 4096;
    let before = BYTES.load(Relaxed);
    let rules = Rules::new(Scenario { engine, ..Scenario::default() }).expect("a valid scenario");
    let batch = Batch::new(rules, options(ENVS, 0)).expect("a batch");
    let bytes = (BYTES.load(Relaxed) - before) / ENVS;
    drop(batch);
    bytes
}

#[test]
fn worlds_are_small_and_steps_allocate_next_to_nothing() {
    let [rapier, discs] = [Engine::Rapier, Engine::Discs].map(per_env_step);
    println!("allocations of an env-step: {rapier:.2} with rapier, {discs:.2} with discs");
    assert!(discs < 0.5, "{discs}");
    let [rapier, discs] = [Engine::Rapier, Engine::Discs].map(bytes_a_world);
    println!("bytes of a world: {rapier} with rapier, {discs} with discs");
    assert!(rapier < 1024 && discs < 1024);
}
