//! Observations: world → one row of numbers for each robot, with named columns.

use crate::geometry::Vec2;
use crate::robot::Body;
use crate::scenario::{Scenario, VictimOrder};
use crate::task::{Needs, Victim};

/// The fixed order of an observation's columns, read off a valid scenario.
#[derive(Debug, Clone)]
pub struct Layout {
    abilities: Vec<String>,
    robots: usize,
    victims: usize,
    order: VictimOrder,
    /// For each task, how many of each ability it needs.
    needs: Vec<Vec<f32>>,
}

impl Layout {
    /// The columns of `scenario`.
    #[must_use]
    pub fn new(scenario: &Scenario, tasks: &[Needs]) -> Self {
        let abilities: Vec<String> = scenario.abilities().iter().map(ToString::to_string).collect();
        let count = |needs: &Needs| {
            let number = |ability| needs.abilities().iter().filter(|need| **need == ability).count() as f32;
            (0..abilities.len() as u32).map(number).collect()
        };
        let needs = tasks.iter().map(count).collect();
        Self {
            robots: scenario.robots.len(),
            victims: scenario.num_victims(),
            order: scenario.victim_order,
            abilities,
            needs,
        }
    }

    /// Width D of a row.
    #[must_use]
    pub fn width(&self) -> usize {
        let abilities = self.abilities.len();
        self.robots * (5 + abilities) + self.victims * (3 + abilities)
    }

    /// The name of every column; units are m and m/s, flags and abilities are 0 or 1, needs are counts.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names = Vec::with_capacity(self.width());
        for robot in 0..self.robots {
            let (who, relative) = if robot == 0 {
                ("own".to_string(), "")
            } else {
                (format!("teammate_{}", robot - 1), "relative_")
            };
            for quantity in ["position", "velocity"] {
                for axis in ["x", "y"] {
                    names.push(format!("{who}.{relative}{quantity}.{axis}"));
                }
            }
            names.extend(self.abilities.iter().map(|ability| format!("{who}.ability.{ability}")));
            names.push(format!("{who}.available"));
        }
        for victim in 0..self.victims {
            names.push(format!("victim_{victim}.present"));
            names.extend(self.abilities.iter().map(|ability| format!("victim_{victim}.need.{ability}")));
            names.extend(["x", "y"].map(|axis| format!("victim_{victim}.relative_position.{axis}")));
        }
        names
    }

    /// Writes the rows of all robots of one world into `rows` (R × D).
    pub fn write(
        &self,
        team: &[Body],
        tasks: &[Needs],
        positions: &[Vec2],
        velocities: &[Vec2],
        victims: &[Option<Victim>],
        rows: &mut [f32],
    ) {
        for (own, row) in rows.chunks_exact_mut(self.width()).enumerate() {
            let mut row = Row { row, next: 0 };
            self.write_robot(&mut row, positions[own], velocities[own], &team[own]);
            for other in (0..self.robots).filter(|other| *other != own) {
                let position = positions[other] - positions[own];
                self.write_robot(&mut row, position, velocities[other] - velocities[own], &team[other]);
            }
            self.write_victims(&mut row, &team[own], tasks, positions[own], victims);
        }
    }

    fn write_robot(&self, row: &mut Row, position: Vec2, velocity: Vec2, body: &Body) {
        row.extend([position.x, position.y, velocity.x, velocity.y]);
        row.extend((0..self.abilities.len()).map(|ability| (body.abilities >> ability & 1) as f32));
        row.extend([1.0]);
    }

    fn write_victims(
        &self,
        row: &mut Row,
        body: &Body,
        tasks: &[Needs],
        own: Vec2,
        victims: &[Option<Victim>],
    ) {
        let mut order = [0_u8; crate::scenario::MAX_VICTIMS];
        let order = &mut order[..victims.len()];
        order.iter_mut().enumerate().for_each(|(slot, number)| *number = slot as u8);
        if self.order == VictimOrder::Relevant {
            order.sort_by(|a, b| {
                let rank = |slot: u8| rank(victims[usize::from(slot)].as_ref(), body, tasks, own);
                let (left, right) = (rank(*a), rank(*b));
                left.0.cmp(&right.0).then(left.1.total_cmp(&right.1))
            });
        }
        for slot in order {
            match &victims[usize::from(*slot)] {
                Some(victim) => {
                    let place = victim.position - own;
                    row.extend([1.0]);
                    row.extend(self.needs[victim.task as usize].iter().copied());
                    row.extend([place.x, place.y]);
                }
                None => row.extend(std::iter::repeat_n(0.0, 3 + self.abilities.len())),
            }
        }
    }
}

/// Sorting key of a victim for a robot: helpable first, absent last; then the nearer.
fn rank(victim: Option<&Victim>, body: &Body, tasks: &[Needs], own: Vec2) -> (u8, f32) {
    match victim {
        Some(victim) => {
            let helped = tasks[victim.task as usize].helped_by(body.abilities);
            (u8::from(!helped), (victim.position - own).norm_squared())
        }
        None => (2, 0.0),
    }
}

/// A row that is written from left to right.
struct Row<'a> {
    row: &'a mut [f32],
    next: usize,
}

impl Row<'_> {
    fn extend(&mut self, values: impl IntoIterator<Item = f32>) {
        for value in values {
            self.row[self.next] = value;
            self.next += 1;
        }
    }
}
