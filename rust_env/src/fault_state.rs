//! The faults of one world's team as they come and go: when each begins and ends, what is in effect,
//! and what that does to drives and senses. Its random numbers are its own, so that a fault moves
//! nothing else in the world; strikes and noise depend on seed, env, episode, step and robot alone, so
//! that two severities of a fault meet the same draws.

mod validity;

use serde::{Deserialize, Serialize};

use crate::fault::{Drive, Effect, HEALTHY, Kind, Levels, NUM_KINDS, SPECS};
use crate::geometry::Vec2;
use crate::observe::Senses;
use crate::rng::{Purpose, Stream};
use crate::rules::Rules;

/// For each kind, how many of those before it strike: its number among them, if it does.
const STRIKES_BEFORE: [usize; NUM_KINDS] = {
    let mut before = [0; NUM_KINDS];
    let mut kind = 1;
    while kind < NUM_KINDS {
        before[kind] = before[kind - 1] + matches!(SPECS[kind - 1].effect, Effect::Strike) as usize;
        kind += 1;
    }
    before
};
/// Number of kinds that strike in a share of the control steps.
const NUM_STRIKES: usize =
    STRIKES_BEFORE[NUM_KINDS - 1] + matches!(SPECS[NUM_KINDS - 1].effect, Effect::Strike) as usize;
/// Words of random numbers for an error of position and one of velocity, of two axes each.
const ERROR_WORDS: usize = 4;
/// Words of random numbers that each robot has for itself in each step.
const WORDS_PER_ROBOT: u64 = if NUM_STRIKES > ERROR_WORDS { NUM_STRIKES as u64 } else { ERROR_WORDS as u64 };

/// The moment that strikes and noise are drawn for.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Seed of the world.
    pub seed: u64,
    /// Number of the world's streams.
    pub stream: u64,
    /// Its episode.
    pub episode: u64,
    /// Steps done in it.
    pub step: u32,
}

impl Moment {
    fn stream(self, purpose: Purpose, robot: usize, robots: usize) -> Stream {
        let row = u64::from(self.step) * robots as u64 + robot as u64;
        Stream::new(self.seed, self.stream, self.episode, purpose).resume(row * WORDS_PER_ROBOT)
    }
}

/// Control steps from one in which a fault is there to one in which it is not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Span {
    from: u32,
    until: u32,
}

/// The faults of one world's team.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FaultState {
    /// Words drawn from the stream of onsets.
    words: u64,
    /// Step at which the scenario's faults begin or end next.
    next_change: u32,
    /// One for each of the scenario's faults.
    spans: Vec<Span>,
    /// Whether the caller's faults are in place of the scenario's until the episode ends.
    set: bool,
    /// What is in effect, one for each robot; none while all are healthy.
    levels: Vec<Levels>,
    /// Whether some robot is struck in some steps only.
    intermittent: bool,
    /// Robots that are struck in this step, as bits, for each kind that strikes.
    struck: [u64; NUM_STRIKES],
    /// Rows that robots with frozen sensors see.
    frozen: Vec<(u8, Vec<f32>)>,
}

impl FaultState {
    /// Memory of the faults in effect in a world where all are faulty, bytes.
    #[must_use]
    pub fn most_bytes(robots: usize, width: usize) -> usize {
        robots * (size_of::<Levels>() + size_of::<(u8, Vec<f32>)>() + 16 + width * size_of::<f32>())
    }

    /// Starts an episode: the scenario's faults, drawn anew.
    pub fn begin(&mut self, rules: &Rules, now: Moment) {
        self.words = 0;
        self.set = false;
        self.next_change = 0;
        self.spans.clear();
        self.clear();
        if rules.faults.is_empty() {
            self.next_change = u32::MAX;
            return;
        }
        for fault in &rules.faults {
            let span = self.span(fault.onset, fault.rate, fault.duration, now);
            self.spans.push(span);
        }
        self.update(rules, now);
    }

    /// Brings the faults to the present step.
    pub fn update(&mut self, rules: &Rules, now: Moment) {
        if now.step >= self.next_change && !self.set {
            self.change(rules, now);
        }
        if self.intermittent {
            self.sample(now);
        }
    }

    /// Puts `levels` (one for each robot) in place of the scenario's faults until the episode ends.
    pub fn set(&mut self, levels: &[Levels], now: Moment) {
        self.set = true;
        self.put(levels.to_vec(), now);
    }

    /// Whether nothing is wrong with anyone.
    #[must_use]
    pub fn is_healthy(&self) -> bool {
        self.levels.is_empty()
    }

    /// What is in effect for a robot.
    #[must_use]
    pub fn levels(&self, robot: usize) -> Levels {
        self.levels.get(robot).copied().unwrap_or(HEALTHY)
    }

    /// Robots that neither drive nor help now, as bits.
    #[must_use]
    pub fn unavailable(&self) -> u64 {
        self.struck(Kind::Unavailable)
    }

    /// Whether a fault of a kind that strikes strikes this robot now.
    #[must_use]
    pub fn is_struck(&self, kind: Kind, robot: usize) -> bool {
        self.struck(kind) >> robot & 1 == 1
    }

    /// What becomes of a command: the drive, and the share of the speed cap that is left.
    #[must_use]
    pub fn drive(&self, robot: usize, command: Vec2) -> (Vec2, f32) {
        let Some(levels) = self.levels.get(robot) else { return (command, 1.0) };
        let drive = drive_at(levels);
        if self.is_struck(Kind::Unavailable, robot) {
            return (Vec2::zeros(), drive.speed);
        }
        let turned = if drive.turn == 0.0 {
            command
        } else {
            let (sin, cos) = libm::sincosf(drive.turn);
            Vec2::new(cos * command.x - sin * command.y, sin * command.x + cos * command.y)
        };
        (turned * drive.force, drive.speed)
    }

    /// What is left of a robot's drive, whether it is available or not.
    #[must_use]
    pub fn drive_left(&self, robot: usize) -> Drive {
        self.levels.get(robot).map_or_else(Drive::default, drive_at)
    }

    /// What is wrong with the senses of `robot`.
    #[must_use]
    pub fn senses(&self, robot: usize, now: Moment, absent: u64) -> Senses<'_> {
        let levels = self.levels(robot);
        let (far, fast) = (levels[Kind::PositionNoise as usize], levels[Kind::VelocityNoise as usize]);
        let mut senses = Senses {
            position_error: Vec2::zeros(),
            velocity_error: Vec2::zeros(),
            deaf: self.is_struck(Kind::LostCommunication, robot),
            unavailable: self.unavailable(),
            absent,
            levels: &self.levels,
        };
        if far > 0.0 || fast > 0.0 {
            let mut stream = now.stream(Purpose::SensorNoise, robot, self.levels.len());
            senses.position_error = normal(&mut stream) * far;
            senses.velocity_error = normal(&mut stream) * fast;
        }
        senses
    }

    /// Whether some robot's sensors are frozen now or in some steps.
    #[must_use]
    pub fn has_frozen_sensors(&self) -> bool {
        self.levels.iter().any(freezing)
    }

    /// Keeps the present rows (R × D) of frozen robots, but for those that go on seeing an older one.
    pub fn freeze(&mut self, rows: &[f32]) {
        let struck = self.struck(Kind::FrozenSensor);
        let Self { levels, frozen, .. } = self;
        for (robot, row) in rows.chunks_exact(rows.len() / levels.len()).enumerate() {
            let known = frozen.iter().position(|(other, _)| usize::from(*other) == robot);
            match known {
                Some(index) if struck >> robot & 1 == 0 => frozen[index].1.copy_from_slice(row),
                None if freezing(&levels[robot]) => frozen.push((robot as u8, row.to_vec())),
                _ => {}
            }
        }
    }

    /// What a robot with frozen sensors sees.
    #[must_use]
    pub fn frozen_row(&self, robot: usize) -> Option<&[f32]> {
        let row = self.frozen.iter().find(|(other, _)| usize::from(*other) == robot)?;
        Some(&row.1)
    }

    /// Puts a level there as somebody might who forges an image.
    #[cfg(test)]
    pub fn forge_level(&mut self, robot: usize, kind: usize, level: f32) {
        self.levels = vec![HEALTHY; 4];
        self.levels[robot][kind] = level;
    }

    /// Makes everyone healthy.
    fn clear(&mut self) {
        self.levels.clear();
        self.frozen.clear();
        self.intermittent = false;
        self.struck = [0; NUM_STRIKES];
    }

    /// Robots that see nothing now, as bits: those in a blackout, but for those whose sensors take a reading that
    /// they will repeat after it.
    #[must_use]
    pub fn blind(&self) -> u64 {
        let each = self.levels.iter().enumerate().filter(|(_, levels)| freezing(levels));
        let frozen = each.fold(0, |robots, (robot, _)| robots | 1 << robot);
        self.struck(Kind::Blackout) & !frozen
    }

    /// Robots whose sensors repeat an older reading now, as bits.
    #[must_use]
    pub fn held(&self) -> u64 {
        let kept = self.frozen.iter().fold(0, |robots, (robot, _)| robots | 1 << robot);
        kept & self.struck(Kind::FrozenSensor)
    }

    /// Robots that a fault of this kind, one that strikes, strikes now, as bits.
    #[must_use]
    pub fn struck(&self, kind: Kind) -> u64 {
        debug_assert!(matches!(kind.spec().effect, Effect::Strike), "{}", kind.name());
        self.struck[STRIKES_BEFORE[kind as usize]]
    }

    /// When a fault begins that may begin at `earliest`, and when it ends.
    fn span(&mut self, earliest: u32, rate: Option<f32>, duration: u32, now: Moment) -> Span {
        let from = match rate {
            None => earliest,
            Some(rate) => {
                let mut stream =
                    Stream::new(now.seed, now.stream, now.episode, Purpose::FaultOnsets).resume(self.words);
                // The time to the first of events at this rate is exponential; a step holds its floor.
                let steps = -libm::logf(1.0 - stream.unit()) / rate;
                self.words = stream.words();
                earliest.saturating_add(steps as u32)
            }
        };
        Span { from, until: from.saturating_add(duration) }
    }

    /// Puts the scenario's faults into effect that are there now.
    fn change(&mut self, rules: &Rules, now: Moment) {
        for (index, fault) in rules.faults.iter().enumerate() {
            if now.step >= self.spans[index].until && fault.rate.is_some() {
                // At least this step is without it.
                self.spans[index] = self.span(now.step + 1, fault.rate, fault.duration, now);
            }
        }
        let (levels, next_change) = self.present(rules, now.step);
        self.next_change = next_change;
        self.put(levels, now);
    }

    /// What the scenario's faults that are there at a step add up to, and the step at which one of them
    /// begins or ends next.
    fn present(&self, rules: &Rules, step: u32) -> (Vec<Levels>, u32) {
        let mut levels = vec![HEALTHY; rules.team.len()];
        let mut next_change = u32::MAX;
        for (fault, span) in rules.faults.iter().zip(&self.spans) {
            if step < span.from {
                next_change = next_change.min(span.from);
            } else if step < span.until {
                next_change = next_change.min(span.until);
                let level = &mut levels[fault.robot][fault.kind as usize];
                *level = (fault.kind.spec().combine)(*level, fault.value);
            }
        }
        (levels, next_change)
    }

    /// Puts levels into effect, one for each robot.
    fn put(&mut self, levels: Vec<Levels>, now: Moment) {
        if levels.iter().all(|levels| *levels == HEALTHY) {
            self.clear();
            return;
        }
        self.intermittent = levels.iter().any(strikes_sometimes);
        self.frozen.retain(|(robot, _)| freezing(&levels[usize::from(*robot)]));
        self.levels = levels;
        self.sample(now);
    }

    /// Draws who is struck in this step.
    fn sample(&mut self, now: Moment) {
        let robots = self.levels.len();
        self.struck = [0; NUM_STRIKES];
        for (robot, levels) in self.levels.iter().enumerate() {
            let mut draws = [0.0; NUM_STRIKES];
            if strikes_sometimes(levels) {
                let mut stream = now.stream(Purpose::FaultStrikes, robot, robots);
                draws = draws.map(|_| stream.unit());
            }
            for ((struck, draw), share) in self.struck.iter_mut().zip(draws).zip(shares(levels)) {
                *struck |= u64::from(draw < share) << robot;
            }
        }
    }
}

/// What levels leave of a drive.
fn drive_at(levels: &Levels) -> Drive {
    let mut drive = Drive::default();
    for (spec, level) in SPECS.iter().zip(levels) {
        if let Effect::Drive(change) = spec.effect {
            change(&mut drive, *level);
        }
    }
    drive
}

/// The shares of steps that a robot's faults strike, by kind that strikes.
fn shares(levels: &Levels) -> impl Iterator<Item = f32> {
    let strikes = SPECS.iter().zip(levels).filter(|(spec, _)| matches!(spec.effect, Effect::Strike));
    strikes.map(|(_, share)| *share)
}

/// Whether some fault of a robot strikes in some steps only.
fn strikes_sometimes(levels: &Levels) -> bool {
    shares(levels).any(|share| 0.0 < share && share < 1.0)
}

/// Whether sensors at these levels are frozen in all or some steps.
fn freezing(levels: &Levels) -> bool {
    levels[Kind::FrozenSensor as usize] > 0.0
}

/// Two independent standard normal numbers (Box & Muller 1958); always two words.
///
/// As everywhere in the worlds, logarithm and sine are those of `libm`: those of the system differ in
/// the last bits from one system to another.
fn normal(stream: &mut Stream) -> Vec2 {
    let radius = (-2.0 * libm::logf(1.0 - stream.unit())).sqrt();
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * stream.unit());
    Vec2::new(radius * cos, radius * sin)
}
