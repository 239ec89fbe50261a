//! Shortest ways of a disc around solids to one goal, by the cells where it has room: for every cell how long
//! the way is and where it turns first.
//!
//! The field is Lazy Theta* (Nash, Koenig and Tovey, AAAI 2010) from the goal outwards. Ways turn at the
//! centres of cells only, and go straight in between. A field grows no farther than it is asked for.

use std::collections::BinaryHeap;

use crate::free_space::{FreeSpace, Next, Way};
use crate::geometry::Vec2;

/// The turn of cells from which the way leads straight to the goal.
const GOAL: u32 = u32::MAX;

/// Lengths of shortest ways to one goal, and their first turns. Empty until a way is asked for that is not
/// straight.
#[derive(Debug, Clone, Default)]
pub struct DistanceField {
    goal: Vec2,
    /// Who is so near to the goal is there, m.
    reach: f32,
    lengths: Vec<f32>,
    turns: Vec<u32>,
    settled: Vec<bool>,
    /// Whether it is known that the way from a cell is straight, or that it is not.
    seen: Vec<bool>,
    next: BinaryHeap<Next>,
}

impl DistanceField {
    /// The field of a goal; a robot within `reach` of it is there, even behind a wall.
    #[must_use]
    pub fn new(goal: Vec2, reach: f32) -> Self {
        Self { goal, reach, ..Self::default() }
    }

    /// The way from a place in a free cell, if there is one.
    pub fn way(&mut self, space: &FreeSpace, from: Vec2) -> Option<Way> {
        let cell = space.cell(from);
        if !self.settle(space, cell) {
            return None;
        }
        let turn = self.place(space, self.turns[cell]);
        if self.turns[cell] != GOAL && space.is_clear(from, turn, 0.0) {
            let rest = self.lengths[self.turns[cell] as usize];
            return Some(Way { length: (turn - from).norm() + rest, next: turn });
        }
        let centre = space.centre(cell);
        let next = if space.is_at(centre, from) { turn } else { centre };
        Some(Way { length: (centre - from).norm() + self.lengths[cell], next })
    }

    /// Grows until a cell is settled. Returns whether there is a way from it.
    fn settle(&mut self, space: &FreeSpace, wanted: usize) -> bool {
        self.look(space, wanted);
        while !self.settled[wanted] {
            let Some(Next { length, index: cell }) = self.next.pop() else { return false };
            if self.settled[cell] || length > self.lengths[cell] {
                continue;
            }
            let at = space.centre(cell);
            let turn = self.turns[cell];
            let reach = if turn == GOAL { self.reach } else { 0.0 };
            if !space.is_clear(at, self.place(space, turn), reach) && self.turn_nearby(space, cell) {
                continue; // it is longer than thought: others may come first
            }
            self.settled[cell] = true;
            let turn = self.turns[cell];
            let (from, before) = (self.place(space, turn), self.before(turn));
            for other in space.around(cell) {
                if space.is_free(other) && !self.settled[other] {
                    self.offer(other, before + (space.centre(other) - from).norm(), turn);
                }
            }
        }
        true
    }

    /// Settles a cell from which the way leads straight to the goal. From another cell, finds all in the same
    /// shadow: their ways turn in it, or where it ends.
    fn look(&mut self, space: &FreeSpace, from: usize) {
        if self.lengths.is_empty() {
            let count = space.cells();
            self.lengths = vec![f32::INFINITY; count];
            self.turns = vec![GOAL; count];
            self.settled = vec![false; count];
            self.seen = vec![false; count];
        }
        let (mut left, mut shadow) = (vec![from], vec![]);
        while let Some(cell) = left.pop() {
            if std::mem::replace(&mut self.seen[cell], true) {
                continue;
            }
            let at = space.centre(cell);
            if space.is_clear(at, self.goal, self.reach) {
                self.lengths[cell] = (at - self.goal).norm();
                self.settled[cell] = true;
            } else {
                shadow.push(cell);
                left.extend(space.around(cell).filter(|other| space.is_free(*other)));
            }
        }
        let mut ends = shadow.is_empty();
        for cell in &shadow {
            ends |= self.turn_nearby(space, *cell);
        }
        if !ends {
            // From nowhere the way is straight to a goal that is too deep in a solid.
            if let Some(cell) = space.nearest_free(self.goal).filter(|cell| shadow.contains(cell)) {
                self.offer(cell, (space.centre(cell) - self.goal).norm(), GOAL);
            }
        }
    }

    /// Lets the way of a cell turn at the best of the settled cells around it, if there is any.
    fn turn_nearby(&mut self, space: &FreeSpace, cell: usize) -> bool {
        let at = space.centre(cell);
        let settled = space.around(cell).filter(|other| self.settled[*other]);
        let length = |other: usize| (self.lengths[other] + (space.centre(other) - at).norm(), other);
        let Some((length, other)) = settled.map(length).min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return false; // one of the first, which are at the goal
        };
        if self.turns[cell] == other as u32 {
            return false; // to a cell beside it the way is as good as clear
        }
        self.lengths[cell] = f32::INFINITY;
        self.offer(cell, length, other as u32);
        true
    }

    fn offer(&mut self, cell: usize, length: f32, turn: u32) {
        if length < self.lengths[cell] {
            self.lengths[cell] = length;
            self.turns[cell] = turn;
            self.next.push(Next { length, index: cell });
        }
    }

    /// Where a way turns.
    fn place(&self, space: &FreeSpace, turn: u32) -> Vec2 {
        if turn == GOAL { self.goal } else { space.centre(turn as usize) }
    }

    /// Length of the way from where another one turns.
    fn before(&self, turn: u32) -> f32 {
        if turn == GOAL { 0.0 } else { self.lengths[turn as usize] }
    }
}
