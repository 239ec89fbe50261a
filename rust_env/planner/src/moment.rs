//! What a plan for a world starts from: the team, and how world and victims are at a moment.

use crate::coalition::{Candidates, Offers};
use crate::ways::{Place, Stand, Ways};

/// Most victims: those for which one waits are a mask of 32 bits.
pub const MAX_VICTIMS: usize = 32;
/// A sum counts as reached from this share of the amount below it, as in the worlds.
const ROUNDING: f64 = 1e-9;

/// What victims of one type need.
#[derive(Debug, Clone, PartialEq)]
pub enum Needs {
    /// A distinct robot for each need.
    List(Candidates),
    /// Amounts that the helpers must have together.
    Sums(Sums),
}

/// Amounts that helpers must have together, and those that robots have.
#[derive(Debug, Clone, PartialEq)]
pub struct Sums {
    /// By ability.
    needed: Vec<f64>,
    /// Robots that have some of it, by number, and their amounts by ability.
    robots: Vec<u8>,
    given: Vec<Vec<f64>>,
}

impl Sums {
    /// The robots, of those with such amounts by ability, that have some of what is needed.
    #[must_use]
    pub fn new(needed: &[f64], amounts: &[Vec<f64>]) -> Self {
        let has_some =
            |given: &[f64]| needed.iter().zip(given).any(|(most, amount)| *most > 0.0 && *amount > 0.0);
        let able = (0..amounts.len()).filter(|robot| has_some(&amounts[*robot]));
        let (robots, given) = able.map(|robot| (robot as u8, amounts[robot].clone())).unzip();
        Self { needed: needed.to_vec(), robots, given }
    }

    /// The robots that arrive soonest, ties by number, until all sums are reached; without those that the others
    /// can do without, the latest first. When they are all there, and their mask.
    fn soonest(&self, offers: &Offers) -> (f64, u64) {
        let mut order: Vec<usize> =
            (0..self.robots.len()).filter(|place| offers.arrivals[*place].is_finite()).collect();
        order.sort_by(|a, b| offers.arrivals[*a].total_cmp(&offers.arrivals[*b]));
        let mut sums = vec![0.0; self.needed.len()];
        let mut taken = vec![];
        for place in order {
            if self.is_reached(&sums) {
                break;
            }
            self.add(&mut sums, place, 1.0);
            taken.push(place);
        }
        if !self.is_reached(&sums) {
            return (f64::INFINITY, 0);
        }
        for index in (0..taken.len()).rev() {
            let mut without = sums.clone();
            self.add(&mut without, taken[index], -1.0);
            if self.is_reached(&without) {
                sums = without;
                taken.remove(index);
            }
        }
        let last = taken.iter().map(|place| offers.arrivals[*place]).fold(0.0, f64::max);
        (last, taken.iter().fold(0, |mask, place| mask | 1 << self.robots[*place]))
    }

    fn add(&self, sums: &mut [f64], place: usize, sign: f64) {
        sums.iter_mut().zip(&self.given[place]).for_each(|(sum, amount)| *sum += sign * amount);
    }

    fn is_reached(&self, sums: &[f64]) -> bool {
        sums.iter().zip(&self.needed).all(|(sum, most)| *sum >= most * (1.0 - ROUNDING))
    }
}

impl Needs {
    /// The robots that can give some of it, in the order of [`Offers`].
    #[must_use]
    pub fn robots(&self) -> &[u8] {
        match self {
            Self::List(candidates) => candidates.robots(),
            Self::Sums(sums) => &sums.robots,
        }
    }

    /// The coalition that can begin soonest; when it begins, and its mask. The time is infinite where there is
    /// none.
    #[must_use]
    pub fn soonest(&self, offers: &Offers) -> (f64, u64) {
        match self {
            Self::List(candidates) => candidates.soonest(offers),
            Self::Sums(sums) => sums.soonest(offers),
        }
    }
}

/// The team of a scenario, and what its victims need.
#[derive(Debug, Clone, PartialEq)]
pub struct Team {
    /// How the robots move.
    pub ways: Ways,
    /// By type of victims.
    pub needs: Vec<Needs>,
}

/// A victim that is present.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Victim {
    /// Index of its type.
    pub kind: usize,
    /// Where it is, m.
    pub place: Place,
    /// How long helpers must stay there, s.
    pub work: f64,
    /// Until it is lost, s; infinite for one that waits for ever.
    pub left: f64,
    /// Those for which it has to wait, as bits.
    pub after: u32,
}

/// A world at a moment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Moment {
    /// By robot.
    pub stands: Vec<Stand>,
    /// Those present, at most [`MAX_VICTIMS`].
    pub victims: Vec<Victim>,
    /// By victim and robot, when a robot could be there if it went straight on, s.
    pub arrivals: Vec<Vec<f64>>,
}

impl Moment {
    /// Whether no victims wait for each other in a circle.
    #[must_use]
    pub fn is_ordered(&self) -> bool {
        let mut open = (0..self.victims.len()).fold(0_u32, |mask, victim| mask | 1 << victim);
        for _ in 0..self.victims.len() {
            let waits = |victim: &usize| open >> victim & 1 == 1 && self.victims[*victim].after & open != 0;
            open = (0..self.victims.len()).filter(waits).fold(0, |mask, victim| mask | 1 << victim);
        }
        open == 0
    }
}
