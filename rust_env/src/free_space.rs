//! Where a disc has room among solids, on a grid of cells.

use std::cmp::Ordering;

use crate::blocks::Blocks;
use crate::geometry::Vec2;
use crate::place::Placed;

/// Most cells along one side of an arena.
pub const MOST_CELLS: usize = 256;
/// Widths of a cell in radii of the disc, where the arena is not too large for it.
const CELL_RADII: f32 = 0.5;
/// A disc that is nearer to a solid than this share of its radius would be deep inside of it.
const INSIDE: f32 = 0.4;
/// How many cells beyond the radius of a disc a map is looked at for room around it.
const FAR_CELLS: f32 = 8.0;

/// The way from a place to a goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Its length, m; infinite if there is none.
    pub length: f32,
    /// Where it turns first, or the goal, m.
    pub next: Vec2,
}

/// What a search may settle next, by its number: what is nearest to the goal comes first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Next {
    pub length: f32,
    pub index: usize,
}

impl Eq for Next {}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        other.length.total_cmp(&self.length).then(other.index.cmp(&self.index))
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

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
    /// The cells of an arena of half width `half`, for a disc among these solids and the boxes of a map; lengths
    /// in m.
    #[must_use]
    pub fn new(half: f32, radius: f32, solids: &[Placed], blocks: Option<&Blocks>) -> Self {
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
            let far = radius + FAR_CELLS * space.cell;
            let boxes = blocks.map_or(f32::INFINITY, |blocks| blocks.distance(at, far).min(far));
            nearest.fold(half - at.amax(), f32::min).min(boxes)
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
    #[must_use]
    pub fn is_free(&self, cell: usize) -> bool {
        self.ahead[cell] > 0
    }

    /// The centre of a cell, m.
    #[must_use]
    pub fn centre(&self, cell: usize) -> Vec2 {
        let (row, column) = (cell / self.side, cell % self.side);
        Vec2::new(column as f32, row as f32).map(|index| (index + 0.5) * self.cell - self.half)
    }

    /// Column and row of a place, those of the nearest cell where it is outside.
    fn indices(&self, at: Vec2) -> (usize, usize) {
        let index =
            |value: f32| (((value + self.half) * self.scale).max(0.0) as u32 as usize).min(self.side - 1);
        (index(at.x), index(at.y))
    }

    /// The cell of a place, the nearest one where it is outside.
    #[must_use]
    pub fn cell(&self, at: Vec2) -> usize {
        let (column, row) = self.indices(at);
        row * self.side + column
    }

    /// Into how many steps of half a cell or less a straight way is cut.
    fn steps(&self, way: Vec2) -> f32 {
        (way.norm() / (0.5 * self.cell)).ceil().max(1.0)
    }

    /// Whether the disc fits after each step of a straight way, but within `reach` of its end.
    #[must_use]
    pub fn is_clear(&self, from: Vec2, to: Vec2, reach: f32) -> bool {
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
    pub fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let (row, column, side) = (cell / self.side, cell % self.side, self.side);
        let rows = row.saturating_sub(1)..=(row + 1).min(side - 1);
        let columns = column.saturating_sub(1)..=(column + 1).min(side - 1);
        let all = rows.flat_map(move |row| columns.clone().map(move |column| row * side + column));
        all.filter(move |other| *other != cell)
    }

    /// Whether a place is as good as at the centre of a cell.
    #[must_use]
    pub fn is_at(&self, centre: Vec2, at: Vec2) -> bool {
        (centre - at).norm() < 0.25 * self.cell
    }

    /// The free cells around which a way may turn: beside two free ones, and one between these that is not.
    pub fn corners(&self) -> impl Iterator<Item = usize> {
        let side = self.side as isize;
        let free = move |row: isize, column: isize| {
            let inside = (0..side).contains(&row) && (0..side).contains(&column);
            inside.then(|| self.is_free((row * side + column) as usize))
        };
        (0..self.cells()).filter(move |cell| {
            let (row, column) = (*cell as isize / side, *cell as isize % side);
            let turns = |(up, right): (isize, isize)| {
                free(row + up, column + right) == Some(false)
                    && free(row + up, column) == Some(true)
                    && free(row, column + right) == Some(true)
            };
            self.is_free(*cell) && [(-1, -1), (-1, 1), (1, -1), (1, 1)].into_iter().any(turns)
        })
    }

    /// The free cell whose centre is nearest to a place, if there is any.
    #[must_use]
    pub fn nearest_free(&self, at: Vec2) -> Option<usize> {
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
