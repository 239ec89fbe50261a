//! Shortest ways of a disc around solids to one goal: what is free on a grid of cells, and a field over
//! it that knows, for every cell, how long the way is and where it turns first.
//!
//! The field is Lazy Theta* (Nash, Koenig and Tovey, AAAI 2010) from the goal outwards. Ways turn at the
//! centres of cells only, and go straight in between. A field grows no farther than it is asked for.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::geometry::Vec2;
use crate::place::Placed;

/// Most cells along one side of an arena.
pub const MOST_CELLS: usize = 256;
/// Widths of a cell in radii of the disc, where the arena is not too large for it.
const CELL_RADII: f32 = 0.5;
/// A disc that is nearer to a solid than this share of its radius would be deep inside of it.
const INSIDE: f32 = 0.4;
/// Length of a way out of where there is no room for the disc, for each metre; more than any detour is
/// longer than the way that it avoids.
const STEEP: f32 = 4.0;
/// The turn of cells from which the way leads straight to the goal.
const GOAL: u32 = u32::MAX;

/// Which cells of an arena have room for a disc.
#[derive(Debug, Clone)]
pub struct FreeSpace {
    half: f32,
    side: usize,
    cell: f32,
    scale: f32,
    /// For how many steps of half a cell the disc fits wherever it goes from a cell, at least 1; 0 where it
    /// does not fit at the centre.
    ahead: Vec<u8>,
    /// Whether it can be there at all, as deep in a solid as contacts let it.
    open: Vec<bool>,
}

impl FreeSpace {
    /// The cells of an arena of half width `half`, for a disc among these solids; lengths in m.
    #[must_use]
    pub fn new(half: f32, radius: f32, solids: &[Placed]) -> Self {
        let wanted = (2.0 * half / (CELL_RADII * radius)).ceil();
        let side = (wanted as usize).clamp(1, MOST_CELLS);
        let mut space = Self {
            half,
            side,
            cell: 2.0 * half / side as f32,
            scale: side as f32 / (2.0 * half),
            ahead: vec![],
            open: vec![],
        };
        let room = |cell: usize| {
            let at = space.centre(cell);
            let nearest = solids.iter().map(|(solid, place)| solid.nearest(at - place).0);
            nearest.fold(half - at.amax(), f32::min)
        };
        let rooms: Vec<f32> = (0..side * side).map(room).collect();
        // Of two places, the centres of their cells are at most 1.42 cells farther apart than they are.
        let steps = |room: f32| ((room - radius - 1.5 * space.cell) / (0.5 * space.cell)).max(1.0) as u8;
        space.ahead = rooms.iter().map(|room| if *room >= radius { steps(*room) } else { 0 }).collect();
        space.open = rooms.iter().map(|room| *room >= INSIDE * radius).collect();
        space
    }

    /// How many cells there are.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.ahead.len()
    }

    /// Whether the disc fits where a cell has its centre.
    fn is_free(&self, cell: usize) -> bool {
        self.ahead[cell] > 0
    }

    /// The centre of a cell, m.
    fn centre(&self, cell: usize) -> Vec2 {
        let (row, column) = (cell / self.side, cell % self.side);
        Vec2::new(column as f32, row as f32).map(|index| (index + 0.5) * self.cell - self.half)
    }

    /// Column and row of a place, those of the nearest cell where it is outside.
    fn indices(&self, at: Vec2) -> (usize, usize) {
        let index =
            |value: f32| (((value + self.half) * self.scale).max(0.0) as u32 as usize).min(self.side - 1);
        (index(at.x), index(at.y))
    }

    fn cell(&self, at: Vec2) -> usize {
        let (column, row) = self.indices(at);
        row * self.side + column
    }

    /// Into how many steps of half a cell or less a straight way is cut.
    fn steps(&self, way: Vec2) -> f32 {
        (way.norm() / (0.5 * self.cell)).ceil().max(1.0)
    }

    /// Whether the disc fits after each step of a straight way, but within `reach` of its end.
    fn is_clear(&self, from: Vec2, to: Vec2, reach: f32) -> bool {
        let way = to - from;
        let steps = self.steps(way);
        let (one, last) = (way / steps, steps as u32);
        let mut step = 1;
        while step <= last {
            let at = from + one * step as f32;
            let ahead = self.ahead[self.cell(at)];
            if ahead == 0 && (to - at).norm_squared() > reach * reach {
                return false;
            }
            step += u32::from(ahead.max(1));
        }
        true
    }

    /// The last place of a straight way that a disc can come to.
    #[must_use]
    pub fn stopped(&self, from: Vec2, to: Vec2) -> Vec2 {
        let way = to - from;
        let steps = self.steps(way);
        let places = (1..=steps as usize).map(|step| from + way * (step as f32 / steps));
        let open = |at: &Vec2| self.open[self.cell(*at)] && at.amax() <= self.half;
        places.take_while(open).last().unwrap_or(from)
    }

    /// The cells around a cell, as many as there are.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let (row, column, side) = (cell / self.side, cell % self.side, self.side);
        let rows = row.saturating_sub(1)..=(row + 1).min(side - 1);
        let columns = column.saturating_sub(1)..=(column + 1).min(side - 1);
        let all = rows.flat_map(move |row| columns.clone().map(move |column| row * side + column));
        all.filter(move |other| *other != cell)
    }

    /// The free cell whose centre is nearest to a place, if there is any.
    fn nearest_free(&self, at: Vec2) -> Option<usize> {
        let (column, row) = self.indices(at);
        let mut best: Option<(f32, usize)> = None;
        for ring in 0..self.side {
            // All centres in this ring are at least so far away on one axis.
            if best.is_some_and(|(distance, _)| distance < (ring as f32 - 1.0) * self.cell) {
                break;
            }
            let low = |index: usize| index.saturating_sub(ring);
            let high = |index: usize| (index + ring).min(self.side - 1);
            for other_row in low(row)..=high(row) {
                let edge = other_row.abs_diff(row) == ring;
                for other in low(column)..=high(column) {
                    let cell = other_row * self.side + other;
                    if (edge || other.abs_diff(column) == ring) && self.is_free(cell) {
                        let distance = (self.centre(cell) - at).norm();
                        if best.is_none_or(|(least, _)| distance < least) {
                            best = Some((distance, cell));
                        }
                    }
                }
            }
        }
        best.map(|(_, cell)| cell)
    }
}

/// The way from a place to a goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Its length, m; infinite if there is none.
    pub length: f32,
    /// Where it turns first, or the goal, m.
    pub next: Vec2,
}

/// A cell whose length may be settled next: the one with the shortest first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Next {
    length: f32,
    cell: u32,
}

impl Eq for Next {}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        other.length.total_cmp(&self.length).then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

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

    /// The way from a place. Where the disc has no room, it first leaves that place the shortest way.
    pub fn way(&mut self, space: &FreeSpace, from: Vec2) -> Way {
        if space.is_clear(from, self.goal, self.reach) {
            return Way { length: (self.goal - from).norm(), next: self.goal };
        }
        let cell = space.cell(from);
        if space.is_free(cell) && self.settle(space, cell) {
            let turn = self.place(space, self.turns[cell]);
            if self.turns[cell] != GOAL && space.is_clear(from, turn, 0.0) {
                let rest = self.lengths[self.turns[cell] as usize];
                return Way { length: (turn - from).norm() + rest, next: turn };
            }
            let centre = space.centre(cell);
            let next = if (centre - from).norm() < 0.25 * space.cell { turn } else { centre };
            return Way { length: (centre - from).norm() + self.lengths[cell], next };
        }
        match space.nearest_free(from) {
            Some(out) if self.settle(space, out) => {
                let centre = space.centre(out);
                Way { length: STEEP * (centre - from).norm() + self.lengths[out], next: centre }
            }
            _ => Way { length: f32::INFINITY, next: self.goal },
        }
    }

    /// Grows until a cell is settled. Returns whether there is a way from it.
    fn settle(&mut self, space: &FreeSpace, wanted: usize) -> bool {
        self.look(space, wanted);
        while !self.settled[wanted] {
            let Some(Next { length, cell }) = self.next.pop() else { return false };
            let cell = cell as usize;
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
            self.next.push(Next { length, cell: cell as u32 });
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
