//! Threads for jobs of microseconds. The caller works, too; the others join as soon as they notice, and
//! a job never waits for one that has not begun. Between jobs they watch for the next for a moment, then
//! sleep. After a fork the child has none of them, and the caller does everything by itself.

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

/// How long a thread watches for the next job before it sleeps: longer than a caller takes between the
/// steps of a tight loop, too short to be felt by anyone else.
const WATCHING: Duration = Duration::from_micros(100);
/// Looks between two looks at the clock.
const LOOKS: u32 = 64;

/// Called by each thread with its number; the caller is 0.
type Job = *const (dyn Fn(usize) + Sync);

/// On a cache line of its own, so that threads do not wait for each other's.
#[repr(align(128))]
struct Counter(AtomicUsize);

struct Shared {
    /// Odd while a job is open, and another number for each.
    ticket: AtomicUsize,
    /// The open job.
    job: UnsafeCell<Option<Job>>,
    /// Threads at work on it.
    inside: AtomicUsize,
    panicked: AtomicBool,
    ended: AtomicBool,
}

// SAFETY: `job` is written by the one caller, who holds `&mut Pool`, only while no ticket is open and
// nobody is inside; it is read only by those inside, and points to a closure that threads may share.
unsafe impl Sync for Shared {}
// SAFETY: as above; the pointer is followed only while the caller keeps the closure alive.
unsafe impl Send for Shared {}

struct Worker {
    thread: Thread,
    asleep: Arc<AtomicBool>,
}

/// Some threads that wait for jobs.
pub struct Pool {
    shared: Arc<Shared>,
    workers: Vec<Worker>,
    /// For each thread, the next of its own items.
    next: Vec<Counter>,
}

impl Pool {
    /// A pool in which `threads` work on a job, the caller included.
    ///
    /// # Errors
    /// What the system says if it gives no thread.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            ticket: AtomicUsize::new(0),
            job: UnsafeCell::new(None),
            inside: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let next = (0..threads).map(|_| Counter(AtomicUsize::new(0))).collect();
        let mut pool = Self { shared, workers: Vec::with_capacity(threads), next };
        for index in 1..threads {
            let (shared, asleep) = (Arc::clone(&pool.shared), Arc::new(AtomicBool::new(false)));
            let flag = Arc::clone(&asleep);
            let builder = thread::Builder::new().name(format!("worlds-{index}"));
            let handle = builder.spawn(move || shared.serve(index, &flag))?;
            pool.workers.push(Worker { thread: handle.thread().clone(), asleep });
        }
        Ok(pool)
    }

    /// Threads that work on a job, the caller included.
    #[must_use]
    pub fn num_threads(&self) -> usize {
        self.workers.len() + 1
    }

    /// Calls `item` once for each of `0..count` and returns when all are done. Each thread has its own
    /// part of them, the same in every job of that size, so that what an item touches stays in the
    /// cache of one core; whoever is done with his own helps the others.
    ///
    /// # Panics
    /// If an item panics.
    pub fn for_each(&mut self, count: usize, item: impl Fn(usize) + Sync) {
        let threads = self.num_threads();
        if threads == 1 {
            return (0..count).for_each(item);
        }
        let start = |thread: usize| thread * count / threads;
        for (thread, next) in self.next.iter().enumerate() {
            next.0.store(start(thread), SeqCst);
        }
        let next = &self.next;
        let job = |own: usize| {
            for thread in (own..threads).chain(0..own) {
                loop {
                    let index = next[thread].0.fetch_add(1, SeqCst);
                    if index >= start(thread + 1) {
                        break;
                    }
                    item(index);
                }
            }
        };
        self.open(&job);
        let closing = Closing(&self.shared);
        job(0);
        drop(closing);
        assert!(!self.shared.panicked.load(SeqCst), "a thread of the worlds panicked");
    }

    fn open(&self, job: &(dyn Fn(usize) + Sync)) {
        // SAFETY: only the lifetime is dropped; `Closing` ends every use of the job before it ends.
        let job: Job = unsafe { std::mem::transmute(job) };
        // SAFETY: no ticket is open and nobody is inside, so nobody else looks at `job`.
        unsafe { *self.shared.job.get() = Some(job) };
        self.shared.panicked.store(false, SeqCst);
        self.shared.ticket.fetch_add(1, SeqCst);
        for worker in self.workers.iter().filter(|worker| worker.asleep.load(SeqCst)) {
            worker.thread.unpark();
        }
    }
}

impl Drop for Pool {
    /// Sends the threads away without waiting: in a forked child there are none to wait for.
    fn drop(&mut self) {
        self.shared.ended.store(true, SeqCst);
        self.workers.iter().for_each(|worker| worker.thread.unpark());
    }
}

/// Closes the ticket when it is dropped, by a panic, too, and waits for those inside.
struct Closing<'a>(&'a Shared);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.ticket.fetch_add(1, SeqCst);
        let mut looks = 0;
        while self.0.inside.load(SeqCst) != 0 {
            looks += 1;
            if looks % LOOKS == 0 { thread::yield_now() } else { std::hint::spin_loop() }
        }
    }
}

impl Shared {
    /// A thread's life: waits for tickets and joins in.
    fn serve(&self, index: usize, asleep: &AtomicBool) {
        let mut last = 0;
        while let Some(ticket) = self.wait(last, asleep) {
            last = ticket;
            // Whoever comes in and then still finds the ticket open is waited for by `Closing`.
            self.inside.fetch_add(1, SeqCst);
            if self.ticket.load(SeqCst) == ticket {
                // SAFETY: the ticket is open, so `job` is set and its closure alive until we are out.
                let job = unsafe { (*self.job.get()).map(|job| &*job) };
                if job.is_some_and(|job| catch_unwind(AssertUnwindSafe(|| job(index))).is_err()) {
                    self.panicked.store(true, SeqCst);
                }
            }
            self.inside.fetch_sub(1, SeqCst);
        }
    }

    /// Waits for an open ticket after `last`; none once the pool has ended.
    fn wait(&self, last: usize, asleep: &AtomicBool) -> Option<usize> {
        let news = || Some(self.ticket.load(SeqCst)).filter(|ticket| ticket % 2 == 1 && *ticket != last);
        let (mut since, mut looks) = (Instant::now(), 0_u32);
        loop {
            if self.ended.load(SeqCst) {
                return None;
            }
            if let Some(ticket) = news() {
                return Some(ticket);
            }
            std::hint::spin_loop();
            looks = (looks + 1) % LOOKS;
            if looks == 0 && since.elapsed() > WATCHING {
                // Announced before the last look, so that whoever opens a ticket after it wakes us.
                asleep.store(true, SeqCst);
                if news().is_none() && !self.ended.load(SeqCst) {
                    thread::park();
                }
                asleep.store(false, SeqCst);
                since = Instant::now();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_done_once_whatever_the_threads_and_the_pauses() {
        for threads in [1, 2, 3, 8] {
            let mut pool = Pool::new(threads).expect("threads");
            assert_eq!(pool.num_threads(), threads);
            for round in 0..300_u64 {
                let counts: Vec<AtomicUsize> =
                    (0..round as usize % 40).map(|_| AtomicUsize::new(0)).collect();
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
}
