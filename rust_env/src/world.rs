//! One world: how an episode begins and what a step does. Its state is plain numbers.

mod victims;

use std::iter::repeat_n;

use serde::{Deserialize, Serialize};

use crate::fault::{Kind, Levels};
use crate::fault_state::{FaultState, Moment};
use crate::geometry::Vec2;
use crate::observe::Scene;
use crate::physics::Workspace;
use crate::place::DRAWS;
use crate::radio::{Radio, Traffic};
use crate::reward::{self, Happened, total_distance};
use crate::rng::{Purpose, Stream};
use crate::robot::Commands;
use crate::rules::Rules;
use crate::scenario::{MAX_ROBOTS, Shaping, Unavailable};
use crate::sight::{Sight, View};
use crate::tasks::{Events, Victim};
use crate::wheels::{Heading, Wheels};

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
    /// Whether the episode is over (never seen with autoreset in the same step).
    pub over: bool,
    /// Whether there was neither a reset nor a step yet: the first reset then keeps episode 0.
    pub fresh: bool,
    /// Victims rescued in this episode.
    pub rescued: u32,
    /// Victims lost in this episode. Images have it apart, where a scenario has deadlines.
    #[serde(skip)]
    pub lost: u32,
    /// Victims that appeared in this episode.
    pub appeared: u32,
    /// Words drawn from the victims' stream.
    pub victim_words: u64,
    /// Places of the robots, m.
    pub positions: Vec<Vec2>,
    /// Velocities of the robots, m/s.
    pub velocities: Vec<Vec2>,
    /// Where robots on wheels point; none where no robot has any. Images have them apart.
    #[serde(skip)]
    pub headings: Vec<Heading>,
    /// Charges of the robots, J; none where no robot has a battery. Images have them apart.
    #[serde(skip)]
    pub charges: Vec<f64>,
    /// Loads of the robots; none where no robot has one. Images have them apart.
    #[serde(skip)]
    pub loads: Vec<u32>,
    /// When robots last saw each other and the victims, see [`crate::sight::Sight::look`]; none where all see
    /// everything. Images have them apart.
    #[serde(skip)]
    pub sightings: Vec<u32>,
    /// What was sent and heard; nothing where everybody hears everybody. Images have it apart.
    #[serde(skip)]
    pub traffic: Traffic,
    /// Places of the obstacles, m.
    pub obstacles: Vec<Vec2>,
    /// Victims by slot.
    pub victims: Vec<Option<Victim>>,
    /// What is wrong with the robots.
    pub faults: FaultState,
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
            lost: 0,
            appeared: 0,
            victim_words: 0,
            positions: vec![Vec2::zeros(); rules.team.len()],
            velocities: vec![Vec2::zeros(); rules.team.len()],
            headings: vec![],
            charges: vec![],
            loads: vec![],
            sightings: vec![],
            traffic: Traffic::default(),
            obstacles: vec![Vec2::zeros(); rules.solids.len()],
            victims: vec![None; rules.scenario.num_victims()],
            faults: FaultState::default(),
        };
        world.begin(rules, 0);
        world
    }

    /// About the most memory that a world takes, bytes; its faults only if the scenario has some.
    #[must_use]
    pub fn most_bytes(rules: &Rules) -> usize {
        let (robots, faults) = (rules.team.len(), rules.faults.len());
        let places = (2 * robots + rules.solids.len()) * size_of::<Vec2>();
        let victims = rules.scenario.num_victims() * size_of::<Option<Victim>>();
        let struck = if faults == 0 { 0 } else { FaultState::most_bytes(robots, rules.layout.width()) };
        let headings = if rules.wheels.is_some() { robots * size_of::<Heading>() } else { 0 };
        let charges = if rules.energy.is_some() { robots * size_of::<f64>() } else { 0 };
        let loads = if rules.supplies.is_some() { robots * size_of::<u32>() } else { 0 };
        let sightings = rules.sight.as_ref().map_or(0, |sight| sight.numbers() * size_of::<u32>());
        let traffic = rules.radio.as_ref().map_or((0, 0), Radio::numbers);
        let traffic = traffic.0 * size_of::<u64>() + traffic.1 * size_of::<u32>();
        // Allocators round up, and keep a little beside each list.
        size_of::<Self>()
            + (places + victims + struck + headings + charges + loads + sightings + traffic + 8 * faults) * 9
                / 8
            + 13 * 16
    }

    /// Starts `episode`: places everything anew from that episode's streams.
    pub fn begin(&mut self, rules: &Rules, episode: u64) {
        self.episode = episode;
        self.step = 0;
        self.over = false;
        self.rescued = 0;
        self.lost = 0;
        self.appeared = 0;
        self.victim_words = 0;
        self.victims.fill(None);
        self.velocities.fill(Vec2::zeros());
        if let Some(energy) = &rules.energy {
            energy.fill(&mut self.charges);
        }
        if let Some(supplies) = &rules.supplies {
            supplies.fill(&mut self.loads);
        }
        if let Some(sight) = &rules.sight {
            sight.forget(&mut self.sightings);
        }
        if let Some(radio) = &rules.radio {
            radio.forget(&mut self.traffic);
        }
        if let Some(wheels) = &rules.wheels {
            let mut stream = Stream::new(self.seed, self.stream, episode, Purpose::Headings);
            wheels.point(&mut stream, &mut self.headings);
        }
        let mut stream = Stream::new(self.seed, self.stream, episode, Purpose::Start);
        rules.spawn.place_start(&mut stream, &mut self.obstacles, &mut self.positions);
        let now = self.now();
        self.faults.begin(rules, now);
        self.fill_slots(rules, self.absent(rules));
        self.perceive(rules);
    }

    /// Does one control step of world number `env` of a batch, whose `commands` are E × R. Adds what becomes
    /// of victims to `events`; `components` is R × C and `reward` R.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        rules: &Rules,
        workspace: &mut Workspace,
        commands: Commands,
        env: usize,
        events: &mut Events,
        components: &mut [f32],
        reward: &mut [f32],
    ) -> Ending {
        let shaping = rules.weights.shaping;
        let (away, unable, absent) = (self.away(rules), self.unable(rules), self.absent(rules));
        let distance_before = if shaping == Shaping::None { 0.0 } else { self.distance(rules, unable) };
        let rolling = rules.wheels.as_ref().map(|wheels| (wheels, copied(&self.velocities)));
        let mut effort = [0.0; MAX_ROBOTS];
        for (robot, body) in rules.team.iter().enumerate() {
            let is_away = away >> robot & 1 == 1;
            let given = commands.drive(env * rules.team.len() + robot);
            let drive = if is_away { Vec2::zeros() } else { given };
            effort[robot] = drive.norm_squared();
            let (drive, cap) = self.faults.drive(robot, drive);
            self.velocities[robot] = body.driven(self.velocities[robot], drive, cap);
        }
        if let Some((wheels, velocities)) = &rolling {
            self.roll(wheels, velocities, commands, env * rules.team.len(), away, &mut effort);
        }
        let before = rules.energy.as_ref().map(|_| copied(&self.positions));
        let touched = rules.physics.advance(
            workspace,
            &mut self.positions,
            &mut self.velocities,
            &self.obstacles,
            absent,
        );
        if let (Some(energy), Some(before)) = (&rules.energy, &before) {
            energy.account(before, &self.positions, absent, &mut self.charges);
        }
        let mut distance_after =
            if shaping == Shaping::Progress { self.distance(rules, unable) } else { 0.0 };

        let earlier = (events.rescues.len(), events.losses.len());
        self.settle(rules, env, &mut events.rescues);
        if let Some(supplies) = &rules.supplies {
            supplies.refill(&self.positions, absent, &mut self.loads);
        }
        if rules.deadlines.is_some() {
            self.lose(env, &mut events.losses);
        }
        self.step += 1;
        self.fresh = false;
        let turned_away = self.fill_slots(rules, absent);
        events.turned_away.extend(repeat_n(env as u32, turned_away));
        let now = self.now();
        self.faults.update(rules, now);
        self.come_and_go(rules, absent);
        self.perceive(rules);
        let ending = Ending {
            terminated: self.goal_is_reached(rules),
            truncated: self.step >= rules.scenario.episode_steps,
        };
        self.over = ending.over();
        if shaping == Shaping::Potential && !ending.terminated {
            distance_after = self.distance(rules, self.unable(rules));
        }
        let happened = Happened {
            rescues: &events.rescues[earlier.0..],
            losses: &events.losses[earlier.1..],
            distance_before,
            distance_after,
            touched,
            effort: &effort,
        };
        reward::write(&rules.weights, &happened, components, reward);
        ending
    }

    /// Gives robots on wheels the velocities and headings of this step, from their `velocities` before it. Their
    /// actions begin at number `first` of the commands.
    #[inline(never)]
    fn roll(
        &mut self,
        wheels: &Wheels,
        velocities: &[Vec2],
        commands: Commands,
        first: usize,
        away: u64,
        effort: &mut [f32],
    ) {
        for robot in wheels.robots() {
            let is_away = away >> robot & 1 == 1;
            let shares = if is_away { Vec2::zeros() } else { wheels.shares(robot, commands, first + robot) };
            effort[robot] = shares.norm_squared();
            let left = self.faults.drive_left(robot);
            (self.velocities[robot], self.headings[robot]) =
                wheels.driven(robot, self.headings[robot], velocities[robot], shares, left);
        }
    }

    /// Robots that neither drive nor help now, as bits: unavailable ones, and those whose battery is empty.
    #[must_use]
    pub fn away(&self, rules: &Rules) -> u64 {
        let empty = rules.energy.as_ref().map_or(0, |energy| energy.empty(&self.charges));
        self.faults.unavailable() | empty
    }

    /// Robots that do not help now, as bits: those that are away, and those whose load is used up.
    fn unable(&self, rules: &Rules) -> u64 {
        let used_up = rules.supplies.as_ref().map_or(0, |supplies| supplies.used_up(&self.loads));
        self.away(rules) | used_up
    }

    /// Distance of victims from the robots that are not `unable` to help, as rewards count it, m.
    fn distance(&self, rules: &Rules, unable: u64) -> f32 {
        total_distance(self.victims.iter().flatten(), &rules.tasks, &rules.team, &self.positions, unable)
    }

    /// Writes the observations of all robots into `rows` (R × D).
    pub fn observe(&self, rules: &Rules, rows: &mut [f32]) {
        if self.faults.is_healthy() {
            return rules.layout.write(self.scene(rules), rows);
        }
        self.sense(rules, rows);
        for (robot, row) in rows.chunks_exact_mut(rules.layout.width()).enumerate() {
            if let Some(held) = self.faults.frozen_row(robot) {
                row.copy_from_slice(held);
            }
            if self.faults.is_struck(Kind::Blackout, robot) {
                rules.layout.darken(row);
            }
        }
    }

    /// Puts `levels` (one for each robot) in place of the scenario's faults until the episode ends.
    pub fn set_faults(&mut self, rules: &Rules, levels: &[Levels]) {
        let (now, absent) = (self.now(), self.absent(rules));
        self.faults.set(levels, now);
        self.come_and_go(rules, absent);
        self.perceive(rules);
    }

    /// Robots that have left the arena, as bits.
    #[must_use]
    pub fn absent(&self, rules: &Rules) -> u64 {
        match rules.scenario.unavailable_robots {
            Unavailable::Stay => 0,
            Unavailable::Leave => self.faults.unavailable(),
        }
    }

    /// Stops the robots that leave, and places those that come back: each one's draws depend on the step and
    /// on the robot alone.
    fn come_and_go(&mut self, rules: &Rules, before: u64) {
        let absent = self.absent(rules);
        if before | absent == 0 {
            return;
        }
        let robots = self.positions.len();
        for robot in (0..robots).filter(|robot| (before | absent) >> robot & 1 == 1) {
            self.velocities[robot] = Vec2::zeros();
            if let Some(heading) = self.headings.get_mut(robot) {
                heading.turn_rate = 0.0;
            }
        }
        let mut elsewhere = before | absent;
        for robot in (0..robots).filter(|robot| (before & !absent) >> robot & 1 == 1) {
            let row = u64::from(self.step) * robots as u64 + robot as u64;
            let stream = Stream::new(self.seed, self.stream, self.episode, Purpose::Returns);
            let mut stream = stream.resume(row * 2 * DRAWS as u64);
            rules.spawn.place_back(&mut stream, robot, elsewhere, &self.obstacles, &mut self.positions);
            elsewhere &= !(1 << robot);
        }
    }

    /// Notes what robots see, and keeps the readings of frozen sensors: once everything is where it is in this
    /// step, and again if somebody has moved it.
    #[inline]
    pub fn perceive(&mut self, rules: &Rules) {
        if let Some(sight) = &rules.sight {
            self.look(rules, sight);
        }
        if let Some(radio) = &rules.radio {
            self.hear(rules, radio);
        }
        self.freeze(rules);
    }

    /// Notes what robots see at the present step.
    #[inline(never)]
    fn look(&mut self, rules: &Rules, sight: &Sight) {
        let mut sightings = std::mem::take(&mut self.sightings);
        sight.look(&self.view(rules), &mut sightings);
        self.sightings = sightings;
    }

    /// Lets robots send and hear at the present step.
    #[inline(never)]
    fn hear(&mut self, rules: &Rules, radio: &Radio) {
        let mut traffic = std::mem::take(&mut self.traffic);
        self.exchange(rules, radio, &mut traffic);
        self.traffic = traffic;
    }

    /// What robots send and hear at the present step, in the traffic of the step before.
    fn exchange(&self, rules: &Rules, radio: &Radio, traffic: &mut Traffic) {
        let stream = Stream::new(self.seed, self.stream, self.episode, Purpose::Losses);
        radio.exchange(&self.view(rules), rules.sight.as_ref(), &self.sightings, stream, traffic);
    }

    /// What there is to see, and whose senses fail.
    fn view(&self, rules: &Rules) -> View<'_> {
        View {
            positions: &self.positions,
            headings: &self.headings,
            obstacles: &self.obstacles,
            victims: &self.victims,
            step: self.step,
            absent: self.absent(rules),
            blind: self.faults.blind(),
            deaf: self.faults.struck(Kind::LostCommunication),
            held: self.faults.held(),
        }
    }

    /// Whom each robot hears now, as bits.
    #[must_use]
    pub fn heard(&self, rules: &Rules) -> Vec<u64> {
        if rules.radio.is_some() {
            return self.traffic.heard.clone();
        }
        let (open, mut traffic) = (Radio::open(&rules.scenario), Traffic::default());
        open.forget(&mut traffic);
        self.exchange(rules, &open, &mut traffic);
        traffic.heard
    }

    /// When robots last saw each other and the victims, or were told of them; none where all see everything.
    #[must_use]
    pub fn last_seen(&self, rules: &Rules) -> Vec<u32> {
        let mut last = self.sightings.clone();
        if let (Some(sight), Some(radio)) = (&rules.sight, &rules.radio) {
            radio.add_told(sight, &self.traffic, &mut last);
        }
        last
    }

    /// Whether robots of an otherwise valid world may have seen things when it says that they did.
    #[must_use]
    pub fn sightings_fit(&self, rules: &Rules) -> bool {
        let Some(sight) = &rules.sight else { return true };
        sight.may_be(&self.sightings, self.step, &self.victims) && {
            let mut again = self.clone();
            again.look(rules, sight);
            again.sightings == self.sightings
        }
    }

    /// Whether an otherwise valid world may have its traffic.
    #[must_use]
    pub fn traffic_fits(&self, rules: &Rules) -> bool {
        let Some(radio) = &rules.radio else { return true };
        radio.may_be(&self.traffic, self.step, &self.victims) && {
            let mut again = self.traffic.clone();
            self.exchange(rules, radio, &mut again);
            again == self.traffic
        }
    }

    /// Keeps what robots with frozen sensors see.
    fn freeze(&mut self, rules: &Rules) {
        if self.faults.has_frozen_sensors() {
            let mut rows = vec![0.0; rules.team.len() * rules.layout.width()];
            self.sense(rules, &mut rows);
            self.faults.freeze(&rows);
        }
    }

    /// What the robots' sensors take in now, of all robots (R × D).
    fn sense(&self, rules: &Rules, rows: &mut [f32]) {
        for (robot, row) in rows.chunks_exact_mut(rules.layout.width()).enumerate() {
            let senses = self.faults.senses(robot, self.now(), self.absent(rules));
            rules.layout.write_through(self.scene(rules), robot, &senses, row);
        }
    }

    fn scene<'a>(&'a self, rules: &'a Rules) -> Scene<'a> {
        Scene {
            team: &rules.team,
            tasks: &rules.tasks,
            positions: &self.positions,
            velocities: &self.velocities,
            headings: &self.headings,
            charges: &self.charges,
            loads: &self.loads,
            obstacles: &self.obstacles,
            victims: &self.victims,
            sightings: &self.sightings,
            heard: &self.traffic.heard,
            told: &self.traffic.told,
            step: self.step,
        }
    }

    /// The moment that its strikes and noise are drawn for.
    #[must_use]
    pub fn now(&self) -> Moment {
        Moment { seed: self.seed, stream: self.stream, episode: self.episode, step: self.step }
    }
}

/// The vectors of all robots, as they are now.
fn copied(vectors: &[Vec2]) -> [Vec2; MAX_ROBOTS] {
    let mut copy = [Vec2::zeros(); MAX_ROBOTS];
    copy[..vectors.len()].copy_from_slice(vectors);
    copy
}
