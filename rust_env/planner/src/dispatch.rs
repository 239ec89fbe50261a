//! Where the robots of a world go now: the first step of the best plan for all victims that are there.
//!
//! A plan is an order of the victims. They are given out in it, as tasks are in `order.rs`; one that has to wait
//! for others comes after them. Few victims are planned for in every order; more begin with the order in which
//! always the soonest comes next, and a local search moves one of them at a time.

use crate::coalition::Offers;
use crate::instance::MAX_ROBOTS;
use crate::moment::{Moment, Team};
use crate::ways::{Leg, Stand};

/// Most victims whose orders are all tried.
const MOST_TRIED: usize = 4;
/// Cost of a victim that is lost or never rescued, s; more than any plan takes.
const LOST_S: f64 = 1e6;
/// A rescue counts as in time up to so much after the deadline, s.
const LATE_S: f64 = 1e-6;
/// What a second of driving costs beside a second of waiting: of plans that are as soon, the shortest ways.
const DRIVING: f64 = 0.01;
/// Plans that cost less by no more than this are no better, s.
const ROUNDING_S: f64 = 1e-9;

/// What a plan is to keep low.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Weight of the sum of the times at which victims are rescued.
    pub sum: f64,
    /// Weight of the last of them.
    pub last: f64,
}

/// Where a robot goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Goal {
    /// Nobody needs it.
    Free,
    /// A station or a depot, and then a victim.
    Stop,
    /// A victim, by its place in the moment's list.
    Victim(usize),
}

/// Which of the robots that come in time a plan keeps for others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spare {
    /// Those that come last: ways are short.
    Far,
    /// Those that come first: they are free sooner.
    Near,
}

/// The best plan that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Dispatch {
    /// By robot, where it goes first.
    pub goals: Vec<Goal>,
    /// What the plan costs, s; see [`Aim`].
    pub cost: f64,
}

/// The best plan for at most so many orders of the victims.
#[must_use]
pub fn dispatch(team: &Team, moment: &Moment, aim: Aim, orders: usize) -> Dispatch {
    let mut search = Search { team, moment, aim, left: orders, best: (f64::INFINITY, vec![], vec![]) };
    let victims = moment.victims.len();
    if victims <= MOST_TRIED {
        search.try_all(&mut (0..victims).collect(), 0);
    } else {
        search.improve();
    }
    Dispatch { goals: search.best.2, cost: search.best.0 }
}

struct Search<'a> {
    team: &'a Team,
    moment: &'a Moment,
    aim: Aim,
    /// Orders that may still be tried; the first one always is.
    left: usize,
    /// The best plan: its cost, its order and the robots' first goals.
    best: (f64, Vec<usize>, Vec<Goal>),
}

impl Search<'_> {
    /// Tries all orders that begin as `order` does up to `fixed`.
    fn try_all(&mut self, order: &mut Vec<usize>, fixed: usize) {
        if fixed + 1 >= order.len() {
            self.keep_better(order);
            return;
        }
        for next in fixed..order.len() {
            order[fixed..=next].rotate_right(1);
            self.try_all(order, fixed + 1);
            order[fixed..=next].rotate_left(1);
        }
    }

    /// Starts with the soonest first, and puts one victim elsewhere as long as that helps.
    fn improve(&mut self) {
        let order = soonest_first(self.team, self.moment);
        self.keep_better(&order);
        let count = order.len();
        let mut since = 0;
        for (from, to) in (0..).map(|turn: usize| (turn / count % count, turn % count)) {
            if since >= count * count || self.left == 0 {
                return;
            }
            let mut order = self.best.1.clone();
            let moved = order.remove(from);
            order.insert(to, moved);
            since = if from != to && self.keep_better(&order) { 0 } else { since + 1 };
        }
    }

    /// Keeps an order if it is better than the best. Whether it was.
    fn keep_better(&mut self, order: &[usize]) -> bool {
        self.left = self.left.saturating_sub(1);
        let mut is_better = false;
        for spare in [Spare::Far, Spare::Near] {
            let mut plan = Plan::new(self.team, self.moment, spare);
            for victim in order {
                plan.give_out_after_others(*victim);
            }
            let cost = plan.cost(self.aim);
            if self.best.2.is_empty() || cost < self.best.0 - ROUNDING_S {
                is_better = true;
                self.best = (cost, order.to_vec(), plan.goals);
            }
        }
        is_better
    }
}

/// The order in which always that victim comes next which is rescued soonest; the first of equals.
fn soonest_first(team: &Team, moment: &Moment) -> Vec<usize> {
    let mut plan = Plan::new(team, moment, Spare::Far);
    let mut left: Vec<usize> = (0..moment.victims.len()).collect();
    let mut order = vec![];
    while !left.is_empty() {
        let open = (0..left.len()).filter(|index| plan.waits_for(left[*index]) == 0);
        let start = |index: usize| plan.coalition(left[index]).0;
        let next = open.map(|index| (start(index), index)).min_by(|a, b| a.0.total_cmp(&b.0));
        let victim = left.remove(next.map_or(0, |(_, index)| index));
        plan.give_out(victim);
        order.push(victim);
    }
    order
}

/// A plan for some of the victims.
struct Plan<'a> {
    team: &'a Team,
    moment: &'a Moment,
    spare: Spare,
    stands: Vec<Stand>,
    goals: Vec<Goal>,
    /// By victim, when it is gone; none of those that were not given out yet.
    gone: Vec<Option<f64>>,
    /// Number of those that are lost, the sum of the times of rescues, the last one, and the time of driving.
    lost: usize,
    sum: f64,
    last: f64,
    driving: f64,
}

impl<'a> Plan<'a> {
    fn new(team: &'a Team, moment: &'a Moment, spare: Spare) -> Self {
        let goals = vec![Goal::Free; moment.stands.len()];
        let (stands, gone) = (moment.stands.clone(), vec![None; moment.victims.len()]);
        Self { team, moment, spare, stands, goals, gone, lost: 0, sum: 0.0, last: 0.0, driving: 0.0 }
    }

    /// Those that a victim has to wait for and that were not given out yet, as bits.
    fn waits_for(&self, victim: usize) -> u32 {
        let open = |other: &usize| self.gone[*other].is_none();
        let bits = (0..self.gone.len()).filter(open).fold(0, |mask, other| mask | 1 << other);
        self.moment.victims[victim].after & bits
    }

    /// Gives out a victim, unless it was before, and those before it that it has to wait for.
    fn give_out_after_others(&mut self, victim: usize) {
        while self.waits_for(victim) != 0 {
            self.give_out_after_others(self.waits_for(victim).trailing_zeros() as usize);
        }
        if self.gone[victim].is_none() {
            self.give_out(victim);
        }
    }

    /// The coalition that a victim would get now: when it is there, and its mask.
    fn coalition(&self, victim: usize) -> (f64, u64) {
        let needs = &self.team.needs[self.moment.victims[victim].kind];
        let ready = self.ready(victim);
        let mut offers = Offers { arrivals: [0.0; MAX_ROBOTS], ranks: [0.0; MAX_ROBOTS] };
        for (place, robot) in needs.robots().iter().enumerate() {
            let robot = usize::from(*robot);
            let arrival = self.leg(robot, victim).arrival;
            offers.arrivals[place] = arrival.max(ready);
            offers.ranks[place] = if self.spare == Spare::Far { -arrival } else { arrival };
        }
        needs.soonest(&offers)
    }

    /// When all those are gone that a victim has to wait for.
    fn ready(&self, victim: usize) -> f64 {
        let after = self.moment.victims[victim].after;
        let before = self.gone.iter().enumerate().filter(|(other, _)| after >> other & 1 == 1);
        before.filter_map(|(_, gone)| *gone).fold(0.0, f64::max)
    }

    fn leg(&self, robot: usize, victim: usize) -> Leg {
        let (stand, to) = (&self.stands[robot], self.moment.victims[victim].place);
        let direct = match self.goals[robot] {
            Goal::Free => self.moment.arrivals[victim][robot],
            _ => self.team.ways.travel(robot, stand.place, to),
        };
        self.team.ways.leg(robot, stand, to, direct)
    }

    /// Sends its coalition to a victim, if that can rescue it in time.
    fn give_out(&mut self, victim: usize) {
        let (start, mask) = self.coalition(victim);
        let found = self.moment.victims[victim];
        let done = start + found.work;
        if !done.is_finite() || done > found.left + LATE_S {
            self.gone[victim] = Some(found.left.min(LOST_S));
            self.lost += 1;
            return;
        }
        self.gone[victim] = Some(done);
        self.sum += done;
        self.last = self.last.max(done);
        for robot in (0..self.stands.len()).filter(|robot| mask >> robot & 1 == 1) {
            let leg = self.leg(robot, victim);
            self.driving += leg.arrival - self.stands[robot].free;
            if self.goals[robot] == Goal::Free {
                self.goals[robot] = if leg.by_stop { Goal::Stop } else { Goal::Victim(victim) };
            }
            self.stands[robot] = Stand {
                place: found.place,
                free: done,
                charge: leg.charge,
                load: leg.load.saturating_sub(1),
            };
        }
    }

    fn cost(&self, aim: Aim) -> f64 {
        self.lost as f64 * LOST_S + aim.sum * self.sum + aim.last * self.last + DRIVING * self.driving
    }
}
