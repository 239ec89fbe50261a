//! One world: how an episode begins and what a step does. Its state is plain numbers.

use serde::{Deserialize, Serialize};

use crate::condition::{Condition, Moment};
use crate::error::{Error, Result};
use crate::fault::Levels;
use crate::geometry::Vec2;
use crate::observe::Scene;
use crate::physics::Workspace;
use crate::place::Placed;
use crate::reward::{Happened, total_distance};
use crate::rng::{Purpose, Stream};
use crate::robot::Commands;
use crate::rules::Rules;
use crate::scenario::{MAX_ROBOTS, Shaping, Situation};
use crate::task::{Rescue, Victim};

/// Whether and how an episode ended with a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ending {
    /// The scenario's goal was reached.
    pub terminated: bool,
    /// The episode's time was up.
    pub truncated: bool,
}

impl Ending {
    /// Whether the episode is over.
    #[must_use]
    pub fn over(self) -> bool {
        self.terminated || self.truncated
    }
}

/// The state of one world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct World {
    /// Seed of its streams.
    pub seed: u64,
    /// Number of its streams: the same number and seed give the same world in any batch.
    pub stream: u64,
    /// Episode, from 0.
    pub episode: u64,
    /// Steps done in this episode.
    pub step: u32,
    /// Whether the episode is over (only seen while autoreset is disabled).
    pub over: bool,
    /// Whether there was neither a reset nor a step yet: the first reset then keeps episode 0.
    pub fresh: bool,
    /// Victims rescued in this episode.
    pub rescued: u32,
    /// Victims that appeared in this episode.
    pub appeared: u32,
    /// Words drawn from the victims' stream.
    pub victim_words: u64,
    /// Places of the robots, m.
    pub positions: Vec<Vec2>,
    /// Velocities of the robots, m/s.
    pub velocities: Vec<Vec2>,
    /// Places of the obstacles, m.
    pub obstacles: Vec<Vec2>,
    /// Victims by slot.
    pub victims: Vec<Option<Victim>>,
    /// What is wrong with the robots.
    pub condition: Condition,
}

/// What did not fit when an episode began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Crowded {
    Obstacles,
    Robots,
    Victims,
}

impl World {
    /// World number `stream` under `seed`, at the start of episode 0.
    #[must_use]
    pub fn new(rules: &Rules, seed: u64, stream: u64) -> Self {
        let mut world = Self {
            seed,
            stream,
            episode: 0,
            step: 0,
            over: false,
            fresh: true,
            rescued: 0,
            appeared: 0,
            victim_words: 0,
            positions: vec![Vec2::zeros(); rules.team.len()],
            velocities: vec![Vec2::zeros(); rules.team.len()],
            obstacles: vec![Vec2::zeros(); rules.solids.len()],
            victims: vec![None; rules.scenario.num_victims()],
            condition: Condition::default(),
        };
        world.begin(rules, 0);
        world
    }

    /// Starts `episode`: places everything anew from that episode's streams.
    pub fn begin(&mut self, rules: &Rules, episode: u64) {
        self.try_begin(rules, episode);
    }

    /// As [`Self::begin`], and tells what had to be placed too near to something else.
    fn try_begin(&mut self, rules: &Rules, episode: u64) -> Option<Crowded> {
        self.episode = episode;
        self.step = 0;
        self.over = false;
        self.rescued = 0;
        self.appeared = 0;
        self.victim_words = 0;
        self.victims.fill(None);
        self.velocities.fill(Vec2::zeros());
        let mut stream = Stream::new(self.seed, self.stream, episode, Purpose::Start);
        let obstacles = self.place_obstacles(rules, &mut stream);
        let robots = self.place_robots(rules, &mut stream);
        let victims = self.fill_slots(rules);
        let now = self.now();
        self.condition.begin(rules, now);
        self.hold(rules);
        if !obstacles {
            Some(Crowded::Obstacles)
        } else if !robots {
            Some(Crowded::Robots)
        } else if !victims {
            Some(Crowded::Victims)
        } else {
            None
        }
    }

    fn place_obstacles(&mut self, rules: &Rules, stream: &mut Stream) -> bool {
        let mut clear = true;
        let given = rules.scenario.obstacles.iter().map(|obstacle| obstacle.position_m);
        let mut placed: Vec<Placed> = Vec::with_capacity(rules.solids.len());
        for (solid, position) in rules.solids.iter().zip(given.clone()) {
            if let Some([x, y]) = position {
                placed.push((solid, Vec2::new(x as f32, y as f32)));
            }
        }
        let mut fixed = 0;
        for (index, position) in given.enumerate() {
            let solid = &rules.solids[index];
            self.obstacles[index] = if position.is_some() {
                fixed += 1;
                placed[fixed - 1].1
            } else {
                let place = rules.placing.obstacle(stream, solid, &placed);
                clear &= place.clear;
                placed.push((solid, place.at));
                place.at
            };
        }
        clear
    }

    fn place_robots(&mut self, rules: &Rules, stream: &mut Stream) -> bool {
        let mut clear = true;
        let solids: Vec<Placed> = rules.solids.iter().zip(self.obstacles.iter().copied()).collect();
        let mut others = Vec::with_capacity(rules.team.len());
        for (body, position) in rules.team.iter().zip(&mut self.positions) {
            let place = rules.placing.robot(stream, body, &others, &solids);
            clear &= place.clear;
            others.push((body, place.at));
            *position = place.at;
        }
        clear
    }

    /// Lets the victims appear that the situation wants now. Returns whether all found a clear place.
    fn fill_slots(&mut self, rules: &Rules) -> bool {
        let wave = rules.scenario.situation == Situation::Mixed;
        let empty = |slot: &Option<Victim>| slot.is_none();
        if !(if wave { self.victims.iter().all(empty) } else { self.victims.iter().any(empty) }) {
            return true;
        }
        let mut stream =
            Stream::new(self.seed, self.stream, self.episode, Purpose::Victims).resume(self.victim_words);
        let wanted = if wave { 1 + stream.below(self.victims.len()) } else { self.victims.len() };
        let solids: Vec<Placed> = rules.solids.iter().zip(self.obstacles.iter().copied()).collect();
        let mut clear = true;
        for slot in 0..wanted {
            if self.victims[slot].is_some() {
                continue;
            }
            let task = match rules.scenario.situation {
                Situation::Double => slot,
                Situation::Single | Situation::Mixed => stream.below(rules.tasks.len()),
            };
            let place = rules.placing.victim(&mut stream, &self.positions, &solids);
            clear &= place.clear;
            self.victims[slot] = Some(Victim {
                id: self.appeared,
                task: task as u32,
                appeared_step: self.step,
                position: place.at,
            });
            self.appeared += 1;
        }
        self.victim_words = stream.words();
        clear
    }

    /// Does one control step. Robot 0's command is number `first` of `commands`; rescues are added to
    /// `rescues` under the batch index `env`; `components` is R × 4 and `reward` R.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        rules: &Rules,
        workspace: &mut Workspace,
        commands: Commands,
        env: usize,
        rescues: &mut Vec<Rescue>,
        components: &mut [f32],
        reward: &mut [f32],
    ) -> Ending {
        let shaping = rules.weights.shaping;
        let distance_before = if shaping == Shaping::None { 0.0 } else { self.distance(rules) };
        let away = self.condition.unavailable();
        let mut effort = [0.0; MAX_ROBOTS];
        let damping = rules.scenario.damping as f32;
        for (robot, body) in rules.team.iter().enumerate() {
            let drive = commands.drive(env * rules.team.len() + robot);
            effort[robot] = if away >> robot & 1 == 1 { 0.0 } else { drive.norm_squared() };
            let (drive, cap) = self.condition.driven(robot, drive);
            self.velocities[robot] = body.driven(self.velocities[robot], drive, damping, cap);
        }
        let touched =
            rules.physics.advance(workspace, &mut self.positions, &mut self.velocities, &self.obstacles);
        let mut distance_after = if shaping == Shaping::Progress { self.distance(rules) } else { 0.0 };

        let earlier = rescues.len();
        self.settle(rules, env, rescues);
        self.step += 1;
        self.fresh = false;
        self.fill_slots(rules);
        let now = self.now();
        self.condition.update(rules, now);
        self.hold(rules);
        let ending = Ending {
            terminated: rules.scenario.end_when_rescued.is_some_and(|goal| self.rescued >= goal),
            truncated: self.step >= rules.scenario.episode_steps,
        };
        self.over = ending.over();
        if shaping == Shaping::Potential && !ending.terminated {
            distance_after = self.distance(rules);
        }
        let happened = Happened {
            rescues: &rescues[earlier..],
            distance_before,
            distance_after,
            touched,
            effort: &effort,
        };
        rules.weights.write(&happened, components, reward);
        ending
    }

    /// Applies the rescue rule, slot by slot; no robot helps twice in one step.
    fn settle(&mut self, rules: &Rules, env: usize, rescues: &mut Vec<Rescue>) {
        let radius = rules.scenario.rescue_radius_m as f32;
        let mut busy = self.condition.unavailable();
        for (slot, place) in self.victims.iter_mut().enumerate() {
            let Some(victim) = *place else { continue };
            let needs = &rules.tasks[victim.task as usize];
            let found = needs.helpers(victim.position, &rules.team, &self.positions, radius, busy);
            let Some(helpers) = found else { continue };
            helpers.iter().flatten().for_each(|robot| busy |= 1 << robot);
            *place = None;
            self.rescued += 1;
            rescues.push(Rescue {
                env: env as u32,
                episode: self.episode,
                step: self.step,
                slot: slot as u32,
                victim: victim.id,
                task: victim.task,
                helpers,
            });
        }
    }

    fn distance(&self, rules: &Rules) -> f32 {
        let away = self.condition.unavailable();
        total_distance(self.victims.iter().flatten(), &rules.tasks, &rules.team, &self.positions, away)
    }

    /// Writes the observations of all robots into `rows` (R × D).
    pub fn observe(&self, rules: &Rules, rows: &mut [f32]) {
        if self.condition.well() {
            return rules.layout.write(self.scene(rules), rows);
        }
        self.sense(rules, rows);
        for (robot, row) in rows.chunks_exact_mut(rules.layout.width()).enumerate() {
            if let Some(held) = self.condition.held(robot) {
                row.copy_from_slice(held);
            }
            if self.condition.dark(robot) {
                rules.layout.darken(row);
            }
        }
    }

    /// Puts `levels` (one for each robot) in place of the scenario's faults until the episode ends.
    pub fn set_faults(&mut self, rules: &Rules, levels: &[Levels]) {
        let now = self.now();
        self.condition.set(levels, now);
        self.hold(rules);
    }

    /// Keeps what robots with frozen sensors see.
    pub fn hold(&mut self, rules: &Rules) {
        if self.condition.freezes() {
            let mut rows = vec![0.0; rules.team.len() * rules.layout.width()];
            self.sense(rules, &mut rows);
            self.condition.hold(&rows);
        }
    }

    /// What the robots' sensors take in now, of all robots (R × D).
    fn sense(&self, rules: &Rules, rows: &mut [f32]) {
        for (robot, row) in rows.chunks_exact_mut(rules.layout.width()).enumerate() {
            let senses = self.condition.senses(robot, self.now());
            rules.layout.write_through(self.scene(rules), robot, &senses, row);
        }
    }

    fn scene<'a>(&'a self, rules: &'a Rules) -> Scene<'a> {
        Scene {
            team: &rules.team,
            tasks: &rules.tasks,
            positions: &self.positions,
            velocities: &self.velocities,
            victims: &self.victims,
        }
    }

    fn now(&self) -> Moment {
        Moment { seed: self.seed, stream: self.stream, episode: self.episode, step: self.step }
    }
}

/// Refuses a scenario in whose arena things do not fit: some of 64 trial episodes is crowded.
///
/// # Errors
/// [`Error::Scenario`] that names what does not fit.
pub fn check_room(rules: &Rules) -> Result<()> {
    let mut world = World::new(rules, 0, 0);
    let Some(crowded) = (0..64).find_map(|episode| world.try_begin(rules, episode)) else {
        return Ok(());
    };
    let scenario = &rules.scenario;
    let (key, value, rule) = match crowded {
        Crowded::Obstacles => (
            "scenario.obstacles (their number)",
            scenario.obstacles.len().to_string(),
            "no room for them at random places without overlap; use fewer, smaller, or a wider arena",
        ),
        Crowded::Robots => (
            "scenario.robots (their number)",
            scenario.robots.len().to_string(),
            "no room for them without overlap; use fewer, smaller, or a wider arena",
        ),
        Crowded::Victims => (
            "scenario.spawn_clearance_m",
            scenario.spawn_clearance_m.to_string(),
            "no place is so far from all robots (and wall_clearance_m from obstacles); use a smaller one",
        ),
    };
    Err(Error::Scenario { key: key.into(), value, rule: rule.into() })
}
