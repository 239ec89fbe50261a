//! Communication: which robots hear which, and what they learn of victims from those that they hear.
//!
//! Each robot sends once a step, when everything is where it is in that step. What it sends reaches the robots
//! in range of it at that moment, unless it is lost on the way, and is heard some steps later.

use std::iter::zip;

use serde::{Deserialize, Serialize};

use crate::rng::Stream;
use crate::scenario::{Communication, Scenario, Share};
use crate::sight::{NEVER, Sight, View, later, note};
use crate::tasks::Victim;

/// How the robots of a scenario's team communicate.
#[derive(Debug, Clone)]
pub struct Radio {
    /// Square of how far a robot is heard, m².
    reach: f32,
    /// Steps from sending to hearing.
    delay: u32,
    /// The share of what is sent that does not arrive.
    loss: f64,
    /// Whether robots tell which victims they see.
    shares: bool,
    robots: usize,
    slots: usize,
}

/// What was sent and heard in a world.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Traffic {
    /// Whose messages reach each robot, as bits, by step of sending: a ring of the last steps (S × R).
    pub links: Vec<u64>,
    /// The slots of the victims that each robot saw when it sent, as bits, in the same ring; none where nothing
    /// is shared.
    pub sent: Vec<u32>,
    /// Whom each robot hears now, as bits.
    pub heard: Vec<u64>,
    /// The step at which somebody whom a robot heard saw the victim of each slot, the last one (R × V); none
    /// where nothing is shared.
    pub told: Vec<u32>,
}

impl Radio {
    /// That of a valid scenario; `None` where everybody hears everybody at once, and tells nothing.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let found = scenario.communication.filter(|one| one.limits() || one.share != Share::Nothing)?;
        Some(Self::of(&found, scenario))
    }

    /// One over which everybody hears everybody at once.
    #[must_use]
    pub(crate) fn open(scenario: &Scenario) -> Self {
        Self::of(&Communication::default(), scenario)
    }

    fn of(found: &Communication, scenario: &Scenario) -> Self {
        Self {
            reach: found.range_m.map_or(f32::INFINITY, |metres| (metres as f32) * (metres as f32)),
            delay: found.delay_steps,
            loss: found.loss,
            shares: found.share == Share::Victims,
            robots: scenario.robots.len(),
            slots: scenario.num_victims(),
        }
    }

    /// Steps in the ring of what is on its way.
    fn steps(&self) -> usize {
        self.delay as usize + 1
    }

    /// Where the numbers of a step begin in the ring.
    fn at(&self, step: u32) -> usize {
        (step as usize % self.steps()) * self.robots
    }

    /// Numbers kept for a world: of 64 bits, and of 32 bits.
    #[must_use]
    pub fn numbers(&self) -> (usize, usize) {
        let told = if self.shares { self.steps() * self.robots + self.robots * self.slots } else { 0 };
        ((self.steps() + 1) * self.robots, told)
    }

    /// What the episode starts with: nothing was sent, and nobody has heard anything.
    pub fn forget(&self, traffic: &mut Traffic) {
        let shared = usize::from(self.shares);
        refill(&mut traffic.links, self.steps() * self.robots, 0);
        refill(&mut traffic.sent, shared * self.steps() * self.robots, 0);
        refill(&mut traffic.heard, self.robots, 0);
        refill(&mut traffic.told, shared * self.robots * self.slots, NEVER);
    }

    /// Lets all robots send and hear at the present step. `sightings` are what they have seen, by `sight`, up to
    /// now. Losses are drawn from `stream`: those of a step depend on the step alone.
    ///
    /// A robot whose sensors repeat an older reading hears, but learns nothing. A second exchange in the same step,
    /// after somebody was moved, takes the place of the first.
    pub fn exchange(
        &self,
        view: &View,
        sight: Option<&Sight>,
        sightings: &[u32],
        stream: Stream,
        traffic: &mut Traffic,
    ) {
        let (sends, arrives) = (self.at(view.step), self.at(view.step + 1));
        let draws = u64::from(view.step) * (self.robots * self.robots) as u64;
        let mut stream = (self.loss > 0.0).then(|| stream.resume(draws));
        for own in 0..self.robots {
            traffic.links[sends + own] = self.links(own, view, stream.as_mut());
            if let Some(sight) = sight.filter(|_| self.shares) {
                let seen = sight.victims(own, sightings).iter().enumerate();
                let seen = seen.filter(|(_, last)| **last == view.step);
                traffic.sent[sends + own] = seen.fold(0, |slots, (slot, _)| slots | 1 << slot);
            }
        }
        let closed = view.absent | view.blind | view.deaf;
        for own in 0..self.robots {
            let hears = closed >> own & 1 == 0;
            traffic.heard[own] = if hears { traffic.links[arrives + own] } else { 0 };
            if self.shares {
                let from = (0..self.robots).filter(|other| traffic.heard[own] >> other & 1 == 1);
                let news = from.fold(0, |slots, other| slots | traffic.sent[arrives + other]);
                let told = &mut traffic.told[own * self.slots..][..self.slots];
                self.learn(news, view, view.held >> own & 1 == 1, told);
            }
        }
    }

    /// Those whose messages of this step reach a robot, as bits.
    fn links(&self, own: usize, view: &View, mut stream: Option<&mut Stream>) -> u64 {
        let mut links = 0;
        for other in 0..self.robots {
            let is_lost = stream.as_mut().is_some_and(|stream| f64::from(stream.unit()) < self.loss);
            let both = other != own && view.absent & (1 << own | 1 << other) == 0;
            let way = view.positions[other] - view.positions[own];
            links |= u64::from(both && !is_lost && way.norm_squared() <= self.reach) << other;
        }
        links
    }

    /// Notes the step of sending for the victims that are told of. What is told of a victim that has gone since
    /// then is void.
    fn learn(&self, news: u32, view: &View, is_held: bool, told: &mut [u32]) {
        let sent = view.step.checked_sub(self.delay);
        for (slot, (last, victim)) in zip(told, view.victims).enumerate() {
            if let Some(sent) = sent.filter(|_| !is_held) {
                note(news >> slot & 1 == 1, sent, last);
            }
            if victim.is_none_or(|victim| *last < victim.appeared_step) {
                *last = NEVER;
            }
        }
    }

    /// What robot `own` was told of the victim of each slot; nothing where nothing is shared.
    #[must_use]
    pub fn told<'a>(&self, own: usize, told: &'a [u32]) -> &'a [u32] {
        if self.shares { &told[own * self.slots..][..self.slots] } else { &[] }
    }

    /// Whether a robot is told right now, at a step, of a victim of which it was last told so.
    #[must_use]
    pub fn is_news(&self, told: u32, step: u32) -> bool {
        told != NEVER && told + self.delay == step
    }

    /// Puts what robots were told into when they last saw the victims.
    pub fn add_told(&self, sight: &Sight, traffic: &Traffic, sightings: &mut [u32]) {
        for own in (0..self.robots).filter(|_| self.shares) {
            let seen = sight.victims_mut(own, sightings);
            zip(seen, self.told(own, &traffic.told)).for_each(|(seen, told)| *seen = later(*seen, *told));
        }
    }

    /// Whether a world may have this traffic, as far as it tells without an exchange.
    #[must_use]
    pub fn may_be(&self, traffic: &Traffic, step: u32, victims: &[Option<Victim>]) -> bool {
        let (long, short) = self.numbers();
        let all = |count: usize| u64::MAX.checked_shr(64 - count as u32).unwrap_or(0);
        let shared = if self.shares { self.steps() * self.robots } else { 0 };
        let others = |index: usize| all(self.robots) & !(1 << (index % self.robots));
        let is_past = |index: usize| index / self.robots <= step as usize;
        let in_time = |last: u32, victim: &Option<Victim>| {
            let appeared = victim.map_or(NEVER, |victim| victim.appeared_step);
            last == NEVER || last >= appeared && step.checked_sub(self.delay).is_some_and(|sent| last <= sent)
        };
        traffic.links.len() + traffic.heard.len() == long
            && traffic.heard.len() == self.robots
            && traffic.sent.len() == shared
            && traffic.sent.len() + traffic.told.len() == short
            && traffic.links.iter().enumerate().all(|(index, links)| links & !others(index) == 0)
            && traffic.links.iter().enumerate().all(|(index, links)| is_past(index) || *links == 0)
            && traffic.sent.iter().all(|slots| u64::from(*slots) & !all(self.slots) == 0)
            && traffic.sent.iter().enumerate().all(|(index, slots)| is_past(index) || *slots == 0)
            && traffic
                .told
                .iter()
                .enumerate()
                .all(|(index, last)| in_time(*last, &victims[index % self.slots]))
    }
}

/// Gives a list so many equal values.
fn refill<T: Copy>(values: &mut Vec<T>, count: usize, value: T) {
    values.clear();
    values.resize(count, value);
}
