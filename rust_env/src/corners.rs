//! Shortest ways of a disc around solids to one goal, by the corners at which they turn.
//!
//! A shortest way turns only at corners of what is in the way, so a graph of those that are in sight of each other
//! has it. On a grid it may miss one through the narrowest gaps: then there is no answer here.

use std::collections::BinaryHeap;

use crate::free_space::{FreeSpace, Next, Way};
use crate::geometry::Vec2;

/// Most corners of a space: looking from each to each must not take long.
pub const MOST_CORNERS: usize = 1500;
/// The turn of corners from which the way leads straight to the goal.
const GOAL: usize = usize::MAX;

/// The corners of a space, and which of them are in sight of each other.
#[derive(Debug, Clone)]
pub struct Corners {
    at: Vec<Vec2>,
    /// The corners in sight of each, and how far away they are, m.
    links: Vec<Vec<(usize, f32)>>,
}

impl Corners {
    /// The corners of a space; `None` if they are too many.
    #[must_use]
    pub fn new(space: &FreeSpace) -> Option<Self> {
        let at: Vec<Vec2> = space.corners().map(|cell| space.centre(cell)).collect();
        if at.len() > MOST_CORNERS {
            return None;
        }
        let mut links = vec![vec![]; at.len()];
        for one in 0..at.len() {
            for other in 0..one {
                if space.is_clear(at[one], at[other], 0.0) {
                    let length = (at[one] - at[other]).norm();
                    links[one].push((other, length));
                    links[other].push((one, length));
                }
            }
        }
        Some(Self { at, links })
    }
}

/// How long the ways from all corners to one goal are, and where they turn.
#[derive(Debug, Clone)]
pub struct CornerWays {
    goal: Vec2,
    reach: f32,
    lengths: Vec<f32>,
    turns: Vec<usize>,
}

impl CornerWays {
    /// The ways to a goal; a robot within `reach` of it is there, even behind a wall.
    #[must_use]
    pub fn new(space: &FreeSpace, corners: &Corners, goal: Vec2, reach: f32) -> Self {
        let straight =
            |at: &Vec2| if space.is_clear(*at, goal, reach) { (at - goal).norm() } else { f32::INFINITY };
        let mut lengths: Vec<f32> = corners.at.iter().map(straight).collect();
        let mut turns = vec![GOAL; lengths.len()];
        let first = lengths.iter().enumerate().filter(|(_, length)| length.is_finite());
        let mut next: BinaryHeap<Next> =
            first.map(|(corner, length)| Next { length: *length, index: corner }).collect();
        while let Some(Next { length, index: corner }) = next.pop() {
            if length > lengths[corner] {
                continue;
            }
            for (other, apart) in &corners.links[corner] {
                if length + apart < lengths[*other] {
                    (lengths[*other], turns[*other]) = (length + apart, corner);
                    next.push(Next { length: length + apart, index: *other });
                }
            }
        }
        Self { goal, reach, lengths, turns }
    }

    /// The way from a place in a free cell, if corners lead to the goal.
    #[must_use]
    pub fn way(&self, space: &FreeSpace, corners: &Corners, from: Vec2) -> Option<Way> {
        if let Some(way) = self.seen(space, corners, from) {
            return Some(way);
        }
        let centre = space.centre(space.cell(from));
        let way = self.seen(space, corners, centre)?;
        let apart = (centre - from).norm();
        let next = if space.is_at(centre, from) { way.next } else { centre };
        Some(Way { length: apart + way.length, next })
    }

    /// The shortest way whose first part is in sight.
    fn seen(&self, space: &FreeSpace, corners: &Corners, from: Vec2) -> Option<Way> {
        if space.is_clear(from, self.goal, self.reach) {
            return Some(Way { length: (self.goal - from).norm(), next: self.goal });
        }
        let by = |(corner, length): (usize, &f32)| Next {
            length: length + (corners.at[corner] - from).norm(),
            index: corner,
        };
        let finite = self.lengths.iter().enumerate().filter(|(_, length)| length.is_finite());
        let mut ways: BinaryHeap<Next> = finite.map(by).collect();
        while let Some(Next { length, index: corner }) = ways.pop() {
            let at = corners.at[corner];
            if space.is_clear(from, at, 0.0) {
                let turn = self.turns[corner];
                let after = if turn == GOAL { self.goal } else { corners.at[turn] };
                return Some(Way { length, next: if space.is_at(at, from) { after } else { at } });
            }
        }
        None
    }
}
