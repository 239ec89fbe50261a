//! The pool with real threads.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::SeqCst;
use std::thread;
use std::time::Duration;

use super::Pool;

#[test]
fn every_item_is_done_once_whatever_the_threads_and_the_pauses() {
    for threads in [1, 2, 3, 8] {
        let mut pool = Pool::new(threads).expect("threads");
        assert_eq!(pool.num_threads(), threads);
        for round in 0..300_u64 {
            let counts: Vec<AtomicUsize> = (0..round as usize % 40).map(|_| AtomicUsize::new(0)).collect();
            pool.for_each(counts.len(), |index| {
                counts[index].fetch_add(1, SeqCst);
            });
            assert!(counts.iter().all(|count| count.load(SeqCst) == 1));
            if round % 50 == 0 {
                thread::sleep(Duration::from_millis(1)); // the threads fall asleep
            }
        }
    }
}

#[test]
fn others_join_in() {
    let mut pool = Pool::new(2).expect("threads");
    let callers = std::sync::Mutex::new(std::collections::HashSet::new());
    for _ in 0..200 {
        pool.for_each(8, |_| {
            callers.lock().expect("no panic").insert(thread::current().id());
            thread::sleep(Duration::from_micros(50));
        });
    }
    assert_eq!(callers.into_inner().expect("no panic").len(), 2);
}

#[test]
fn a_panic_reaches_the_caller_and_the_pool_goes_on() {
    let mut pool = Pool::new(3).expect("threads");
    for bad in 0..20 {
        let result = catch_unwind(AssertUnwindSafe(|| {
            pool.for_each(20, |index| {
                thread::sleep(Duration::from_micros(20));
                assert!(index != bad, "as the test wants it");
            });
        }));
        assert!(result.is_err());
    }
    let done = AtomicUsize::new(0);
    pool.for_each(20, |_| {
        done.fetch_add(1, SeqCst);
    });
    assert_eq!(done.load(SeqCst), 20);
}
