//! The faults of one world's team as they come and go: when each begins and ends, what is in effect,
//! and what that does to drives and senses. Its random numbers are its own, so that a fault moves
//! nothing else in the world; strikes and noise depend on seed, env, episode, step and robot alone, so
//! that two severities of a fault meet the same draws.

use std::iter::zip;

use serde::{Deserialize, Serialize};

use crate::fault::{HEALTHY, Kind, Levels};
use crate::geometry::Vec2;
use crate::observe::Senses;
use crate::rng::{Purpose, Stream};
use crate::rules::Rules;

/// Kinds whose value is the share of steps that they strike.
const STRIKING: [Kind; 4] = [Kind::FrozenSensor, Kind::Blackout, Kind::Unavailable, Kind::LostCommunication];
/// Words of random numbers that each robot has for itself in each step.
const WORDS_PER_ROBOT: u64 = 4;

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

/// Robots that are struck in this step, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
struct Struck {
    frozen: u64,
    dark: u64,
    unavailable: u64,
    deaf: u64,
}

/// The faults of one world's team.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Condition {
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
    struck: Struck,
    /// Rows that robots with frozen sensors see.
    held: Vec<(u8, Vec<f32>)>,
}

impl Condition {
    /// Starts an episode: the scenario's faults, drawn anew.
    pub fn begin(&mut self, rules: &Rules, now: Moment) {
        self.words = 0;
        self.set = false;
        self.next_change = 0;
        self.spans.clear();
        self.heal();
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
            self.strike(now);
        }
    }

    /// Puts `levels` (one for each robot) in place of the scenario's faults until the episode ends.
    pub fn set(&mut self, levels: &[Levels], now: Moment) {
        self.set = true;
        self.take(levels.to_vec(), now);
    }

    /// Whether nothing is wrong with anyone.
    #[must_use]
    pub fn well(&self) -> bool {
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
        self.struck.unavailable
    }

    /// What becomes of a command: the drive, and the share of the speed cap that is left.
    #[must_use]
    pub fn driven(&self, robot: usize, drive: Vec2) -> (Vec2, f32) {
        let Some(levels) = self.levels.get(robot) else { return (drive, 1.0) };
        let cap = levels[Kind::SpeedLimit as usize];
        if self.struck.unavailable >> robot & 1 == 1 {
            return (Vec2::zeros(), cap);
        }
        let bias = levels[Kind::HeadingBias as usize];
        let turned = if bias == 0.0 {
            drive
        } else {
            let (sin, cos) = bias.sin_cos();
            Vec2::new(cos * drive.x - sin * drive.y, sin * drive.x + cos * drive.y)
        };
        (turned * levels[Kind::MotorGain as usize], cap)
    }

    /// What is wrong with the senses of `robot`.
    #[must_use]
    pub fn senses(&self, robot: usize, now: Moment) -> Senses<'_> {
        let levels = self.levels(robot);
        let (far, fast) = (levels[Kind::PositionNoise as usize], levels[Kind::VelocityNoise as usize]);
        let mut senses = Senses {
            position_error: Vec2::zeros(),
            velocity_error: Vec2::zeros(),
            deaf: self.struck.deaf >> robot & 1 == 1,
            unavailable: self.struck.unavailable,
            levels: &self.levels,
        };
        if far > 0.0 || fast > 0.0 {
            let mut stream = now.stream(Purpose::SensorNoise, robot, self.levels.len());
            senses.position_error = normal(&mut stream) * far;
            senses.velocity_error = normal(&mut stream) * fast;
        }
        senses
    }

    /// Whether a robot sees nothing now.
    #[must_use]
    pub fn dark(&self, robot: usize) -> bool {
        self.struck.dark >> robot & 1 == 1
    }

    /// Whether some robot's sensors are frozen now or in some steps.
    #[must_use]
    pub fn freezes(&self) -> bool {
        self.levels.iter().any(freezing)
    }

    /// Takes the present rows (R × D) of frozen robots, but for those that go on seeing an older one.
    pub fn hold(&mut self, rows: &[f32]) {
        let Self { levels, held, struck, .. } = self;
        for (robot, row) in rows.chunks_exact(rows.len() / levels.len()).enumerate() {
            let known = held.iter().position(|(other, _)| usize::from(*other) == robot);
            match known {
                Some(index) if struck.frozen >> robot & 1 == 0 => held[index].1.copy_from_slice(row),
                None if freezing(&levels[robot]) => held.push((robot as u8, row.to_vec())),
                _ => {}
            }
        }
    }

    /// What a robot with frozen sensors sees.
    #[must_use]
    pub fn held(&self, robot: usize) -> Option<&[f32]> {
        let row = self.held.iter().find(|(other, _)| usize::from(*other) == robot)?;
        Some(&row.1)
    }

    /// Whether its numbers are of these rules' sizes, and numbers.
    #[must_use]
    pub fn fits(&self, rules: &Rules) -> bool {
        let robots = rules.team.len();
        let row = rules.layout.width();
        (self.levels.is_empty() || self.levels.len() == robots)
            && self.levels.iter().flatten().all(|level| level.is_finite())
            && self.spans.len() == rules.faults.len()
            && self.held.iter().all(|(robot, held)| usize::from(*robot) < robots && held.len() == row)
            && self.held.iter().flat_map(|(_, held)| held).all(|number| number.is_finite())
    }

    fn heal(&mut self) {
        self.levels.clear();
        self.held.clear();
        self.intermittent = false;
        self.struck = Struck::default();
    }

    /// When a fault begins that may begin at `earliest`, and when it ends.
    fn span(&mut self, earliest: u32, rate: Option<f32>, duration: u32, now: Moment) -> Span {
        let from = match rate {
            None => earliest,
            Some(rate) => {
                let mut stream =
                    Stream::new(now.seed, now.stream, now.episode, Purpose::FaultOnsets).resume(self.words);
                // The time to the first of events at this rate is exponential; a step holds its floor.
                let steps = -(1.0 - stream.unit()).ln() / rate;
                self.words = stream.words();
                earliest.saturating_add(steps as u32)
            }
        };
        Span { from, until: from.saturating_add(duration) }
    }

    /// Adds up the scenario's faults that are there now.
    fn change(&mut self, rules: &Rules, now: Moment) {
        let mut levels = vec![HEALTHY; rules.team.len()];
        self.next_change = u32::MAX;
        for (index, fault) in rules.faults.iter().enumerate() {
            if now.step >= self.spans[index].until && fault.rate.is_some() {
                // At least this step is without it.
                self.spans[index] = self.span(now.step + 1, fault.rate, fault.duration, now);
            }
            let span = self.spans[index];
            if now.step < span.from {
                self.next_change = self.next_change.min(span.from);
            } else if now.step < span.until {
                self.next_change = self.next_change.min(span.until);
                let level = &mut levels[fault.robot][fault.kind as usize];
                *level = fault.kind.combined(*level, fault.value);
            }
        }
        self.take(levels, now);
    }

    fn take(&mut self, levels: Vec<Levels>, now: Moment) {
        if levels.iter().all(|levels| *levels == HEALTHY) {
            self.heal();
            return;
        }
        let shares = levels.iter().flat_map(|levels| STRIKING.map(|kind| levels[kind as usize]));
        self.intermittent = shares.into_iter().any(|share| 0.0 < share && share < 1.0);
        self.held.retain(|(robot, _)| freezing(&levels[usize::from(*robot)]));
        self.levels = levels;
        self.strike(now);
    }

    /// Draws who is struck in this step.
    fn strike(&mut self, now: Moment) {
        let robots = self.levels.len();
        self.struck = Struck::default();
        for (robot, levels) in self.levels.iter().enumerate() {
            let share = STRIKING.map(|kind| levels[kind as usize]);
            let mut draws = [0.0; STRIKING.len()];
            if share.iter().any(|share| 0.0 < *share && *share < 1.0) {
                let mut stream = now.stream(Purpose::FaultStrikes, robot, robots);
                draws = draws.map(|_| stream.unit());
            }
            let Struck { frozen, dark, unavailable, deaf } = &mut self.struck;
            for (mask, (draw, share)) in [frozen, dark, unavailable, deaf].into_iter().zip(zip(draws, share))
            {
                *mask |= u64::from(draw < share) << robot;
            }
        }
    }
}

/// Whether sensors at these levels are frozen in all or some steps.
fn freezing(levels: &Levels) -> bool {
    levels[Kind::FrozenSensor as usize] > 0.0
}

/// Two independent standard normal numbers (Box & Muller 1958); always two words.
fn normal(stream: &mut Stream) -> Vec2 {
    let radius = (-2.0 * (1.0 - stream.unit()).ln()).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * stream.unit()).sin_cos();
    Vec2::new(radius * cos, radius * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Fault;
    use crate::scenario::Scenario;

    #[test]
    fn what_is_of_other_sizes_or_no_number_does_not_fit() {
        let frozen = Fault {
            robot: "food_1".into(),
            kind: Kind::FrozenSensor,
            value: 1.0,
            onset_step: 0,
            onset_rate_hz: None,
            duration_steps: None,
        };
        let rules = Rules::new(Scenario { faults: vec![frozen], ..Scenario::default() }).expect("a scenario");
        let mut good = Condition::default();
        good.begin(&rules, Moment { seed: 1, stream: 0, episode: 0, step: 0 });
        good.hold(&vec![0.5; rules.team.len() * rules.layout.width()]);
        assert!(good.fits(&rules));
        assert_eq!(good.held.len(), 1);
        let spoilt: [fn(&mut Condition); 7] = [
            |condition| condition.levels.truncate(3),
            |condition| condition.levels[2][0] = f32::NAN,
            |condition| condition.spans.clear(),
            |condition| condition.spans.push(condition.spans[0]),
            |condition| condition.held[0].0 = 4,
            |condition| condition.held[0].1.truncate(5),
            |condition| condition.held[0].1[3] = f32::INFINITY,
        ];
        for (number, spoil) in spoilt.into_iter().enumerate() {
            let mut condition = good.clone();
            spoil(&mut condition);
            assert!(!condition.fits(&rules), "{number}");
        }
    }
}
