//! The pool under loom: every order of events with at most so many preemptions, and every value that the
//! memory model lets a thread read. Run by `make test-pool`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::Relaxed;

use loom::cell::UnsafeCell;
use loom::model::Builder;
use loom::sync::atomic::{AtomicBool, AtomicUsize};
use loom::thread;

use super::Pool;

/// Something that only one thread may touch at a time: loom reports two that do not take turns.
struct Cells(Vec<UnsafeCell<usize>>);

// SAFETY: none; whether threads take turns is what loom finds out.
unsafe impl Sync for Cells {}

impl Cells {
    fn new(count: usize) -> Self {
        Self((0..count).map(|_| UnsafeCell::new(0)).collect())
    }

    fn add(&self, index: usize) {
        // SAFETY: as above.
        self.0[index].with_mut(|cell| unsafe { *cell += 1 });
    }

    fn values(&self) -> Vec<usize> {
        // SAFETY: as above.
        self.0.iter().map(|cell| cell.with(|cell| unsafe { *cell })).collect()
    }
}

fn model(preemptions: usize, test: impl Fn() + Sync + Send + 'static) {
    let mut builder = Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.check(test);
}

#[test]
fn jobs_are_handed_over_and_back() {
    model(3, || {
        let mut pool = Pool::new(2).expect("threads");
        let cells = Cells::new(3);
        for round in 1..=2 {
            pool.for_each(3, |index| cells.add(index));
            assert_eq!(cells.values(), [round; 3]);
        }
    });
}

#[test]
fn three_threads_share_a_job() {
    model(2, || {
        let mut pool = Pool::new(3).expect("threads");
        let cells = Cells::new(3);
        pool.for_each(3, |index| cells.add(index));
        assert_eq!(cells.values(), [1; 3]);
    });
}

#[test]
fn a_thread_that_sleeps_or_is_about_to_is_woken() {
    model(3, || {
        let mut pool = Pool::new(2).expect("threads");
        for _ in 0..2 {
            let (first, second) = (AtomicBool::new(false), AtomicBool::new(false));
            // Each item waits for the other: one thread alone would wait for ever.
            pool.for_each(2, |index| {
                let (mine, other) = if index == 0 { (&first, &second) } else { (&second, &first) };
                mine.store(true, Relaxed);
                while !other.load(Relaxed) {
                    thread::yield_now();
                }
            });
        }
    });
}

#[test]
fn a_panic_reaches_the_caller_and_the_pool_goes_on() {
    for bad in 0..2 {
        model(3, move || {
            let mut pool = Pool::new(2).expect("threads");
            let cells = Cells::new(2);
            let panicked = catch_unwind(AssertUnwindSafe(|| {
                pool.for_each(2, |index| {
                    cells.add(index);
                    // Without a message: the hook would print one for every order of events.
                    if index == bad {
                        std::panic::resume_unwind(Box::new("as the test wants it"));
                    }
                });
            }));
            assert!(panicked.is_err());
            assert_eq!(cells.values()[bad], 1);
            let done = AtomicUsize::new(0);
            pool.for_each(2, |_| {
                done.fetch_add(1, Relaxed);
            });
            assert_eq!(done.load(Relaxed), 2);
        });
    }
}

/// Loom reports a thread that is still asleep when all others are done.
#[test]
fn every_thread_ends_with_its_pool() {
    model(5, || drop(Pool::new(3).expect("threads")));
    model(3, || {
        let mut pool = Pool::new(2).expect("threads");
        pool.for_each(1, |_| ());
    });
}
