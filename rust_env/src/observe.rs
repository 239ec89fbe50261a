//! Observations: world → one row of numbers for each robot, with named columns.

mod headings;
mod nearest;
mod radio;
mod rays;
mod sight;
mod stores;

use crate::fault::{HEALTHY, KINDS, Kind, Levels};
use crate::geometry::Vec2;
use crate::radio::Radio;
use crate::rays::Rays;
use crate::robot::Body;
use crate::scenario::{MAX_VICTIMS, Scenario, VictimOrder};
use crate::sight::Sight;
use crate::tasks::deadline::Deadlines;
use crate::tasks::order::Order;
use crate::tasks::service::Service;
use crate::tasks::{Needs, Victim};
use crate::wheels::{Heading, Wheels};
use nearest::Nearest;
use stores::Stores;

/// The true state of a world, as far as robots can see it.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The robots' constants.
    pub team: &'a [Body],
    /// What each task needs.
    pub tasks: &'a [Needs],
    /// Places of the robots, m.
    pub positions: &'a [Vec2],
    /// Velocities of the robots, m/s.
    pub velocities: &'a [Vec2],
    /// Where robots on wheels point; none where no robot has any.
    pub headings: &'a [Heading],
    /// Charges of the robots, J; none where no robot has a battery.
    pub charges: &'a [f64],
    /// Loads of the robots; none where no robot has one.
    pub loads: &'a [u32],
    /// Places of the obstacles, m.
    pub obstacles: &'a [Vec2],
    /// Victims by slot.
    pub victims: &'a [Option<Victim>],
    /// When robots last saw each other and the victims, see [`Sight::look`]; none where all see everything.
    pub sightings: &'a [u32],
    /// Whom robots hear, as bits; none where everybody hears everybody.
    pub heard: &'a [u64],
    /// What robots were told of the victims, see [`Radio::told`]; none where nothing is shared.
    pub told: &'a [u32],
    /// Steps done in the episode.
    pub step: u32,
}

/// What stands between a robot and what there is to see.
#[derive(Debug, Clone, Copy)]
pub struct Senses<'a> {
    /// How far from its place the robot takes itself to be, m.
    pub position_error: Vec2,
    /// How far from its velocity it takes its own to be, m/s.
    pub velocity_error: Vec2,
    /// Whether it hears nothing of its teammates.
    pub deaf: bool,
    /// Robots that are not available, as bits.
    pub unavailable: u64,
    /// Robots that have left the arena, as bits: nobody sees them, and they see nothing.
    pub absent: u64,
    /// The faults in effect, one for each robot; none while all are healthy.
    pub levels: &'a [Levels],
}

/// The fixed order of an observation's columns, read off a valid scenario.
#[derive(Debug, Clone)]
pub struct Layout {
    abilities: Vec<String>,
    robots: usize,
    /// Teammates in a row.
    mates: usize,
    /// Victims in a row.
    victims: usize,
    sorted: VictimOrder,
    /// Whence rows with the nearest teammates are taken; none where rows have all, in team order.
    nearest: Option<Nearest>,
    /// Whether each robot's block has the faults in effect.
    faults: bool,
    /// For each task, how many of each ability it needs.
    needs: Vec<Vec<f32>>,
    /// For each task, how long its victims are served; none where all are rescued at touch.
    services: Option<Vec<Service>>,
    deadlines: Option<Deadlines>,
    order: Option<Order>,
    stores: Option<Stores>,
    wheels: Option<Wheels>,
    sight: Option<Sight>,
    radio: Option<Radio>,
    rays: Option<Rays>,
    /// Whether each teammate's block says whether it is heard.
    hears: bool,
    /// Whether rows hold nothing but bodies, motion and victims.
    plain: bool,
    widths: Widths,
    /// The columns that never change, of all robots (R × D); zeros elsewhere.
    fixed: Vec<f32>,
}

/// Numbers of columns, counted once.
#[derive(Debug, Clone, Copy, Default)]
struct Widths {
    /// Of one robot.
    robot: usize,
    /// Of the ways to the nearest station and depot, of the turn rate and of the rays, behind a robot's own block.
    ways: usize,
    /// Of the rays.
    rays: usize,
    /// Of one teammate: those of a robot, whether it is seen, for how long it was not, and whether it is heard.
    mate: usize,
    /// Before those of victims.
    victims_from: usize,
    /// Of one victim.
    victim: usize,
    /// Of its service, its deadline and the order of its task.
    times: usize,
    /// Of a heading, at the end of a robot's block, and of a bearing, at that of a victim's: two, or none.
    heading: usize,
    /// Of a whole row.
    row: usize,
}

impl Layout {
    /// The columns of `scenario`.
    #[must_use]
    pub(crate) fn new(
        scenario: &Scenario,
        tasks: &[Needs],
        sight: Option<Sight>,
        radio: Option<Radio>,
        rays: Option<Rays>,
    ) -> Self {
        let abilities: Vec<String> = scenario.abilities().iter().map(ToString::to_string).collect();
        let amounts =
            |needs: &Needs| (0..abilities.len() as u32).map(|ability| needs.amount(ability)).collect();
        let needs = tasks.iter().map(amounts).collect();
        let teammates = scenario.robots.len() - 1;
        let mut layout = Self {
            robots: scenario.robots.len(),
            mates: scenario.observed_teammates.map_or(teammates, |most| most.min(teammates)),
            victims: scenario.observed_victims.unwrap_or(MAX_VICTIMS).min(scenario.num_victims()),
            sorted: scenario.victim_order,
            nearest: None,
            faults: scenario.observe_faults,
            services: Some(Service::of_tasks(scenario)).filter(|_| scenario.has_services()),
            deadlines: Deadlines::new(scenario),
            order: Order::new(scenario),
            stores: Stores::new(scenario),
            wheels: Wheels::new(scenario),
            sight: sight.clone(),
            radio: radio.clone(),
            rays: rays.clone(),
            hears: scenario.communication.is_some_and(|one| one.limits()),
            plain: false,
            widths: Widths::default(),
            abilities,
            needs,
            fixed: vec![],
        };
        layout.plain = layout.stores.is_none() && layout.sight.is_none() && layout.wheels.is_none();
        layout.widths = layout.count_columns();
        if scenario.observed_teammates.is_some() {
            let all = Scenario { observed_teammates: None, ..scenario.clone() };
            layout.nearest = Some(Nearest::of(Self::new(&all, tasks, sight, radio, rays)));
        } else {
            layout.fixed = layout.fixed_columns(scenario);
        }
        layout
    }

    /// Abilities and availability, own first and then the teammates' in team order.
    fn fixed_columns(&self, scenario: &Scenario) -> Vec<f32> {
        let mut fixed = vec![0.0; self.robots * self.width()];
        for (own, row) in fixed.chunks_exact_mut(self.width()).enumerate() {
            let others = (0..self.robots).filter(|other| *other != own);
            for (block, robot) in self.blocks(row).zip(std::iter::once(own).chain(others)) {
                for (column, ability) in block[4..].iter_mut().zip(&self.abilities) {
                    *column = scenario.robots[robot].abilities.amount(ability) as f32;
                }
                block[self.availability()] = 1.0;
                self.write_levels(&HEALTHY, block);
            }
        }
        fixed
    }

    /// Column of availability in a robot's block.
    fn availability(&self) -> usize {
        4 + self.abilities.len()
    }

    /// The first column of charge and load in a robot's block, where there are such.
    fn stores_from(&self) -> usize {
        self.availability() + if self.faults { KINDS.len() } else { 1 }
    }

    /// Writes the faults in effect into a robot's block, if they are to be seen.
    fn write_levels(&self, levels: &Levels, block: &mut [f32]) {
        let shown = KINDS.into_iter().filter(|kind| *kind != Kind::Unavailable);
        for (column, kind) in block[self.availability() + 1..self.stores_from()].iter_mut().zip(shown) {
            *column = levels[kind as usize];
        }
    }

    fn count_columns(&self) -> Widths {
        let stores = self.stores.as_ref();
        let heading = 2 * usize::from(self.wheels.is_some());
        let robot = self.stores_from() + stores.map_or(0, Stores::robot_width) + heading;
        let limited = usize::from(self.sight.is_some());
        let times = [self.services.is_some(), self.deadlines.is_some(), self.order.is_some()];
        let times = times.into_iter().filter(|there| *there).count();
        let victim = 3 + self.abilities.len() + times + limited + heading;
        let rays = self.rays.as_ref().map_or(0, Rays::width);
        let ways = stores.map_or(0, Stores::ways_width) + usize::from(self.wheels.is_some()) + rays;
        let mate = robot + 2 * limited + usize::from(self.hears);
        let victims_from = robot + ways + self.mates * mate;
        let row = victims_from + self.victims * victim;
        Widths { robot, ways, rays, mate, victims_from, victim, times, heading, row }
    }

    /// The blocks of the robot itself and of its teammates.
    fn blocks<'a>(&self, row: &'a mut [f32]) -> impl Iterator<Item = &'a mut [f32]> {
        let (own, rest) = row.split_at_mut(self.widths.robot);
        let mates = self.mates * self.widths.mate;
        let mates = &mut rest[self.widths.ways..][..mates];
        std::iter::once(own).chain(mates.chunks_exact_mut(self.widths.mate))
    }

    /// Width D of a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.widths.row
    }

    /// The name of every column; units are m, m/s and rad/s, flags are 0 or 1, abilities are 0 or 1 or
    /// amounts, needs are counts or amounts, `charge`, `load`, `served`, `time_left`, `since_seen` and `ray` are
    /// shares, and `heading` is a vector of length 1.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names = Vec::with_capacity(self.width());
        for robot in 0..=self.mates {
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
            if self.faults {
                let shown = KINDS.iter().filter(|kind| **kind != Kind::Unavailable);
                names.extend(shown.map(|kind| format!("{who}.fault.{}", kind.name())));
            }
            let stores = self.stores.as_ref();
            names.extend(stores.into_iter().flat_map(Stores::names).map(|name| format!("{who}.{name}")));
            let heading = ["x", "y"].into_iter().filter(|_| self.wheels.is_some());
            names.extend(heading.map(|axis| format!("{who}.heading.{axis}")));
            if robot == 0 {
                names.extend(stores.into_iter().flat_map(Stores::names_of_ways));
                names.extend(self.wheels.iter().map(|_| format!("{who}.turn_rate")));
                names.extend((0..self.widths.rays).map(|ray| format!("{who}.ray.{ray}")));
                continue;
            }
            if self.sight.is_some() {
                names.extend(["seen", "since_seen"].map(|name| format!("{who}.{name}")));
            }
            if self.hears {
                names.push(format!("{who}.heard"));
            }
        }
        for victim in 0..self.victims {
            names.push(format!("victim_{victim}.present"));
            names.extend(self.abilities.iter().map(|ability| format!("victim_{victim}.need.{ability}")));
            names.extend(["x", "y"].map(|axis| format!("victim_{victim}.relative_position.{axis}")));
            names.extend(self.services.iter().map(|_| format!("victim_{victim}.served")));
            names.extend(self.deadlines.iter().map(|_| format!("victim_{victim}.time_left")));
            names.extend(self.order.iter().map(|_| format!("victim_{victim}.blocked")));
            names.extend(self.sight.iter().map(|_| format!("victim_{victim}.since_seen")));
            let bearing = ["ahead", "left"].into_iter().filter(|_| self.wheels.is_some());
            names.extend(bearing.map(|side| format!("victim_{victim}.{side}")));
        }
        names
    }

    /// Writes the rows of all robots of one world into `rows` (R × D), as healthy robots see it.
    pub fn write(&self, scene: Scene, rows: &mut [f32]) {
        if let Some(nearest) = &self.nearest {
            return nearest.write(self, scene, rows);
        }
        rows.copy_from_slice(&self.fixed);
        for (own, row) in rows.chunks_exact_mut(self.width()).enumerate() {
            self.write_row(scene, own, Vec2::zeros(), Vec2::zeros(), row);
            if let Some(sight) = &self.sight {
                self.hide_mates(sight, scene, own, row);
            }
            if self.hears {
                self.write_heard(scene, own, row);
            }
            if let Some(rays) = &self.rays {
                self.write_rays(rays, scene, own, 0, row);
            }
        }
    }

    /// Writes what robot `own` sees through its `senses` into `row` (D).
    pub fn write_through(&self, scene: Scene, own: usize, senses: &Senses, row: &mut [f32]) {
        if let Some(nearest) = &self.nearest {
            return nearest.write_through(self, scene, own, senses, row);
        }
        row.copy_from_slice(&self.fixed[own * self.width()..][..self.width()]);
        self.write_row(scene, own, senses.position_error, senses.velocity_error, row);
        if senses.absent >> own & 1 == 1 {
            return row.fill(0.0);
        }
        let others = (0..self.robots).filter(|other| *other != own);
        for (block, robot) in self.blocks(row).zip(std::iter::once(own).chain(others)) {
            if senses.deaf && robot != own || senses.absent >> robot & 1 == 1 {
                block.fill(0.0);
                continue;
            }
            block[self.availability()] = (!senses.unavailable >> robot & 1) as f32;
            self.write_levels(senses.levels.get(robot).unwrap_or(&HEALTHY), block);
        }
        if let Some(sight) = &self.sight {
            self.hide_mates(sight, scene, own, row);
        }
        if self.hears {
            self.write_heard(scene, own, row);
        }
        if let Some(rays) = &self.rays {
            self.write_rays(rays, scene, own, senses.absent, row);
        }
    }

    /// Leaves a robot nothing of its row but what it knows of itself: abilities, availability, faults,
    /// charge, load.
    pub fn darken(&self, row: &mut [f32]) {
        row[..4].fill(0.0);
        row[self.widths.robot - self.widths.heading..].fill(0.0);
    }

    /// Writes what changes in a row, of a robot that takes itself to be elsewhere by these errors.
    fn write_row(
        &self,
        scene: Scene,
        own: usize,
        position_error: Vec2,
        velocity_error: Vec2,
        row: &mut [f32],
    ) {
        let position = scene.positions[own] + position_error;
        let velocity = scene.velocities[own] + velocity_error;
        let others = (0..self.robots).filter(|other| *other != own);
        let (block, rest) = row.split_at_mut(self.widths.robot);
        block[..4].copy_from_slice(&[position.x, position.y, velocity.x, velocity.y]);
        let mates = rest[self.widths.ways..].chunks_exact_mut(self.widths.mate);
        for (block, other) in mates.zip(others) {
            let (place, speed) = (scene.positions[other] - position, scene.velocities[other] - velocity);
            block[..4].copy_from_slice(&[place.x, place.y, speed.x, speed.y]);
        }
        if self.plain {
            let victims = &mut row[self.widths.victims_from..];
            return self.write_victims(scene, &scene.team[own], position, &[], victims);
        }
        self.write_more(scene, own, position, row);
    }

    /// Writes the victims, and what robots have but bodies and motion.
    #[inline(never)] // worlds without such robots are faster without it
    fn write_more(&self, scene: Scene, own: usize, position: Vec2, row: &mut [f32]) {
        if let Some(stores) = &self.stores {
            let others = (0..self.robots).filter(|other| *other != own);
            for (block, robot) in self.blocks(row).zip(std::iter::once(own).chain(others)) {
                stores.write(scene, robot, &mut block[self.stores_from()..]);
            }
            stores.write_ways(position, &mut row[self.widths.robot..]);
        }
        let victims = &mut row[self.widths.victims_from..];
        match &self.sight {
            None => self.write_victims(scene, &scene.team[own], position, &[], victims),
            Some(sight) => self.write_seen(sight, scene, own, position, victims),
        }
        if let Some(wheels) = &self.wheels {
            self.write_headings(wheels, scene, own, row);
        }
    }

    /// Column of the time since it was last seen in a victim's block, where sight is limited.
    fn since_seen(&self) -> usize {
        self.widths.victim - 1 - self.widths.heading
    }

    #[allow(clippy::inline_always)] // twice, and one of the two is the hottest path of all
    #[inline(always)]
    fn write_victims(&self, scene: Scene, body: &Body, own: Vec2, since: &[f32], rows: &mut [f32]) {
        let Scene { tasks, victims, step, .. } = scene;
        let mut sorted = [(0_u8, 0.0_f32, 0_u8); MAX_VICTIMS];
        for (slot, victim) in victims.iter().enumerate() {
            let (kind, distance) = match self.sorted {
                VictimOrder::Relevant => rank(victim.as_ref(), body, tasks, own),
                VictimOrder::Slot => (0, 0.0),
            };
            // Into its place among those before it: there are few, and equals keep their order.
            let later = |other: &(u8, f32, u8)| (other.0, other.1) > (kind, distance);
            let mut place = slot;
            while place > 0 && later(&sorted[place - 1]) {
                sorted[place] = sorted[place - 1];
                place -= 1;
            }
            sorted[place] = (kind, distance, slot as u8);
        }
        for ((_, _, slot), row) in sorted.iter().zip(rows.chunks_exact_mut(self.widths.victim)) {
            let Some(victim) = &victims[usize::from(*slot)] else { continue };
            let place = victim.position - own;
            let abilities = self.abilities.len();
            row[0] = 1.0;
            // A loop: a call to copy so few numbers takes longer than they do.
            for (column, need) in row[1..].iter_mut().zip(&self.needs[victim.task as usize]) {
                *column = *need;
            }
            (row[1 + abilities], row[2 + abilities]) = (place.x, place.y);
            if self.widths.times > 0 {
                self.write_times(victim, victims, step, row);
            }
            if let Some(since) = since.get(usize::from(*slot)) {
                row[self.since_seen()] = *since;
            }
        }
    }

    /// Writes how far a victim is served, how long it can wait, and whether it has to.
    #[inline(never)] // worlds without such victims are faster without it
    fn write_times(&self, victim: &Victim, victims: &[Option<Victim>], step: u32, row: &mut [f32]) {
        let mut column = 3 + self.abilities.len();
        if let Some(services) = &self.services {
            row[column] = services[victim.task as usize].share(victim);
            column += 1;
        }
        if let Some(deadlines) = &self.deadlines {
            row[column] = deadlines.share_left(victim, step);
            column += 1;
        }
        if let Some(order) = &self.order {
            row[column] = f32::from(u8::from(order.is_blocked(victim, victims)));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::bodies;

    /// Two robots (food, medicine) and two slots; what robot 1 sees in each order of victims.
    fn seen_by_medical(order: VictimOrder) -> (Vec<String>, Vec<f32>) {
        let mut scenario = Scenario { victim_order: order, ..Scenario::default() };
        scenario.robots = vec![scenario.robots[0].clone(), scenario.robots[3].clone()];
        scenario.tasks[1].needs = vec!["food".into()].into();
        let (team, tasks) = (bodies(&scenario), Needs::of_tasks(&scenario));
        let layout = Layout::new(&scenario, &tasks, None, None, None);
        let victim = |task, x| Some(Victim::new(0, task, 0, Vec2::new(x, 0.0)));
        // The near one needs food alone; the far one food and medicine.
        let victims = [victim(1, 0.5), victim(0, -0.5)];
        let (at, moving) =
            ([Vec2::new(0.1, 0.2), Vec2::new(0.4, 0.0)], [Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)]);
        let mut rows = vec![f32::NAN; 2 * layout.width()];
        let scene = Scene {
            team: &team,
            tasks: &tasks,
            positions: &at,
            velocities: &moving,
            headings: &[],
            charges: &[],
            loads: &[],
            obstacles: &[],
            victims: &victims,
            sightings: &[],
            heard: &[],
            told: &[],
            step: 0,
        };
        layout.write(scene, &mut rows);
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
