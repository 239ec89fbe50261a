//! One world and its numbers: each quantity in and out as a list.

use innerattn_env::batch::{Autoreset, Batch, Options, StepBuffers};
use innerattn_env::error::Error;
use innerattn_env::geometry::Vec2;
use innerattn_env::reward::NUM_COMPONENTS;
use innerattn_env::robot::Commands;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::Actions;
use innerattn_env::tasks::Rescue;
use innerattn_env::world::World;

/// Numbers of a victim: presence, task, number, deadline (-1: none), whether it waits, x, y, share of service.
pub const VICTIM_NUMBERS: usize = 8;

/// What can be asked for, by its number in [`Quantity::ALL`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// R × D.
    Observations,
    /// R × 2, m.
    Positions,
    /// R × 2, m/s.
    Velocities,
    /// R, rad; 0 without wheels.
    Headings,
    /// R shares.
    Charges,
    /// R shares.
    Loads,
    /// R × R: whether the first hears the second.
    Heard,
    /// R × kinds.
    Faults,
    /// V × [`VICTIM_NUMBERS`]. Put: V × 4: presence, task, x, y.
    Victims,
    /// O × 2, m.
    Obstacles,
    /// Of the last step: step, victim, task, and helpers (-1: none), for each.
    Rescues,
    /// Of the last step: step, victim and task, for each.
    Losses,
    /// Episode, step, D, V and most helpers.
    Counts,
    /// R × 2: how far each robot's drive alone would have moved it in the last step, m; 0 on wheels.
    Ways,
    /// Put alone: R × 4, places and velocities.
    Motion,
}

impl Quantity {
    const ALL: [Self; 15] = [
        Self::Observations,
        Self::Positions,
        Self::Velocities,
        Self::Headings,
        Self::Charges,
        Self::Loads,
        Self::Heard,
        Self::Faults,
        Self::Victims,
        Self::Obstacles,
        Self::Rescues,
        Self::Losses,
        Self::Counts,
        Self::Ways,
        Self::Motion,
    ];

    /// The quantity of a number.
    ///
    /// # Errors
    /// [`Error::Argument`] for another number.
    pub fn of(number: usize) -> Result<Self, Error> {
        Self::ALL.get(number).copied().ok_or_else(|| refused("quantity", &number, "must be one there is"))
    }
}

/// A world, and what its last step left behind.
pub struct Place {
    batch: Batch,
    obs: Vec<f32>,
    last: Vec<f32>,
    rescues: Vec<Rescue>,
    ways: Vec<Vec2>,
}

impl Place {
    /// World 0 under a seed, at the start of its episode 0.
    ///
    /// # Errors
    /// As [`Batch::new`].
    pub fn new(rules: Rules, seed: u64) -> Result<Self, Error> {
        let (robots, width) = (rules.team.len(), rules.layout.width());
        let options =
            Options { num_envs: 1, seed, num_threads: Some(1), first_env: 0, autoreset: Autoreset::SameStep };
        let batch = Batch::new(rules, options)?;
        let row = vec![0.0; robots * width];
        let ways = vec![Vec2::zeros(); robots];
        Ok(Self { batch, obs: row.clone(), last: row, rescues: vec![], ways })
    }

    /// Begins the next episode, or episode 0 of a seed.
    pub fn restart(&mut self, seed: Option<u64>) -> i32 {
        self.batch.reset(seed, None, &mut self.obs);
        self.rescues.clear();
        self.ways.fill(Vec2::zeros());
        0
    }

    /// Does one control step; gives 1 if the episode is over, and the next has begun.
    ///
    /// # Errors
    /// As [`Batch::step`].
    pub fn step(&mut self, actions: &[f64]) -> Result<i32, Error> {
        let whole: Vec<i64> = actions.iter().map(|action| *action as i64).collect();
        let shares: Vec<f32> = actions.iter().map(|action| *action as f32).collect();
        let commands = match self.batch.rules().scenario.actions {
            Actions::Discrete => Commands::Discrete(&whole),
            Actions::Continuous => Commands::Continuous(&shares),
        };
        let robots = self.ways.len();
        let ways = (commands.len() >= robots).then(|| self.free_ways(commands));
        let (mut reward, mut components) = (vec![0.0; robots], vec![0.0; robots * NUM_COMPONENTS]);
        let (mut terminated, mut truncated) = ([false], [false]);
        let buffers = StepBuffers {
            obs: &mut self.obs,
            final_obs: &mut self.last,
            reward: &mut reward,
            components: &mut components,
            terminated: &mut terminated,
            truncated: &mut truncated,
        };
        self.rescues = self.batch.step(commands, buffers)?;
        self.ways = ways.unwrap_or_default();
        Ok(i32::from(terminated[0] || truncated[0]))
    }

    /// Where the drives alone would move robots in a step.
    fn free_ways(&self, commands: Commands) -> Vec<Vec2> {
        let (rules, world) = (self.batch.rules(), self.world());
        let dt = rules.scenario.dt_s as f32;
        let way = |robot: usize| {
            let body = &rules.team[robot];
            let (drive, cap) = world.faults.drive(robot, commands.drive(robot));
            let stands = drive == Vec2::zeros() || body.gain == 0.0;
            if stands { Vec2::zeros() } else { body.driven(world.velocities[robot], drive, cap) * dt }
        };
        (0..rules.team.len()).map(way).collect()
    }

    fn world(&self) -> &World {
        self.batch.worlds().next().expect("a batch of one world")
    }

    /// Adds the numbers of a quantity to `values`.
    ///
    /// # Errors
    /// [`Error::Argument`] for what can only be put.
    pub fn take(&self, quantity: Quantity, values: &mut Vec<f64>) -> Result<(), Error> {
        let (rules, world) = (self.batch.rules(), self.world());
        let robots = rules.team.len();
        match quantity {
            Quantity::Observations => values.extend(self.obs.iter().copied().map(f64::from)),
            Quantity::Positions => add_vectors(values, &world.positions),
            Quantity::Velocities => add_vectors(values, &world.velocities),
            Quantity::Obstacles => add_vectors(values, &world.obstacles),
            Quantity::Ways => add_vectors(values, &self.ways),
            Quantity::Headings => values.extend(
                (0..robots).map(|robot| world.headings.get(robot).map_or(0.0, |one| one.angle.into())),
            ),
            Quantity::Charges => {
                let share = |robot| rules.energy.as_ref().map_or(1.0, |one| one.share(robot, &world.charges));
                values.extend((0..robots).map(share).map(f64::from));
            }
            Quantity::Loads => {
                let share = |robot| rules.supplies.as_ref().map_or(1.0, |one| one.share(robot, &world.loads));
                values.extend((0..robots).map(share).map(f64::from));
            }
            Quantity::Heard => {
                for heard in world.heard(rules) {
                    values.extend((0..robots).map(|other| (heard >> other & 1) as f64));
                }
            }
            Quantity::Faults => {
                values.extend((0..robots).flat_map(|robot| world.faults.levels(robot)).map(f64::from));
            }
            Quantity::Victims => add_victims(values, rules, world),
            Quantity::Rescues => {
                let most = rules.scenario.max_helpers();
                for rescue in &self.rescues {
                    values.extend([rescue.step, rescue.victim, rescue.task].map(f64::from));
                    values.extend(rescue.helpers[..most].iter().map(|one| one.map_or(-1.0, f64::from)));
                }
            }
            Quantity::Losses => {
                for loss in self.batch.losses() {
                    values.extend([loss.step, loss.victim, loss.task].map(f64::from));
                }
            }
            Quantity::Counts => {
                let scenario = &rules.scenario;
                let sizes = [rules.layout.width(), scenario.num_victims(), scenario.max_helpers()];
                values.extend([world.episode as f64, world.step.into()]);
                values.extend(sizes.map(|size| size as f64));
            }
            Quantity::Motion => return Err(refused("quantity", &"motion", "can only be put")),
        }
        Ok(())
    }

    /// Puts numbers in place of a quantity, and looks again.
    ///
    /// # Errors
    /// [`Error::Argument`] for what can only be taken, else as the batch says; nothing has changed then.
    pub fn put(&mut self, quantity: Quantity, values: &[f64]) -> Result<i32, Error> {
        let small: Vec<f32> = values.iter().map(|value| *value as f32).collect();
        match quantity {
            Quantity::Motion => {
                let (places, velocities) = small.split_at(small.len() / 2);
                self.batch.set_motion(places, velocities)?;
            }
            Quantity::Faults => self.batch.set_faults(&small, None)?,
            Quantity::Victims => {
                let rows = || values.chunks_exact(4);
                let present: Vec<bool> = rows().map(|row| row[0] != 0.0).collect();
                let tasks: Vec<i64> = rows().map(|row| row[1] as i64).collect();
                let places: Vec<f32> = small.chunks_exact(4).flat_map(|row| [row[2], row[3]]).collect();
                self.batch.set_victims(&present, &tasks, &places)?;
            }
            _ => return Err(refused("quantity", &format!("{quantity:?}"), "can only be taken")),
        }
        self.batch.observe(&mut self.obs);
        Ok(0)
    }
}

fn add_vectors(values: &mut Vec<f64>, vectors: &[Vec2]) {
    values.extend(vectors.iter().flat_map(|at| [at.x, at.y]).map(f64::from));
}

fn add_victims(values: &mut Vec<f64>, rules: &Rules, world: &World) {
    for victim in &world.victims {
        let Some(victim) = victim else {
            values.extend([0.0; VICTIM_NUMBERS]);
            continue;
        };
        let deadline = if victim.deadline_step == u32::MAX { -1.0 } else { victim.deadline_step.into() };
        let waits = rules.order.as_ref().is_some_and(|order| order.is_blocked(victim, &world.victims));
        values.extend([1.0, victim.task.into(), victim.id.into(), deadline, f64::from(u8::from(waits))]);
        let served = rules.services[victim.task as usize].share(victim);
        values.extend([victim.position.x, victim.position.y, served].map(f64::from));
    }
}

fn refused(name: &'static str, value: &dyn ToString, rule: &str) -> Error {
    Error::Argument { name, value: value.to_string(), rule: rule.into() }
}
