//! Neighbouring worlds that one thread steps at a time: each world by itself, so that one that panics
//! stops no other, and with a look now and then at whether the caller wants to be interrupted.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use super::{Autoreset, StepBuffers};
use crate::physics::Workspace;
use crate::reward::NUM_COMPONENTS;
use crate::robot::Commands;
use crate::rules::Rules;
use crate::tasks::Events;
use crate::world::{Ending, World};

/// Time between two polls of the caller.
const BETWEEN_POLLS: Duration = Duration::from_millis(50);

/// Whether the caller wants a step to end. Called by the caller's own thread alone.
pub type Poll<'a> = &'a (dyn Fn() -> bool + Sync);

/// Asks the caller now and then, from its own thread, and tells the others.
pub(super) struct Watch<'a> {
    poll: Poll<'a>,
    caller: ThreadId,
    last: Mutex<Instant>,
    stop: AtomicBool,
}

impl<'a> Watch<'a> {
    pub(super) fn new(poll: Poll<'a>) -> Self {
        let (caller, last) = (thread::current().id(), Mutex::new(Instant::now()));
        Self { poll, caller, last, stop: AtomicBool::new(false) }
    }

    /// Whether the step is to end, as far as is known.
    pub(super) fn stopped(&self) -> bool {
        self.stop.load(Relaxed) // a late look is only late
    }

    /// Whether the step is to end; asks if it is time to.
    fn stops(&self) -> bool {
        if thread::current().id() == self.caller
            && let Ok(mut last) = self.last.lock()
            && last.elapsed() >= BETWEEN_POLLS
        {
            if (self.poll)() {
                self.stop.store(true, Relaxed);
            }
            *last = Instant::now();
        }
        self.stopped()
    }
}

/// What all shards of a step have in common.
pub(super) struct Stepping<'a> {
    pub rules: &'a Rules,
    pub autoreset: Autoreset,
    pub commands: Commands<'a>,
    pub watch: Option<&'a Watch<'a>>,
    /// Worlds that are to panic, for tests.
    pub doomed: &'a [usize],
}

/// Neighbouring worlds that one thread steps at a time.
pub(super) struct Shard {
    pub first: usize,
    pub worlds: Vec<World>,
    /// What became of victims in the last step.
    pub events: Events,
    /// Worlds that panicked in the last step, and what they said.
    pub failures: Vec<(usize, String)>,
    workspace: Workspace,
    /// The worlds before a step that may be interrupted.
    before: Vec<World>,
}

impl Shard {
    pub(super) fn new(first: usize, worlds: Vec<World>) -> Self {
        let workspace = Workspace::default();
        Self { first, worlds, events: Events::default(), failures: vec![], workspace, before: vec![] }
    }

    /// Steps the worlds, all but those after an interruption.
    pub(super) fn step(&mut self, stepping: &Stepping, buffers: &mut StepBuffers) {
        self.events.clear();
        self.failures.clear();
        if let Some(watch) = stepping.watch {
            if watch.stopped() {
                return;
            }
            self.before.clone_from(&self.worlds);
        }
        let mut index = 0;
        while index < self.worlds.len() {
            let rest = AssertUnwindSafe(|| {
                while index < self.worlds.len() && !stepping.watch.is_some_and(Watch::stops) {
                    self.step_world(index, stepping, buffers);
                    index += 1;
                }
            });
            match catch_unwind(rest) {
                Ok(()) => return,
                Err(panic) => self.give_up(index, &*panic, stepping.rules, buffers),
            }
            index += 1;
        }
    }

    fn step_world(&mut self, index: usize, stepping: &Stepping, buffers: &mut StepBuffers) {
        let Stepping { rules, autoreset, commands, .. } = *stepping;
        let robots = rules.team.len();
        let row = robots * rules.layout.width();
        let world = &mut self.worlds[index];
        let components =
            &mut buffers.components[index * robots * NUM_COMPONENTS..][..robots * NUM_COMPONENTS];
        let reward = &mut buffers.reward[index * robots..][..robots];
        let env = self.first + index;
        let ending = if world.over {
            // Only seen with `Autoreset::NextStep`: all else refuses to step such a world.
            world.begin(rules, world.episode + 1);
            components.fill(0.0);
            reward.fill(0.0);
            Ending { terminated: false, truncated: false }
        } else {
            world.step(rules, &mut self.workspace, commands, env, &mut self.events, components, reward)
        };
        assert!(!stepping.doomed.contains(&env), "a test asked for it");
        buffers.terminated[index] = ending.terminated;
        buffers.truncated[index] = ending.truncated;
        let obs = &mut buffers.obs[index * row..][..row];
        let final_obs = &mut buffers.final_obs[index * row..][..row];
        world.observe(rules, final_obs);
        if ending.over() && autoreset == Autoreset::SameStep {
            world.begin(rules, world.episode + 1);
            world.observe(rules, obs);
        } else {
            obs.copy_from_slice(final_obs);
        }
    }

    /// Puts a world that panicked halfway back to the start of its episode, and writes nothing of it.
    fn give_up(&mut self, index: usize, panic: &(dyn Any + Send), rules: &Rules, buffers: &mut StepBuffers) {
        let env = self.first + index;
        self.failures.push((env, said(panic)));
        self.events.rescues.retain(|rescue| rescue.env as usize != env);
        self.events.losses.retain(|loss| loss.env as usize != env);
        self.events.turned_away.retain(|one| *one as usize != env);
        self.workspace = Workspace::default();
        let world = &mut self.worlds[index];
        let again = AssertUnwindSafe(|| world.begin(rules, world.episode));
        // Should this panic, too, the world still waits for a reset.
        drop(catch_unwind(again));
        let robots = rules.team.len();
        let row = robots * rules.layout.width();
        buffers.obs[index * row..][..row].fill(0.0);
        buffers.final_obs[index * row..][..row].fill(0.0);
        buffers.reward[index * robots..][..robots].fill(0.0);
        buffers.components[index * robots * NUM_COMPONENTS..][..robots * NUM_COMPONENTS].fill(0.0);
        (buffers.terminated[index], buffers.truncated[index]) = (false, false);
    }

    /// Ends a step that may have been interrupted: forgets the worlds before it, or goes back to them.
    pub(super) fn settle(&mut self, interrupted: bool) {
        let before = std::mem::take(&mut self.before);
        if interrupted {
            self.events.clear();
        }
        if interrupted && !before.is_empty() {
            self.worlds = before;
        }
    }
}

/// What a panic said, in one line.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a message").split_whitespace().collect::<Vec<_>>().join(" ")
}
