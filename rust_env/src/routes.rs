//! The ways of a team around the obstacles of its worlds. Fields are kept between calls, as goals and
//! obstacles mostly stay where they are.

use std::collections::HashMap;

use crate::blocks::Blocks;
use crate::corners::{CornerWays, Corners};
use crate::distance_field::DistanceField;
use crate::free_space::{FreeSpace, Way};
use crate::geometry::{Solid, Vec2};
use crate::place::Placed;
use crate::rules::Rules;
use crate::scenario::Engine;

/// Cells of all fields that are kept.
const MOST_KEPT: usize = 1 << 23;
/// Length of a way out of where there is no room for the disc, for each metre; more than any detour is
/// longer than the way that it avoids.
const STEEP: f32 = 4.0;
/// Calls for which a field is kept in any case: a step of a script has two.
const RECENT: u64 = 4;

/// Robots of one size and layer: the same stands in their way.
#[derive(PartialEq)]
struct Size {
    radius: f32,
    /// Indices of the obstacles that block them.
    obstacles: Vec<usize>,
    /// Whether the map blocks them.
    map: bool,
}

/// What a space is known by: the size of robots, and the bits of the places of their obstacles.
type SpaceKey = (usize, Vec<[u32; 2]>);

/// Free cells around some obstacles, their corners, and what is known of goals by the bits of their places, with
/// the call that used it last.
struct Known {
    space: FreeSpace,
    corners: Option<Corners>,
    fields: HashMap<[u32; 2], (u64, Field)>,
}

/// Ways to one goal: by corners, and by cells where these lead nowhere.
struct Field {
    goal: Vec2,
    reach: f32,
    by_corners: Option<CornerWays>,
    by_cells: DistanceField,
}

impl Field {
    fn new(space: &FreeSpace, corners: Option<&Corners>, goal: Vec2, reach: f32) -> Self {
        let by_corners = corners.map(|corners| CornerWays::new(space, corners, goal, reach));
        Self { goal, reach, by_corners, by_cells: DistanceField::new(goal, reach) }
    }

    /// The way from a place. Where the disc has no room, it first leaves that place the shortest way.
    fn way(&mut self, space: &FreeSpace, corners: Option<&Corners>, from: Vec2) -> Way {
        if space.is_clear(from, self.goal, self.reach) {
            return Way { length: (self.goal - from).norm(), next: self.goal };
        }
        let none = Way { length: f32::INFINITY, next: self.goal };
        if space.is_free(space.cell(from)) {
            return self.around(space, corners, from).unwrap_or(none);
        }
        let Some(centre) = space.nearest_free(from).map(|cell| space.centre(cell)) else { return none };
        let way = self.around(space, corners, centre).unwrap_or(none);
        Way { length: STEEP * (centre - from).norm() + way.length, next: centre }
    }

    fn around(&mut self, space: &FreeSpace, corners: Option<&Corners>, from: Vec2) -> Option<Way> {
        let known = self.by_corners.as_ref().zip(corners);
        known
            .and_then(|(ways, corners)| ways.way(space, corners, from))
            .or_else(|| self.by_cells.way(space, from))
    }
}

/// Finds ways for the robots of one scenario.
pub struct Routes {
    solids: Vec<Solid>,
    blocks: Option<Blocks>,
    sizes: Vec<Size>,
    /// The size of each robot; none for one that nothing blocks.
    of: Vec<Option<usize>>,
    half: f32,
    reach: f32,
    known: HashMap<SpaceKey, Known>,
    calls: u64,
}

impl Routes {
    /// Ways for the team that plays by these rules.
    #[must_use]
    pub fn new(rules: &Rules) -> Self {
        let blocked = rules.scenario.blocked();
        let blocks = rules.blocks.clone();
        let mut sizes: Vec<Size> = vec![];
        let mut size = |radius: f32, layer: u64| {
            let obstacles: Vec<usize> =
                (0..blocked.len()).filter(|index| blocked[*index] & layer != 0).collect();
            let map = blocks.as_ref().is_some_and(|blocks| blocks.block(layer));
            if obstacles.is_empty() && !map || rules.scenario.engine == Engine::None {
                return None;
            }
            let size = Size { radius, obstacles, map };
            Some(sizes.iter().position(|one| *one == size).unwrap_or_else(|| {
                sizes.push(size);
                sizes.len() - 1
            }))
        };
        Self {
            of: rules.team.iter().map(|body| size(body.radius, body.layer)).collect(),
            solids: rules.solids.clone(),
            blocks,
            sizes,
            half: rules.scenario.arena_half_width_m as f32,
            reach: rules.scenario.rescue_radius_m as f32,
            known: HashMap::new(),
            calls: 0,
        }
    }

    /// Begins a call: fields that no recent one used may be forgotten where there are too many.
    pub fn begin(&mut self) {
        if self.cells() > MOST_KEPT {
            for known in self.known.values_mut() {
                known.fields.retain(|_, (call, _)| *call + RECENT > self.calls);
            }
            self.known.retain(|_, known| !known.fields.is_empty());
        }
        self.calls += 1;
    }

    /// Cells of all that is kept, at most.
    fn cells(&self) -> usize {
        self.known.values().map(|known| known.space.cells() * (1 + known.fields.len())).sum()
    }

    /// The way of a robot in a world with these obstacles.
    pub fn way(&mut self, robot: usize, obstacles: &[Vec2], from: Vec2, goal: Vec2) -> Way {
        let Some(size) = self.of[robot] else { return Way { length: (goal - from).norm(), next: goal } };
        let (space, corners, field) = self.field(size, obstacles, goal);
        field.way(space, corners, from)
    }

    /// Length of the way that is left for a robot that drives straight `towards` a place, as far as it comes.
    pub fn left(&mut self, robot: usize, obstacles: &[Vec2], from: Vec2, towards: Vec2, goal: Vec2) -> f32 {
        let Some(size) = self.of[robot] else { return (goal - towards).norm() };
        let (space, corners, field) = self.field(size, obstacles, goal);
        field.way(space, corners, space.stopped(from, towards)).length
    }

    fn field(
        &mut self,
        size: usize,
        obstacles: &[Vec2],
        goal: Vec2,
    ) -> (&FreeSpace, Option<&Corners>, &mut Field) {
        let Self { solids, blocks, sizes, half, reach, known, calls, .. } = self;
        let Size { radius, obstacles: own, map } = &sizes[size];
        let bits = |at: Vec2| [at.x.to_bits(), at.y.to_bits()];
        let key = (size, own.iter().map(|index| bits(obstacles[*index])).collect());
        let Known { space, corners, fields } = known.entry(key).or_insert_with(|| {
            let placed = |index: &usize| (&solids[*index], obstacles[*index]);
            let placed: Vec<Placed> = own.iter().map(placed).collect();
            let space = FreeSpace::new(*half, *radius, &placed, blocks.as_ref().filter(|_| *map));
            Known { corners: Corners::new(&space), space, fields: HashMap::new() }
        });
        let corners = corners.as_ref();
        let new = || (*calls, Field::new(space, corners, goal, *reach));
        let (used, field) = fields.entry(bits(goal)).or_insert_with(new);
        *used = *calls;
        (space, corners, field)
    }
}
