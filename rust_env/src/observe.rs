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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::bodies;

    /// Two robots (food, medicine) and two slots; what robot 1 sees in each order of victims.
    fn seen_by_medical(order: VictimOrder) -> (Vec<String>, Vec<f32>) {
        let mut scenario = Scenario { victim_order: order, ..Scenario::default() };
        scenario.robots = vec![scenario.robots[0].clone(), scenario.robots[3].clone()];
        scenario.tasks[1].needs = vec!["food".into()];
        let (team, tasks) = (bodies(&scenario), Needs::of_tasks(&scenario));
        let layout = Layout::new(&scenario, &tasks);
        let victim = |task, x| Some(Victim { id: 0, task, appeared_step: 0, position: Vec2::new(x, 0.0) });
        // The near one needs food alone; the far one food and medicine.
        let victims = [victim(1, 0.5), victim(0, -0.5)];
        let (at, moving) =
            ([Vec2::new(0.1, 0.2), Vec2::new(0.4, 0.0)], [Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)]);
        let mut rows = vec![f32::NAN; 2 * layout.width()];
        layout.write(&team, &tasks, &at, &moving, &victims, &mut rows);
        (layout.names(), rows.split_off(layout.width()))
    }

    #[test]
    fn a_row_is_own_then_teammates_then_victims() {
        let (names, row) = seen_by_medical(VictimOrder::Slot);
        let expected = [
            ("own.position.x", 0.4),
            ("own.position.y", 0.0),
            ("own.velocity.x", 0.0),
            ("own.velocity.y", 1.0),
            ("own.ability.food", 0.0),
            ("own.ability.medicine", 1.0),
            ("own.available", 1.0),
            ("teammate_0.relative_position.x", -0.3),
            ("teammate_0.relative_position.y", 0.2),
            ("teammate_0.relative_velocity.x", 1.0),
            ("teammate_0.relative_velocity.y", -1.0),
            ("teammate_0.ability.food", 1.0),
            ("teammate_0.ability.medicine", 0.0),
            ("teammate_0.available", 1.0),
            ("victim_0.present", 1.0),
            ("victim_0.need.food", 1.0),
            ("victim_0.need.medicine", 0.0),
            ("victim_0.relative_position.x", 0.1),
            ("victim_0.relative_position.y", 0.0),
            ("victim_1.present", 1.0),
            ("victim_1.need.food", 1.0),
            ("victim_1.need.medicine", 1.0),
            ("victim_1.relative_position.x", -0.9),
            ("victim_1.relative_position.y", 0.0),
        ];
        assert_eq!(names, expected.map(|(name, _)| name));
        for ((name, wanted), value) in expected.iter().zip(&row) {
            assert!((wanted - value).abs() < 1e-6, "{name} = {value}");
        }
    }

    #[test]
    fn victims_it_can_help_come_first() {
        let (_, by_slot) = seen_by_medical(VictimOrder::Slot);
        let (_, relevant) = seen_by_medical(VictimOrder::Relevant);
        assert_eq!(relevant[14..19], by_slot[19..24]);
        assert_eq!(relevant[19..24], by_slot[14..19]);
        assert_eq!(relevant[..14], by_slot[..14]);
    }
}
