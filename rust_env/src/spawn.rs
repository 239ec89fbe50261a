//! What appears where: obstacles and robots when an episode starts, victims when the situation wants them.
//! Everything is drawn from the streams given, in a fixed order.

use std::ops::RangeInclusive;

use crate::geometry::{Solid, Vec2};
use crate::place::{DRAWS, Placed, Placing};
use crate::rng::{Purpose, Stream};
use crate::robot::Body;
use crate::scenario::{Engine, Scenario, Situation};
use crate::tasks::Victim;
use crate::tasks::arrivals::Due;

/// How often everything is drawn for one start. A scenario in which a draw fails more often than about once in
/// twenty is refused, see [`Spawn::find_crowding`]; so 64 draws fail in none of 10^80 starts.
const START_TRIES: usize = 64;
/// Episodes that are tried before a scenario is found to have room for everything.
const TRIALS: u64 = 64;

/// What had to be placed too near to something else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crowded {
    /// Obstacles at random places.
    Obstacles,
    /// Robots.
    Robots,
    /// Victims of a task.
    Victims(usize),
}

/// Everything about appearing that a scenario fixes.
#[derive(Debug, Clone)]
pub struct Spawn {
    placing: Placing,
    team: Vec<Body>,
    solids: Vec<Solid>,
    /// Layers that each obstacle blocks, as bits.
    blocked: Vec<u64>,
    /// Given places of the obstacles, m; none for those that stand elsewhere in each episode.
    given: Vec<Option<Vec2>>,
    /// Given places of the robots when an episode starts, m; none for those that start elsewhere each time.
    starts: Vec<Option<Vec2>>,
    situation: Situation,
    num_tasks: usize,
    num_slots: usize,
    /// Slots of each task where victims arrive.
    slots_per_task: usize,
    /// Whether robots pass through each other, so that they may start at the same place.
    passing: bool,
}

impl Spawn {
    /// What appears in the worlds of a valid scenario.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario, team: &[Body], solids: &[Solid]) -> Self {
        let given = |place: [f64; 2]| Vec2::new(place[0] as f32, place[1] as f32);
        Self {
            placing: Placing::new(scenario),
            team: team.to_vec(),
            solids: solids.to_vec(),
            blocked: scenario.blocked(),
            given: scenario.obstacles.iter().map(|obstacle| obstacle.position_m.map(given)).collect(),
            starts: scenario.robots.iter().map(|robot| robot.start_m.map(given)).collect(),
            situation: scenario.situation,
            num_tasks: scenario.tasks.len(),
            num_slots: scenario.num_victims(),
            slots_per_task: scenario.max_victims,
            passing: scenario.engine == Engine::None,
        }
    }

    /// Writes the obstacles' places, those given first. Returns whether all are clear of each other.
    pub fn place_obstacles(&self, stream: &mut Stream, obstacles: &mut [Vec2]) -> bool {
        let mut clear = true;
        let given = self.solids.iter().zip(&self.given);
        let mut placed: Vec<Placed> = Vec::with_capacity(self.solids.len());
        placed.extend(given.filter_map(|(solid, at)| at.map(|at| (solid, at))));
        let starts = self.team.iter().zip(&self.starts);
        let starts: Vec<(&Body, Vec2)> = starts.filter_map(|(body, at)| at.map(|at| (body, at))).collect();
        let each = self.solids.iter().zip(&self.blocked).zip(&self.given);
        for (((solid, blocked), given), obstacle) in each.zip(obstacles) {
            *obstacle = given.unwrap_or_else(|| {
                let place = self.placing.obstacle(stream, solid, *blocked, &placed, &starts);
                clear &= place.clear;
                placed.push((solid, place.at));
                place.at
            });
        }
        clear
    }

    /// Writes the robots' places, those given first. Returns whether none overlaps anything.
    pub fn place_robots(&self, stream: &mut Stream, obstacles: &[Vec2], robots: &mut [Vec2]) -> bool {
        let mut clear = true;
        let mut others = Vec::with_capacity(self.team.len());
        for wanted in [true, false] {
            let team = self.team.iter().zip(&self.starts).zip(&mut *robots);
            for ((body, start), robot) in team.filter(|((_, start), _)| start.is_some() == wanted) {
                let solids = self.solids_in(body.layer, obstacles);
                let place = self.placing.robot(stream, body, *start, &others, &solids);
                clear &= place.clear || self.passing;
                others.push((body, place.at));
                *robot = place.at;
            }
        }
        clear
    }

    /// Writes the place at which a robot comes back, clear of all others but those `absent` (as bits). If there
    /// is no such place, it is the one with the most room.
    pub fn place_back(
        &self,
        stream: &mut Stream,
        robot: usize,
        absent: u64,
        obstacles: &[Vec2],
        robots: &mut [Vec2],
    ) {
        let there = |index: &usize| *index != robot && absent >> index & 1 == 0;
        let others: Vec<(&Body, Vec2)> =
            (0..robots.len()).filter(there).map(|index| (&self.team[index], robots[index])).collect();
        let solids = self.solids_in(self.team[robot].layer, obstacles);
        robots[robot] = self.placing.robot(stream, &self.team[robot], None, &others, &solids).at;
    }

    /// Writes the places of obstacles and robots when an episode starts. Where one finds no clear place,
    /// because of where those before it are, all are drawn again. Returns whether nothing overlaps.
    pub fn place_start(&self, stream: &mut Stream, obstacles: &mut [Vec2], robots: &mut [Vec2]) -> bool {
        (0..START_TRIES).any(|_| {
            let clear = self.place_obstacles(stream, obstacles);
            self.place_robots(stream, obstacles, robots) && clear
        })
    }

    /// Whether the situation wants victims to appear in these slots now.
    #[must_use]
    pub fn wants_victims(&self, slots: &[Option<Victim>]) -> bool {
        match self.situation {
            Situation::Single | Situation::Double => slots.iter().any(Option::is_none),
            Situation::Mixed => slots.iter().all(Option::is_none),
            Situation::Poisson | Situation::Listed => false, // they come by themselves, see `place_arrivals`
        }
    }

    /// Most words that are drawn from the victims' stream when it is their turn to appear.
    #[must_use]
    pub fn most_words(&self) -> u64 {
        (1 + self.num_slots * (1 + 2 * DRAWS)) as u64
    }

    /// Whether obstacles may be at these places, as many as there are.
    #[must_use]
    pub fn may_be_obstacles(&self, obstacles: &[Vec2]) -> bool {
        obstacles.len() == self.solids.len()
            && self.solids.iter().zip(&self.given).zip(obstacles).all(|((solid, given), at)| match given {
                Some(given) => given == at,
                None => self.placing.may_be_obstacle(solid, *at),
            })
    }

    /// Tasks that a victim of this slot may have.
    #[must_use]
    pub fn tasks_of_slot(&self, slot: usize) -> RangeInclusive<usize> {
        match self.situation {
            Situation::Single | Situation::Mixed => 0..=self.num_tasks - 1,
            Situation::Double => slot..=slot,
            Situation::Poisson | Situation::Listed => slot / self.slots_per_task..=slot / self.slots_per_task,
        }
    }

    /// How far a victim may be from the centre on each axis, m.
    #[must_use]
    pub fn victim_reach(&self) -> f32 {
        self.placing.victim_reach()
    }

    /// Whether these victims may be present after `step` steps of an episode in which `appeared` have come.
    #[must_use]
    pub fn may_be_victims(&self, slots: &[Option<Victim>], step: u32, appeared: u32) -> bool {
        let known = |slot: usize, victim: &Victim| {
            let earlier = slots[..slot].iter().flatten();
            self.tasks_of_slot(slot).contains(&(victim.task as usize))
                && victim.id < appeared
                && victim.appeared_step <= step
                && earlier.clone().all(|other| other.id != victim.id)
                && self.placing.may_be_victim(victim.position)
        };
        slots.len() == self.num_slots
            && !self.wants_victims(slots)
            && slots.iter().enumerate().all(|(slot, victim)| victim.is_none_or(|victim| known(slot, &victim)))
    }

    /// Lets victims appear at `step` in the empty slots that the situation wants to be filled, or in all where
    /// they arrive, and counts them in `appeared`. Returns the first task whose victim found no clear place.
    pub fn place_victims(
        &self,
        stream: &mut Stream,
        step: u32,
        appeared: &mut u32,
        robots: &[Vec2],
        obstacles: &[Vec2],
        slots: &mut [Option<Victim>],
    ) -> Option<usize> {
        let mut crowded = None;
        let solids = self.placed(obstacles);
        let wanted = match self.situation {
            Situation::Mixed => 1 + stream.below(slots.len()),
            _ => slots.len(),
        };
        for index in 0..wanted {
            if slots[index].is_some() {
                continue;
            }
            let task = match self.situation {
                Situation::Single | Situation::Mixed => stream.below(self.num_tasks),
                _ => *self.tasks_of_slot(index).start(),
            };
            let others = slots.iter().flatten().map(|victim| victim.position);
            let place = self.placing.victim(stream, task, robots, &others, &solids);
            crowded = crowded.or((!place.clear).then_some(task));
            slots[index] = Some(Victim::new(*appeared, task as u32, step, place.at));
            *appeared += 1;
        }
        crowded
    }

    /// Lets the victims `due` appear at `step`, each in the first empty slot of its task, and counts
    /// them in `appeared`. Returns how many find none.
    #[allow(clippy::too_many_arguments)]
    pub fn place_arrivals(
        &self,
        stream: &mut Stream,
        due: impl Iterator<Item = Due>,
        step: u32,
        appeared: &mut u32,
        robots: &[Vec2],
        obstacles: &[Vec2],
        slots: &mut [Option<Victim>],
    ) -> usize {
        let solids = self.placed(obstacles);
        let mut turned_away = 0;
        for Due { task, place } in due {
            let mut own = task * self.slots_per_task..(task + 1) * self.slots_per_task;
            let Some(slot) = own.find(|slot| slots[*slot].is_none()) else {
                turned_away += 1;
                continue;
            };
            let others = slots.iter().flatten().map(|victim| victim.position);
            let at = place.unwrap_or_else(|| self.placing.victim(stream, task, robots, &others, &solids).at);
            slots[slot] = Some(Victim::new(*appeared, task as u32, step, at));
            *appeared += 1;
        }
        turned_away
    }

    /// Number of the first of these places that is too near to an obstacle with a given place for a victim.
    #[must_use]
    pub fn blocked_place(&self, wanted: &[[f64; 2]]) -> Option<usize> {
        let fixed = self.solids.iter().zip(&self.given);
        let placed: Vec<Placed> = fixed.filter_map(|(solid, at)| at.map(|at| (solid, at))).collect();
        let near = |at: &[f64; 2]| self.placing.is_blocked(Vec2::new(at[0] as f32, at[1] as f32), &placed);
        wanted.iter().position(near)
    }

    /// What does not fit into the arena in some of 64 trial episodes, if anything.
    #[must_use]
    pub fn find_crowding(&self) -> Option<Crowded> {
        let mut obstacles = vec![Vec2::zeros(); self.solids.len()];
        let mut robots = vec![Vec2::zeros(); self.team.len()];
        (0..TRIALS).find_map(|episode| {
            let mut start = Stream::new(0, 0, episode, Purpose::Start);
            let mut victims = Stream::new(0, 0, episode, Purpose::Victims);
            let mut slots = vec![None; self.num_slots];
            if !self.place_obstacles(&mut start, &mut obstacles) {
                Some(Crowded::Obstacles)
            } else if !self.place_robots(&mut start, &obstacles, &mut robots) {
                Some(Crowded::Robots)
            } else if self.situation == Situation::Listed {
                None // whose places are given
            } else {
                self.place_victims(&mut victims, 0, &mut 0, &robots, &obstacles, &mut slots)
                    .or_else(|| self.crowded_area(&mut victims, &robots, &obstacles))
                    .map(Crowded::Victims)
            }
        })
    }

    /// The first task with an area of its own in which a victim alone finds no clear place. The situation may
    /// want victims of it in few trials.
    fn crowded_area(&self, stream: &mut Stream, robots: &[Vec2], obstacles: &[Vec2]) -> Option<usize> {
        let (solids, nobody) = (self.placed(obstacles), std::iter::empty());
        let mut own = (0..self.num_tasks).filter(|task| self.placing.has_area(*task));
        own.find(|task| !self.placing.victim(stream, *task, robots, &nobody, &solids).clear)
    }

    /// The obstacles that block a layer (one bit).
    fn solids_in<'a>(&'a self, layer: u64, obstacles: &[Vec2]) -> Vec<Placed<'a>> {
        let blocking = self.placed(obstacles).into_iter().zip(&self.blocked);
        blocking.filter(|(_, blocked)| *blocked & layer != 0).map(|(placed, _)| placed).collect()
    }

    fn placed<'a>(&'a self, obstacles: &[Vec2]) -> Vec<Placed<'a>> {
        self.solids.iter().zip(obstacles.iter().copied()).collect()
    }
}
