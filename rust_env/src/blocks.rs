//! The solid cells of a map as few boxes, found by where they are.

use crate::geometry::{Solid, Vec2};
use crate::scenario::{Map, Scenario};

/// Most buckets along one side of an arena.
const MOST_BUCKETS: usize = 32;

/// A box and its centre.
type Block = (Solid, Vec2);

/// Boxes over all solid cells of a map. None overlaps another.
#[derive(Debug, Clone)]
pub struct Blocks {
    boxes: Vec<Block>,
    /// The buckets along x and y in which each box is: the first and the last of both.
    spans: Vec<[[usize; 2]; 2]>,
    /// Layers that they block, as bits.
    layers: u64,
    half: f32,
    side: usize,
    /// Numbers of the boxes in each bucket, row by row from the least y.
    buckets: Vec<Vec<usize>>,
}

impl Blocks {
    /// The boxes of a valid scenario's map, if it has one.
    #[must_use]
    pub(crate) fn of(scenario: &Scenario) -> Option<Self> {
        let map = scenario.map.as_ref()?;
        let layers = scenario.layers().into_iter().enumerate().filter(|(_, layer)| map.blocks(layer));
        let layers = layers.fold(0, |bits, (index, _)| bits | 1 << index);
        Some(Self::new(map, scenario.arena_half_width_m, layers))
    }

    /// The boxes of a valid map over an arena of half width `half`, m, which block these layers (as bits).
    #[must_use]
    pub fn new(map: &Map, half: f64, layers: u64) -> Self {
        let boxes: Vec<Block> = rectangles(map).map(|cells| placed(cells, map.rows.len(), half)).collect();
        let side = map.rows.len().min(MOST_BUCKETS);
        let mut found = Self {
            layers,
            half: half as f32,
            side,
            buckets: vec![vec![]; side * side],
            spans: vec![],
            boxes,
        };
        for (index, (solid, centre)) in found.boxes.iter().enumerate() {
            let span = found.span(*centre, solid.half_extents());
            for bucket in cells_of(span, side) {
                found.buckets[bucket].push(index);
            }
            found.spans.push(span);
        }
        found
    }

    /// All boxes and their centres, m.
    #[must_use]
    pub fn all(&self) -> &[Block] {
        &self.boxes
    }

    /// Whether they block a layer (one bit).
    #[must_use]
    pub fn block(&self, layer: u64) -> bool {
        self.layers & layer != 0
    }

    /// Each box that may be within `reach` of a place, m, once.
    pub fn near(&self, at: Vec2, reach: f32) -> impl Iterator<Item = (&Solid, Vec2)> {
        let span = self.span(at, Vec2::repeat(reach));
        cells_of(span, self.side).flat_map(move |bucket| {
            let own = self.buckets[bucket].iter();
            let own = own.filter(move |index| self.first_of_both(**index, span) == bucket);
            own.map(|index| (&self.boxes[*index].0, self.boxes[*index].1))
        })
    }

    /// Distance from a place to the nearest box, m, infinite where it is `most` or more.
    #[must_use]
    pub fn distance(&self, at: Vec2, most: f32) -> f32 {
        let distances = self.near(at, most).map(|(solid, centre)| solid.distance(at - centre));
        distances.filter(|distance| *distance < most).fold(f32::INFINITY, f32::min)
    }

    /// Whether the straight `way` on from a place leads through the inside of a box.
    #[must_use]
    pub fn is_crossed(&self, from: Vec2, way: Vec2) -> bool {
        let (middle, reach) = (from + way * 0.5, way.abs() * 0.5);
        let [columns, rows] = self.span(middle, reach);
        let width = 2.0 * self.half / self.side as f32;
        (rows[0]..=rows[1]).any(|row| {
            // The part of the way in this row of buckets, and a little more.
            let edge = |row: usize| row as f32 * width - self.half;
            let part = |row: usize| ((edge(row) - from.y) / way.y).clamp(0.0, 1.0);
            let (begins, ends) = if rows[0] == rows[1] { (0.0, 1.0) } else { (part(row), part(row + 1)) };
            let (one, other) = (from.x + way.x * begins, from.x + way.x * ends);
            let along =
                [self.index(one.min(other) - 0.01 * width), self.index(one.max(other) + 0.01 * width)];
            let columns = along[0].max(columns[0])..=along[1].min(columns[1]);
            let mut found = columns.flat_map(|column| &self.buckets[row * self.side + column]);
            found.any(|index| {
                let (solid, centre) = &self.boxes[*index];
                solid.is_crossed(from - centre, way)
            })
        })
    }

    /// Number of the bucket that holds a coordinate; the nearest one outside.
    fn index(&self, at: f32) -> usize {
        let index = (at + self.half) / (2.0 * self.half) * self.side as f32;
        (index.max(0.0) as usize).min(self.side - 1)
    }

    /// The buckets along x and along y over a rectangle with these half extents.
    fn span(&self, centre: Vec2, half: Vec2) -> [[usize; 2]; 2] {
        [0, 1].map(|axis| [self.index(centre[axis] - half[axis]), self.index(centre[axis] + half[axis])])
    }

    /// The first bucket that a box and a span share.
    fn first_of_both(&self, index: usize, span: [[usize; 2]; 2]) -> usize {
        let [column, row] = [0, 1].map(|axis| self.spans[index][axis][0].max(span[axis][0]));
        row * self.side + column
    }
}

fn cells_of([columns, rows]: [[usize; 2]; 2], side: usize) -> impl Iterator<Item = usize> {
    (rows[0]..=rows[1]).flat_map(move |row| (columns[0]..=columns[1]).map(move |column| row * side + column))
}

/// The first column and row, and those after the last.
type Cells = [usize; 4];

/// Cuts the solid cells into rectangles: each as wide as it can be from its first cell, then as high.
fn rectangles(map: &Map) -> impl Iterator<Item = Cells> {
    let side = map.rows.len();
    let mut left: Vec<bool> = (0..side * side).map(|cell| map.is_solid(cell / side, cell % side)).collect();
    (0..side * side).filter_map(move |cell| {
        if !left[cell] {
            return None;
        }
        let (row, column) = (cell / side, cell % side);
        let end = (column..side).find(|other| !left[row * side + other]).unwrap_or(side);
        let whole = |other: usize| left[other * side + column..other * side + end].iter().all(|solid| *solid);
        let below = (row..side).find(|other| !whole(*other)).unwrap_or(side);
        for other in row..below {
            left[other * side + column..other * side + end].fill(false);
        }
        Some([column, row, end, below])
    })
}

fn placed([left, top, right, bottom]: Cells, side: usize, half: f64) -> Block {
    let x = |column: usize| column as f64 / side as f64 * 2.0 * half - half;
    let y = |row: usize| -x(row);
    let centre = |low: f64, high: f64| f64::midpoint(low, high) as f32;
    let extent = |low: f64, high: f64| ((high - low) / 2.0) as f32;
    let (left, right, bottom, top) = (x(left), x(right), y(bottom), y(top));
    let solid = Solid::Box(Vec2::new(extent(left, right), extent(bottom, top)));
    (solid, Vec2::new(centre(left, right), centre(bottom, top)))
}
