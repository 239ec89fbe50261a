//! What the pool is made of: the standard library's threads and atomics, or under `--cfg loom` those of
//! loom, which runs a test under every order of events that the memory model allows.

#[cfg(loom)]
pub use model::{Sleeper, Waker, Watch, pause, spawn};
#[cfg(not(loom))]
pub use real::{Sleeper, UnsafeCell, Waker, Watch, pause, spawn};

#[cfg(loom)]
pub use loom::{
    cell::UnsafeCell,
    sync::Arc,
    sync::atomic::{AtomicBool, AtomicUsize},
};
#[cfg(not(loom))]
pub use std::{
    sync::Arc,
    sync::atomic::{AtomicBool, AtomicUsize},
};

#[cfg(not(loom))]
mod real {
    use std::io::Result;
    use std::thread::{self, Builder, Thread};
    use std::time::{Duration, Instant};

    /// How long a thread watches for the next job before it sleeps: longer than a caller takes between
    /// the steps of a tight loop, too short to be felt by anyone else.
    const WATCHING: Duration = Duration::from_micros(100);
    /// Looks between two looks at the clock.
    const LOOKS: u32 = 64;

    /// The right of a thread to sleep.
    pub struct Sleeper;

    impl Sleeper {
        /// Returns after a call to [`Waker::wake`], at once if there was one since the last time.
        #[allow(clippy::unused_self)] // loom's needs it
        pub fn sleep(&self) {
            thread::park();
        }
    }

    /// Wakes one thread.
    pub struct Waker(Thread);

    impl Waker {
        pub fn wake(&self) {
            self.0.unpark();
        }
    }

    /// Starts a thread that does `work`.
    pub fn spawn(name: String, work: impl FnOnce(Sleeper) + Send + 'static) -> Result<Waker> {
        let handle = Builder::new().name(name).spawn(|| work(Sleeper))?;
        Ok(Waker(handle.thread().clone()))
    }

    /// A cell under the interface of loom's, which is told who looks into it when.
    pub struct UnsafeCell<T>(std::cell::UnsafeCell<T>);

    impl<T> UnsafeCell<T> {
        pub fn new(value: T) -> Self {
            Self(std::cell::UnsafeCell::new(value))
        }

        pub fn with<R>(&self, look: impl FnOnce(*const T) -> R) -> R {
            look(self.0.get())
        }

        pub fn with_mut<R>(&self, change: impl FnOnce(*mut T) -> R) -> R {
            change(self.0.get())
        }
    }

    /// A thread's watch for the next job.
    pub struct Watch {
        since: Instant,
        looks: u32,
    }

    impl Watch {
        pub fn begin() -> Self {
            Self { since: Instant::now(), looks: 0 }
        }

        /// Lets a moment pass. Returns whether the thread may go on watching, or else is to sleep.
        pub fn goes_on(&mut self) -> bool {
            std::hint::spin_loop();
            self.looks = (self.looks + 1) % LOOKS;
            self.looks != 0 || self.since.elapsed() <= WATCHING
        }
    }

    /// Lets a moment pass before look number `looks` at what others are about to finish.
    pub fn pause(looks: u32) {
        if looks.is_multiple_of(LOOKS) { thread::yield_now() } else { std::hint::spin_loop() }
    }
}

#[cfg(loom)]
#[allow(clippy::unused_self)] // the real ones need it
mod model {
    use std::io::Result;

    use loom::sync::{Arc, Condvar, Mutex};
    use loom::thread::{Builder, yield_now};

    /// What `std` promises of `park` and `unpark`, and no more: loom's own let a thread see at once what
    /// stands before an `unpark`, though it is not asleep.
    #[derive(Default)]
    struct Bell {
        rung: Mutex<bool>,
        heard: Condvar,
    }

    pub struct Sleeper(Arc<Bell>);

    impl Sleeper {
        pub fn sleep(&self) {
            let mut rung = self.0.rung.lock().expect("no panic");
            while !*rung {
                rung = self.0.heard.wait(rung).expect("no panic");
            }
            *rung = false;
        }
    }

    pub struct Waker(Arc<Bell>);

    impl Waker {
        pub fn wake(&self) {
            *self.0.rung.lock().expect("no panic") = true;
            self.0.heard.notify_one();
        }
    }

    pub fn spawn(name: String, work: impl FnOnce(Sleeper) + Send + 'static) -> Result<Waker> {
        let bell = Arc::new(Bell::default());
        let sleeper = Sleeper(Arc::clone(&bell));
        Builder::new().name(name).spawn(move || work(sleeper))?;
        Ok(Waker(bell))
    }

    /// There is no time in the model: a thread sleeps as soon as it may.
    pub struct Watch;

    impl Watch {
        pub fn begin() -> Self {
            Self
        }

        pub fn goes_on(&mut self) -> bool {
            false
        }
    }

    pub fn pause(_looks: u32) {
        yield_now();
    }
}
