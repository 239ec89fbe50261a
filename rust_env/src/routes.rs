//! The ways of a team around the obstacles of its worlds. Fields are kept between calls, as goals and
//! obstacles mostly stay where they are.

use std::collections::HashMap;

use crate::distance_field::{DistanceField, FreeSpace, Way};
use crate::geometry::{Solid, Vec2};
use crate::place::Placed;
use crate::rules::Rules;
use crate::scenario::Engine;

/// Cells of all fields that are kept.
const MOST_KEPT: usize = 1 << 23;
/// Calls for which a field is kept in any case: a step of a script has two.
const RECENT: u64 = 4;

/// Robots of one size and layer: the same stands in their way.
struct Size {
    radius: f32,
    /// Indices of the obstacles that block them.
    obstacles: Vec<usize>,
}

/// What a space is known by: the size of robots, and the bits of the places of their obstacles.
type SpaceKey = (usize, Vec<[u32; 2]>);

/// Free cells around some obstacles, and the fields over them by the bits of their goals, with the call that used
/// them last.
struct Known {
    space: FreeSpace,
    fields: HashMap<[u32; 2], (u64, DistanceField)>,
}

/// Finds ways for the robots of one scenario.
pub struct Routes {
    solids: Vec<Solid>,
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
        let mut sizes: Vec<Size> = vec![];
        let mut size = |radius: f32, layer: u64| {
            let obstacles: Vec<usize> =
                (0..blocked.len()).filter(|index| blocked[*index] & layer != 0).collect();
            if obstacles.is_empty() || rules.scenario.engine == Engine::None {
                return None;
            }
            let same = |one: &Size| one.radius.to_bits() == radius.to_bits() && one.obstacles == obstacles;
            Some(sizes.iter().position(same).unwrap_or_else(|| {
                sizes.push(Size { radius, obstacles });
                sizes.len() - 1
            }))
        };
        Self {
            of: rules.team.iter().map(|body| size(body.radius, body.layer)).collect(),
            solids: rules.solids.clone(),
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
        let (space, field) = self.field(size, obstacles, goal);
        field.way(space, from)
    }

    /// Length of the way that is left for a robot that drives straight `towards` a place, as far as it comes.
    pub fn left(&mut self, robot: usize, obstacles: &[Vec2], from: Vec2, towards: Vec2, goal: Vec2) -> f32 {
        let Some(size) = self.of[robot] else { return (goal - towards).norm() };
        let (space, field) = self.field(size, obstacles, goal);
        field.way(space, space.stopped(from, towards)).length
    }

    fn field(&mut self, size: usize, obstacles: &[Vec2], goal: Vec2) -> (&FreeSpace, &mut DistanceField) {
        let Self { solids, sizes, half, reach, known, calls, .. } = self;
        let Size { radius, obstacles: own } = &sizes[size];
        let bits = |at: Vec2| [at.x.to_bits(), at.y.to_bits()];
        let key = (size, own.iter().map(|index| bits(obstacles[*index])).collect());
        let Known { space, fields } = known.entry(key).or_insert_with(|| {
            let placed = |index: &usize| (&solids[*index], obstacles[*index]);
            let placed: Vec<Placed> = own.iter().map(placed).collect();
            Known { space: FreeSpace::new(*half, *radius, &placed), fields: HashMap::new() }
        });
        let (used, field) =
            fields.entry(bits(goal)).or_insert_with(|| (*calls, DistanceField::new(goal, *reach)));
        *used = *calls;
        (space, field)
    }
}
