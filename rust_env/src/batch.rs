//! Many worlds over flat buffers: threads, checks at the door, autoreset. Worlds never meet here: the
//! split over threads changes when a world is stepped, never what happens in it.

mod buffers;
mod shard;
mod victims;

use std::f32::consts::PI;
use std::iter::zip;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use innerattn_pool::Pool;

use crate::error::{Error, Result};
use crate::fault::{Levels, NUM_KINDS, SPECS};
use crate::geometry::Vec2;
use crate::robot::{Commands, MAX_SET_SPEED_MPS, NUM_ACTIONS};
use crate::rules::Rules;
use crate::scenario::Actions;
use crate::snapshot;
use crate::tasks::{Loss, Rescue};
use crate::wheels::Heading;
use crate::world::World;

pub use buffers::StepBuffers;
pub use shard::Poll;
use shard::{Shard, Stepping, Watch};

/// Most worlds in a batch.
pub const MAX_ENVS: usize = 1 << 20;
/// Most threads of a batch.
pub const MAX_THREADS: usize = 256;
/// Shards for each thread, so that a busy one does not keep the others waiting.
const SHARDS_PER_THREAD: usize = 16;
/// A step is polled, and the worlds before it kept, after one that took at least this long.
const LONG_STEP: Duration = Duration::from_millis(100);

/// What happens when an episode ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Autoreset {
    /// The next episode starts in the same step.
    SameStep,
    /// The next episode starts in the next step, in which the world does nothing else.
    NextStep,
    /// The world waits for a reset.
    Disabled,
}

/// How a batch is made.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Number of worlds E.
    pub num_envs: usize,
    /// Seed of all random streams.
    pub seed: u64,
    /// Threads; as many as are worth it if absent.
    pub num_threads: Option<usize>,
    /// Number of the first world's random streams: env i of this batch is world `first_env + i`.
    pub first_env: u64,
    /// What happens when an episode ends.
    pub autoreset: Autoreset,
}

/// A batch of worlds of one scenario.
pub struct Batch {
    rules: Arc<Rules>,
    shards: Vec<Shard>,
    pool: Pool,
    options: Options,
    /// Worlds that panicked and wait for a reset, in order.
    broken: Vec<usize>,
    /// Worlds that are to panic in the next step, for tests.
    doomed: Vec<usize>,
    /// What the last step took that could be polled.
    last_step: Duration,
}

impl Batch {
    /// Refuses an option that is not allowed.
    ///
    /// # Errors
    /// [`Error::Argument`] that names it and its range.
    pub fn check(options: &Options) -> Result<()> {
        argument("num_envs", options.num_envs, MAX_ENVS)?;
        options.num_threads.map_or(Ok(()), |threads| argument("num_threads", threads, MAX_THREADS))
    }

    /// Makes the worlds, each at the start of its episode 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for an option that is not allowed, and for more threads than the system gives.
    pub fn new(rules: impl Into<Arc<Rules>>, options: Options) -> Result<Self> {
        let rules = rules.into();
        Self::check(&options)?;
        let available = std::thread::available_parallelism().map_or(1, usize::from);
        let worth = options.num_envs / rules.physics.envs_worth_a_thread();
        let threads = options.num_threads.unwrap_or(available.min(worth).clamp(1, MAX_THREADS));
        let pool = Pool::new(threads).map_err(|error| Error::Argument {
            name: "num_threads",
            value: threads.to_string(),
            rule: error.to_string(),
        })?;
        let shards = if threads == 1 { 1 } else { threads * SHARDS_PER_THREAD };
        let length = options.num_envs.div_ceil(shards);
        let starts = (0..options.num_envs).step_by(length);
        let shard = |first: usize| {
            let envs = first..options.num_envs.min(first + length);
            let world = |env| World::new(&rules, options.seed, options.first_env + env as u64);
            Shard::new(first, envs.map(world).collect())
        };
        let shards = starts.map(shard).collect();
        let (broken, doomed) = (vec![], vec![]);
        Ok(Self { rules, shards, pool, options, broken, doomed, last_step: Duration::MAX })
    }

    /// What the worlds share.
    #[must_use]
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Number of worlds E.
    #[must_use]
    pub fn num_envs(&self) -> usize {
        self.options.num_envs
    }

    /// Threads in use.
    #[must_use]
    pub fn num_threads(&self) -> usize {
        self.pool.num_threads()
    }

    /// The worlds in order.
    pub fn worlds(&self) -> impl Iterator<Item = &World> {
        self.shards.iter().flat_map(|shard| &shard.worlds)
    }

    /// Starts new episodes in the worlds of `mask` (all if absent), under `seed` from episode 0 if
    /// given, else in the episode after the present one (the first reset keeps episode 0, if no step
    /// was done before), and writes everyone's observations into `obs` (E × R × D).
    pub fn reset(&mut self, seed: Option<u64>, mask: Option<&[bool]>, obs: &mut [f32]) {
        let rules = &self.rules;
        let envs = self.shards.iter_mut().flat_map(|shard| &mut shard.worlds).enumerate();
        for (_, world) in envs.filter(|(env, _)| mask.is_none_or(|mask| mask[*env])) {
            let next = if world.fresh { 0 } else { world.episode + 1 };
            world.seed = seed.unwrap_or(world.seed);
            world.begin(rules, if seed.is_some() { 0 } else { next });
            world.fresh = false;
        }
        self.broken.retain(|env| mask.is_some_and(|mask| !mask[*env]));
        self.observe(obs);
    }

    /// Writes everyone's observations into `obs` (E × R × D).
    pub fn observe(&self, obs: &mut [f32]) {
        let row = self.rules.team.len() * self.rules.layout.width();
        for (world, rows) in zip(self.worlds(), obs.chunks_exact_mut(row)) {
            world.observe(&self.rules, rows);
        }
    }

    /// Does one control step in every world; `commands` are E × R actions in env order. Returns the
    /// rescues in order of env.
    ///
    /// # Errors
    /// [`Error::Action`], [`Error::EpisodeOver`] or [`Error::Broken`], before anything has moved;
    /// [`Error::Panicked`] for worlds that panicked, after all others have done the step.
    pub fn step(&mut self, commands: Commands, buffers: StepBuffers) -> Result<Vec<Rescue>> {
        self.step_polled(commands, buffers, None)
    }

    /// As [`Self::step`]. If steps take long, calls `poll` now and then, from this thread, between
    /// worlds; where it returns true, the step ends and nothing has moved. That takes a copy of the worlds.
    ///
    /// # Errors
    /// As [`Self::step`]; [`Error::Interrupted`] if the poll ended it.
    pub fn step_polled(
        &mut self,
        commands: Commands,
        buffers: StepBuffers,
        poll: Option<Poll>,
    ) -> Result<Vec<Rescue>> {
        self.check_commands(commands)?;
        let began = poll.map(|_| Instant::now()); // a page has no clock, and polls nobody
        let watch = poll.filter(|_| self.last_step >= LONG_STEP).map(Watch::new);
        let doomed = std::mem::take(&mut self.doomed);
        let (rules, autoreset) = (&*self.rules, self.options.autoreset);
        let (robots, width) = (rules.team.len(), rules.layout.width());
        let stepping = Stepping { rules, autoreset, commands, watch: watch.as_ref(), doomed: &doomed };
        let mut rest = buffers;
        let mut jobs = Vec::with_capacity(self.shards.len());
        for shard in &mut self.shards {
            let (part, later) = rest.split(shard.worlds.len(), robots, width);
            rest = later;
            jobs.push(Mutex::new((shard, part)));
        }
        self.pool.for_each(jobs.len(), |index| {
            // Each job is taken once, so its lock is always free.
            let mut job = jobs[index].lock().unwrap_or_else(PoisonError::into_inner);
            let (shard, part) = &mut *job;
            shard.step(&stepping, part);
        });
        drop(jobs);
        let interrupted = watch.is_some_and(|watch| watch.stopped());
        self.shards.iter_mut().for_each(|shard| shard.settle(interrupted));
        if interrupted {
            return Err(Error::Interrupted);
        }
        self.last_step = began.map_or(self.last_step, |began| began.elapsed());
        self.broken = self.shards.iter().flat_map(|shard| &shard.failures).map(|(env, _)| *env).collect();
        match self.shards.iter().flat_map(|shard| &shard.failures).next() {
            None => Ok(self.shards.iter().flat_map(|shard| &shard.events.rescues).copied().collect()),
            Some((_, said)) => Err(Error::Panicked { envs: self.broken.clone(), message: said.clone() }),
        }
    }

    /// The victims that were lost in the last step, in order of env.
    pub fn losses(&self) -> impl Iterator<Item = &Loss> {
        self.shards.iter().flat_map(|shard| &shard.events.losses)
    }

    /// The env of each victim that was turned away in the last step, in order.
    pub fn turned_away(&self) -> impl Iterator<Item = u32> {
        self.shards.iter().flat_map(|shard| &shard.events.turned_away).copied()
    }

    /// Lets these worlds panic in the next step, to test what happens then.
    #[doc(hidden)]
    pub fn panic_in_next_step(&mut self, envs: Vec<usize>) {
        self.doomed = envs;
    }

    /// Refuses actions of the wrong kind or number, out of range, or for a world whose episode is over.
    fn check_commands(&self, commands: Commands) -> Result<()> {
        let robots = self.rules.team.len();
        let place = |index: usize| (index / robots, index % robots);
        match commands {
            Commands::Discrete(actions) => {
                let bad = actions.iter().position(|action| !(0..NUM_ACTIONS as i64).contains(action));
                if let Some(index) = bad {
                    let (env, robot) = place(index);
                    let value = actions[index].to_string();
                    return Err(Error::Action { env, robot, value, rule: "must be an integer in 0..=4" });
                }
            }
            Commands::Continuous(actions) => {
                if let Some(index) = actions.iter().position(|share| !(-1.0..=1.0).contains(share)) {
                    let (env, robot) = place(index / 2);
                    let value = format!("{:?} on axis {}", actions[index], index % 2);
                    return Err(Error::Action { env, robot, value, rule: "must be a number in -1..=1" });
                }
            }
        }
        let per_robot = if self.rules.scenario.actions == Actions::Discrete { 1 } else { 2 };
        let wanted = self.options.num_envs * robots * per_robot;
        if commands.kind() != self.rules.scenario.actions || commands.len() != wanted {
            return Err(Error::Argument {
                name: "actions",
                value: format!("{} {:?} values", commands.len(), commands.kind()),
                rule: format!("must be {wanted} {:?} values", self.rules.scenario.actions),
            });
        }
        if let Some(env) = self.broken.first() {
            return Err(Error::Broken { env: *env });
        }
        match self.worlds().position(|world| world.over) {
            Some(env) if self.options.autoreset != Autoreset::NextStep => Err(Error::EpisodeOver { env }),
            _ => Ok(()),
        }
    }

    /// An image of all worlds.
    #[must_use]
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::save(&self.rules, self.num_envs(), self.worlds())
    }

    /// Puts all worlds back into the state of an image; nothing changes if it is refused.
    ///
    /// # Errors
    /// [`Error::Snapshot`] that says what is wrong.
    pub fn restore(&mut self, image: &[u8]) -> Result<()> {
        let worlds = snapshot::load(&self.rules, self.options.num_envs, image)?;
        if self.options.autoreset == Autoreset::SameStep
            && let Some(env) = worlds.iter().position(|world| world.over)
        {
            let rule = "of a batch without autoreset; this one has it and could not step";
            return Err(Error::Snapshot(format!("the episode of env {env} is over in it: it is {rule}")));
        }
        let mut worlds = worlds.into_iter();
        for shard in &mut self.shards {
            shard.worlds = worlds.by_ref().take(shard.worlds.len()).collect();
        }
        self.broken.clear();
        Ok(())
    }

    /// Puts robots at `positions` with `velocities` (E × R × 2, C order), for tests and studies of
    /// motion; rules and victims are left alone.
    ///
    /// # Errors
    /// [`Error::Argument`] for too many or too few numbers, places outside the arena, speeds past
    /// [`MAX_SET_SPEED_MPS`], and what is not a number; nothing has changed then.
    pub fn set_motion(&mut self, positions: &[f32], velocities: &[f32]) -> Result<()> {
        let robots = self.rules.team.len();
        for (name, values) in [("positions", positions), ("velocities", velocities)] {
            let wanted = self.options.num_envs * robots * 2;
            if values.len() != wanted {
                let value = format!("{} values", values.len());
                return Err(Error::Argument { name, value, rule: format!("must be {wanted} numbers") });
            }
        }
        let half = self.rules.scenario.arena_half_width_m as f32;
        for (name, values, most, unit) in
            [("positions", positions, half, "m"), ("velocities", velocities, MAX_SET_SPEED_MPS, "m/s")]
        {
            if let Some(index) = values.iter().position(|value| !(-most..=most).contains(value)) {
                let (env, robot) = (index / (2 * robots), index / 2 % robots);
                return Err(Error::Argument {
                    name,
                    value: format!("{} (env {env}, robot {robot})", values[index]),
                    rule: format!("must be in -{most}..={most} {unit}"),
                });
            }
        }
        let vector = |pair: &[f32]| Vec2::new(pair[0], pair[1]);
        let rows = zip(positions.chunks_exact(2 * robots), velocities.chunks_exact(2 * robots));
        let worlds = self.shards.iter_mut().flat_map(|shard| &mut shard.worlds);
        for (world, (places, speeds)) in zip(worlds, rows) {
            world.positions = places.chunks_exact(2).map(vector).collect();
            world.velocities = speeds.chunks_exact(2).map(vector).collect();
            world.headings.iter_mut().for_each(|heading| heading.turn_rate = 0.0);
            world.perceive(&self.rules);
        }
        Ok(())
    }

    /// Lets robots on wheels point along `angles` (E × R), rad, without turning; other robots have no heading.
    ///
    /// # Errors
    /// [`Error::Argument`] where no robot has wheels, for too many or too few numbers, and for angles beyond ±π
    /// or not numbers; nothing has changed then.
    pub fn set_headings(&mut self, angles: &[f32]) -> Result<()> {
        let robots = self.rules.team.len();
        let wanted = self.options.num_envs * robots;
        let refuse = |value: String, rule: String| Err(Error::Argument { name: "headings", value, rule });
        let Some(wheels) = &self.rules.wheels else {
            return refuse(
                format!("{} values", angles.len()),
                "no robot of this scenario has a heading".into(),
            );
        };
        if angles.len() != wanted {
            return refuse(format!("{} values", angles.len()), format!("must be {wanted} numbers"));
        }
        if let Some(index) = angles.iter().position(|angle| !(-PI..=PI).contains(angle)) {
            let (env, robot) = (index / robots, index % robots);
            let value = format!("{} (env {env}, robot {robot})", angles[index]);
            return refuse(value, format!("must be in -{PI}..={PI} rad"));
        }
        let worlds = self.shards.iter_mut().flat_map(|shard| &mut shard.worlds);
        for (world, angles) in zip(worlds, angles.chunks_exact(robots)) {
            for robot in wheels.robots() {
                world.headings[robot] = Heading { angle: angles[robot], turn_rate: 0.0 };
            }
            world.perceive(&self.rules);
        }
        Ok(())
    }

    /// Puts `levels` (E × R × kinds) in place of the scenario's faults in the worlds of `mask` (all if
    /// absent), until their episodes end.
    ///
    /// # Errors
    /// [`Error::Fault`] for a value out of range or not a number, in a world of the mask, and
    /// [`Error::Argument`] for too many or few values; nothing has changed then.
    pub fn set_faults(&mut self, levels: &[f32], mask: Option<&[bool]>) -> Result<()> {
        let robots = self.rules.team.len();
        let wanted = self.options.num_envs * robots * NUM_KINDS;
        if levels.len() != wanted {
            let value = format!("{} values", levels.len());
            return Err(Error::Argument { name: "faults", value, rule: format!("must be {wanted} numbers") });
        }
        let chosen = |env: usize| mask.is_none_or(|mask| mask[env]);
        let (levels, _) = levels.as_chunks::<NUM_KINDS>();
        for (index, levels) in levels.iter().enumerate().filter(|(index, _)| chosen(index / robots)) {
            check_levels(levels, index / robots, index % robots)?;
        }
        let rules = &self.rules;
        let worlds = self.shards.iter_mut().flat_map(|shard| &mut shard.worlds);
        for (env, (world, levels)) in zip(worlds, levels.chunks_exact(robots)).enumerate() {
            if chosen(env) {
                world.set_faults(rules, levels);
            }
        }
        Ok(())
    }
}

/// Refuses levels of a fault that are out of range or not numbers.
fn check_levels(levels: &Levels, env: usize, robot: usize) -> Result<()> {
    for (spec, value) in zip(SPECS, levels) {
        let (low, high) = spec.range;
        if !(low as f32..=high as f32).contains(value) {
            let rule = format!("must be in {low}..={high} {}", spec.unit).trim_end().to_string();
            return Err(Error::Fault { kind: spec.name, env, robot, value: *value, rule });
        }
    }
    Ok(())
}

fn argument(name: &'static str, value: usize, most: usize) -> Result<()> {
    if (1..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::Argument { name, value: value.to_string(), rule: format!("must be in 1..={most}") })
}

#[cfg(test)]
mod forged;
#[cfg(test)]
mod tests;
