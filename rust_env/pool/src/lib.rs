//! Threads for jobs of microseconds. The caller works, too; the others join as soon as they notice, and
//! a job never waits for one that has not begun. Between jobs they watch for the next for a moment, then
//! sleep. A child process has none of them: a pool made before a fork is of no use there.
//!
//! All that threads tell each other goes through one number, [`Shared::state`], so that the order of its
//! changes is the order of events: each ordering below is argued from it. `--cfg loom` runs the tests
//! under every order that is possible.

mod sync;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use sync::{Arc, AtomicBool, AtomicUsize, Sleeper, UnsafeCell, Waker, Watch, pause, spawn};

/// Called by each thread with its number; the caller is 0.
type Job = *const (dyn Fn(usize) + Sync);

/// The state counts threads inside in ones and tickets in these; an odd ticket is open. Threads are far
/// fewer; should tickets wrap around, a thread may at worst sleep through a job, which does not wait for it.
const TICKET: usize = 1 << 16;

fn is_open(state: usize) -> bool {
    state & TICKET != 0
}

fn num_inside(state: usize) -> usize {
    state % TICKET
}

/// On a cache line of its own, so that threads do not wait for each other's.
#[repr(align(128))]
struct Counter(AtomicUsize);

struct Shared {
    /// Ticket and number of threads inside. A thread comes in by adding 1, and takes part if the ticket
    /// that it finds by this very addition is open; it leaves by subtracting 1. The caller opens and
    /// closes a ticket by adding [`TICKET`], and after closing waits until nobody is inside.
    state: AtomicUsize,
    /// The open job.
    job: UnsafeCell<Option<Job>>,
    panicked: AtomicBool,
    ended: AtomicBool,
}

// SAFETY: `job` points to a closure that threads may share. It is read by those who came in while a ticket
// was open, until they leave; it is written by the one caller, who holds `&mut Pool`, after the ticket was
// closed and everybody was seen to have left. Whoever comes in later finds no open ticket and does not look.
unsafe impl Sync for Shared {}
// SAFETY: as above; the pointer is followed only while the caller keeps the closure alive.
unsafe impl Send for Shared {}

/// Some threads that wait for jobs.
pub struct Pool {
    shared: Arc<Shared>,
    workers: Vec<Waker>,
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
            state: AtomicUsize::new(0),
            job: UnsafeCell::new(None),
            panicked: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let next = (0..threads).map(|_| Counter(AtomicUsize::new(0))).collect();
        let mut pool = Self { shared, workers: Vec::with_capacity(threads), next };
        for index in 1..threads {
            let shared = Arc::clone(&pool.shared);
            let worker = spawn(format!("worlds-{index}"), move |sleeper| shared.serve(index, &sleeper))?;
            pool.workers.push(worker);
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
            // Relaxed: what comes before the opening is seen by whoever comes in.
            next.0.store(start(thread), Relaxed);
        }
        let next = &self.next;
        let job = |own: usize| {
            for thread in (own..threads).chain(0..own) {
                loop {
                    // Relaxed: that every addition finds another number is all that matters.
                    let index = next[thread].0.fetch_add(1, Relaxed);
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
        // Relaxed: whoever set it has left since, which `Closing` has seen.
        assert!(!self.shared.panicked.load(Relaxed), "a thread of the worlds panicked");
    }

    fn open(&self, job: &(dyn Fn(usize) + Sync)) {
        // SAFETY: only the lifetime is dropped; `Closing` ends every use of the job before it ends.
        let job: Job = unsafe { std::mem::transmute(job) };
        // SAFETY: no ticket is open, and those who came in before have left: nobody else looks at `job`.
        self.shared.job.with_mut(|place| unsafe { *place = Some(job) });
        self.shared.panicked.store(false, Relaxed); // seen by whoever comes in, as the job is
        // Release: whoever comes in while the ticket is open (Acquire) sees the job and the counters. Those
        // who come and go in between only add and subtract, so they do not stand in the way of that.
        self.shared.state.fetch_add(TICKET, Release);
        // After it: a thread that missed the ticket and is about to sleep is kept awake by this, and one
        // that sleeps is woken; either then sees the ticket.
        self.workers.iter().for_each(Waker::wake);
    }
}

impl Drop for Pool {
    /// Sends the threads away without waiting: in a forked child there are none to wait for.
    fn drop(&mut self) {
        // Relaxed: it is seen at the latest by a thread that was woken or kept from sleeping.
        self.shared.ended.store(true, Relaxed);
        self.workers.iter().for_each(Waker::wake);
    }
}

/// Closes the ticket when it is dropped, by a panic, too, and waits for those inside.
struct Closing<'a>(&'a Shared);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        // Relaxed: it tells nothing but that the ticket is closed. Whoever came in before it is counted in
        // the state from then on, and whoever comes in after it finds the ticket closed.
        self.0.state.fetch_add(TICKET, Relaxed);
        let mut looks = 0;
        // Acquire: all that was done by those who have left (Release) is seen by the caller, also by those
        // who left before others, since each further change of the state is an addition to theirs.
        while num_inside(self.0.state.load(Acquire)) != 0 {
            looks += 1;
            pause(looks);
        }
    }
}

impl Shared {
    /// A thread's life: waits for tickets and joins in.
    fn serve(&self, index: usize, sleeper: &Sleeper) {
        let mut last = 0;
        while self.wait(last, sleeper) {
            // Acquire: with an open ticket come its job and counters.
            let found = self.state.fetch_add(1, Acquire);
            last = found / TICKET;
            if is_open(found) {
                // SAFETY: the ticket was open when we came in, so `job` is set, and its closure alive until
                // we are out.
                let job = self.job.with(|place| unsafe { (*place).map(|job| &*job) });
                if job.is_some_and(|job| catch_unwind(AssertUnwindSafe(|| job(index))).is_err()) {
                    self.panicked.store(true, Relaxed); // seen by the caller, as all that was done here is
                }
            }
            // Release: what was done here is seen by the caller that waits for us (Acquire).
            self.state.fetch_sub(1, Release);
        }
    }

    /// Waits for an open ticket other than `last`. Returns false once the pool has ended.
    fn wait(&self, last: usize, sleeper: &Sleeper) -> bool {
        let mut watch = Watch::begin();
        loop {
            // Relaxed: a late look is only late. None is late for ever: what was done before `wake` is
            // seen after the `sleep` that it ends.
            if self.ended.load(Relaxed) {
                return false;
            }
            let state = self.state.load(Relaxed);
            if is_open(state) && state / TICKET != last {
                return true;
            }
            if !watch.goes_on() {
                sleeper.sleep();
                watch = Watch::begin();
            }
        }
    }
}

#[cfg(all(test, loom))]
mod model_tests;
#[cfg(all(test, not(loom)))]
mod tests;
