//! The rules that a scenario's values obey, all of them, but for whether everything finds a place in the
//! arena, which [`crate::rules::Rules::new`] tries out.

use super::abilities::reaches;
use super::check::{broken, counts, named, within};
use super::{
    AMOUNTS, Abilities, Engine, MAX_ABILITIES, MAX_FAULTS, MAX_MASS_RATIO, MAX_MASS_RATIO_RAPIER, MAX_NEEDS,
    MAX_OBSTACLES, MAX_PLACES, MAX_ROBOTS, MAX_TIME_S, MAX_TRAVEL_RADII, MAX_VICTIMS, Robot, START_GAP_M,
    Scenario, Shape, Task, Unavailable, VictimOrder,
};
use crate::error::Result;
use crate::fault::{Fault, Kind, Spec};
use crate::matching::fillable;

impl Scenario {
    /// Checks every value and every rule between values.
    pub(crate) fn validate(&self) -> Result<()> {
        self.validate_numbers()?;
        self.validate_robots()?;
        self.validate_layers()?;
        self.validate_wheels()?;
        self.validate_tasks()?;
        self.validate_order()?;
        self.validate_obstacles()?;
        self.validate_map()?;
        self.validate_sight()?;
        self.validate_range_sensors()?;
        self.validate_communication()?;
        self.validate_faults()?;
        self.validate_sizes()?;
        self.validate_starts()?;
        self.validate_victim_places()?;
        self.validate_arrivals()?;
        self.validate_task_areas()?;
        self.validate_batteries()?;
        self.validate_loads()
    }

    fn validate_numbers(&self) -> Result<()> {
        within("arena_half_width_m", self.arena_half_width_m, 0.2, 100.0, "m")?;
        within("rescue_radius_m", self.rescue_radius_m, 0.001, 10.0, "m")?;
        within("spawn_clearance_m", self.spawn_clearance_m, 0.0, 10.0, "m")?;
        within("wall_clearance_m", self.wall_clearance_m, 0.0, 10.0, "m")?;
        within("dt_s", self.dt_s, 0.001, 1.0, "s")?;
        within("damping", self.damping, 0.0, 1.0, "")?;
        within("friction", self.friction, 0.0, 10.0, "")?;
        within("rescue_reward", self.rescue_reward, -1e6, 1e6, "")?;
        within("shaping_weight", self.shaping_weight, -1e6, 1e6, "per m")?;
        within("shaping_discount", self.shaping_discount, 0.0, 1.0, "")?;
        within("contact_cost", self.contact_cost, -1e6, 1e6, "")?;
        within("action_cost", self.action_cost, -1e6, 1e6, "")?;
        within("lost_cost", self.lost_cost, -1e6, 1e6, "")?;
        if self.engine != Engine::Rapier && self.friction != 0.0 {
            return broken("friction", &self.friction, "must be 0 where engine is not \"rapier\"");
        }
        if self.engine == Engine::None && !self.obstacles.is_empty() {
            let rule = "must be none where engine = \"none\", in which nothing is in the way";
            return broken("obstacles (their number)", &self.obstacles.len(), rule);
        }
        counts("episode_steps", self.episode_steps as usize, 1, 1_000_000)?;
        counts("substeps", self.substeps as usize, 1, 1000)?;
        counts("max_victims", self.max_victims, 1, MAX_VICTIMS)?;
        if let Some(most) = self.observed_teammates {
            counts("observed_teammates", most, 0, MAX_ROBOTS - 1)?;
        }
        if let Some(most) = self.observed_victims {
            counts("observed_victims", most, 1, MAX_VICTIMS)?;
            if self.victim_order == VictimOrder::Slot {
                let rule = "must be none where victim_order = \"slot\", which does not say who comes first";
                return broken("observed_victims", &most, rule);
            }
        }
        if let Some(rescues) = self.end_when_rescued {
            counts("end_when_rescued", rescues as usize, 1, 1_000_000)?;
        }
        Ok(())
    }

    fn validate_robots(&self) -> Result<()> {
        counts("robots (their number)", self.robots.len(), 1, MAX_ROBOTS)?;
        for (index, robot) in self.robots.iter().enumerate() {
            let key = |name: &str| format!("robots[{index}].{name}");
            named(&key("name"), &robot.name)?;
            named(&key("kind"), &robot.kind)?;
            if self.robots[..index].iter().any(|other| other.name == robot.name) {
                return broken(&key("name"), &robot.name, "names must differ");
            }
            for ability in robot.abilities.names() {
                named(&key("abilities"), ability)?;
            }
            validate_amounts(&robot.abilities, &key("abilities"))?;
            within(&key("max_speed_mps"), robot.max_speed_mps, 0.01, 100.0, "m/s")?;
            within(&key("mass_kg"), robot.mass_kg, 0.01, 1000.0, "kg")?;
            within(&key("radius_m"), robot.radius_m, 0.005, 10.0, "m")?;
            within(&key("drive_force_n"), robot.drive_force_n, 0.0, 1e5, "N")?;
        }
        self.validate_masses()?;
        counts("robots (their different abilities)", self.abilities().len(), 0, MAX_ABILITIES)
    }

    /// Refuses masses so unlike that light robots are squeezed into heavier ones of their layer.
    fn validate_masses(&self) -> Result<()> {
        let (most, instead) = match self.engine {
            Engine::Rapier => (
                MAX_MASS_RATIO_RAPIER,
                format!(" with engine = \"rapier\", and {MAX_MASS_RATIO} with \"discs\""),
            ),
            Engine::Discs => (MAX_MASS_RATIO, String::new()),
            Engine::None => return Ok(()),
        };
        for layer in self.layers() {
            let alone = self.layer_alone(layer);
            let ratio = alone.mass_ratio();
            if let Some((heaviest, lightest)) = alone.most_unlike().filter(|_| ratio > most * (1.0 + 1e-12)) {
                let rule = format!(
                    "{:?} weighs {} kg and {:?} {} kg; must be at most {most}{instead}",
                    heaviest.name, heaviest.mass_kg, lightest.name, lightest.mass_kg
                );
                return broken("robots (heaviest to lightest mass_kg)", &ratio, &rule);
            }
        }
        Ok(())
    }

    fn validate_tasks(&self) -> Result<()> {
        counts("tasks (their number)", self.tasks.len(), 1, MAX_VICTIMS)?;
        for (index, task) in self.tasks.iter().enumerate() {
            let key = |name: &str| format!("tasks[{index}].{name}");
            named(&key("name"), &task.name)?;
            if self.tasks[..index].iter().any(|other| other.name == task.name) {
                return broken(&key("name"), &task.name, "names must differ");
            }
            let needs: Vec<&str> = task.needs.names().collect();
            counts(&key("needs (their number)"), needs.len(), 1, MAX_NEEDS)?;
            validate_amounts(&task.needs, &key("needs"))?;
            for (need, amount) in task.needs.amounts().into_iter().flatten() {
                let sum: f64 = self.robots.iter().map(|robot| robot.abilities.amount(need)).sum();
                if !reaches(sum, *amount) {
                    let rule =
                        format!("task {:?} needs more than the whole team has, which is {sum}", task.name);
                    return broken(&key(&format!("needs.{need}")), amount, &rule);
                }
            }
            if task.needs.amounts().is_none() && !self.can_serve(&needs) {
                let needs = needs.join(" + ");
                return broken(&key("needs"), &needs, "the team has no distinct able robot for each need");
            }
            validate_times(task, key)?;
        }
        Ok(())
    }

    /// Whether distinct robots can fill all needs at once.
    fn can_serve(&self, needs: &[&str]) -> bool {
        let able = |need: &&str| {
            let has = |(_, robot): &(usize, &Robot)| robot.abilities.amount(need) > 0.0;
            self.robots.iter().enumerate().filter(has).fold(0_u64, |mask, (index, _)| mask | 1 << index)
        };
        fillable(&needs.iter().map(able).collect::<Vec<u64>>())
    }

    fn validate_starts(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            let most = self.arena_half_width_m - robot.radius_m - START_GAP_M;
            for (axis, value) in robot.start_m.iter().flatten().enumerate() {
                within(&format!("robots[{index}].start_m[{axis}]"), *value, -most, most, "m")?;
            }
        }
        Ok(())
    }

    fn validate_victim_places(&self) -> Result<()> {
        let most = self.arena_half_width_m - self.wall_clearance_m;
        self.validate_area("victim_area_m", self.victim_area_m)?;
        let places = self.victim_places_m.len();
        if places == 0 {
            return Ok(());
        }
        if self.victim_area_m.is_some() {
            return broken(
                "victim_places_m (their number)",
                &places,
                "must be 0 where victim_area_m is given",
            );
        }
        counts("victim_places_m (their number)", places, self.num_victims(), MAX_PLACES)?;
        for (index, place) in self.victim_places_m.iter().enumerate() {
            for (axis, value) in place.iter().enumerate() {
                within(&format!("victim_places_m[{index}][{axis}]"), *value, -most, most, "m")?;
            }
            // As the worlds hold them: numbers that differ by less are one place.
            let held = |place: &[f64; 2]| place.map(|value| (value as f32 + 0.0).to_bits()); // −0 is 0
            let same = |other: &[f64; 2]| held(other) == held(place);
            if let Some(first) = self.victim_places_m[..index].iter().position(same) {
                let rule = format!("is victim_places_m[{first}] once more; places must differ");
                return broken(&format!("victim_places_m[{index}]"), &format!("{place:?}"), &rule);
            }
        }
        Ok(())
    }

    fn validate_faults(&self) -> Result<()> {
        counts("faults (their number)", self.faults.len(), 0, MAX_FAULTS)?;
        for (index, fault) in self.faults.iter().enumerate() {
            self.validate_fault(fault, |name: &str| format!("faults[{index}].{name}"))?;
        }
        Ok(())
    }

    fn validate_fault(&self, fault: &Fault, key: impl Fn(&str) -> String) -> Result<()> {
        let robots: Vec<&str> = self.robots.iter().map(|robot| robot.name.as_str()).collect();
        if !robots.contains(&fault.robot.as_str()) {
            let rule = format!("no such robot; the team has {}", robots.join(", "));
            return broken(&key("robot"), &format!("{:?}", fault.robot), &rule);
        }
        let Spec { name, range: (low, high), unit, .. } = fault.kind.spec();
        within(&key(&format!("value ({name})")), fault.value, *low, *high, unit)?;
        let leaves = self.unavailable_robots == Unavailable::Leave && fault.kind == Kind::Unavailable;
        if leaves && 0.0 < fault.value && fault.value < 1.0 {
            let rule = "must be 0 or 1 where unavailable_robots = \"leave\"";
            return broken(&key("value (unavailable)"), &fault.value, rule);
        }
        if fault.onset_step >= self.episode_steps {
            let steps = self.episode_steps;
            let rule = format!("must be before the end of the episode of {steps} control steps");
            return broken(&key("onset_step"), &fault.onset_step, &rule);
        }
        if let Some(rate) = fault.onset_rate_hz {
            within(&key("onset_rate_hz"), rate, 1e-6, 1000.0, "1/s")?;
        }
        match fault.duration_steps {
            Some(steps) => counts(&key("duration_steps"), steps as usize, 1, 1_000_000),
            None => Ok(()),
        }
    }

    fn validate_obstacles(&self) -> Result<()> {
        counts("obstacles (their number)", self.obstacles.len(), 0, MAX_OBSTACLES)?;
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let key = |name: &str| format!("obstacles[{index}].{name}");
            match (obstacle.shape, obstacle.radius_m, obstacle.half_extents_m) {
                (Shape::Disc, Some(radius), None) => {
                    within(&key("radius_m"), radius, 0.005, self.arena_half_width_m, "m")?;
                }
                (Shape::Box, None, Some(half)) => {
                    within(&key("half_extents_m[0]"), half[0], 0.005, self.arena_half_width_m, "m")?;
                    within(&key("half_extents_m[1]"), half[1], 0.005, self.arena_half_width_m, "m")?;
                }
                (Shape::Disc, ..) => {
                    return broken(&key("shape"), &"disc", "a disc has radius_m and no half_extents_m");
                }
                (Shape::Box, ..) => {
                    return broken(&key("shape"), &"box", "a box has half_extents_m and no radius_m");
                }
            }
            if let Some([x, y]) = obstacle.position_m {
                within(&key("position_m[0]"), x, -self.arena_half_width_m, self.arena_half_width_m, "m")?;
                within(&key("position_m[1]"), y, -self.arena_half_width_m, self.arena_half_width_m, "m")?;
            }
        }
        Ok(())
    }

    /// Refuses sizes that leave no victim and no robot a place even in an empty arena.
    fn validate_sizes(&self) -> Result<()> {
        let half = self.arena_half_width_m;
        if self.wall_clearance_m >= half {
            let rule = format!("must be below arena_half_width_m = {half} m");
            return broken("wall_clearance_m", &self.wall_clearance_m, &rule);
        }
        let wide = |robot: &Robot| robot.radius_m * 2.0 >= half;
        if let Some(index) = self.robots.iter().position(wide) {
            let rule = format!("must be below half of arena_half_width_m = {half} m");
            return broken(&format!("robots[{index}].radius_m"), &self.robots[index].radius_m, &rule);
        }
        self.validate_travel()
    }

    /// Refuses speeds at which rapier lets robots sink into each other.
    fn validate_travel(&self) -> Result<()> {
        let substep = self.dt_s / f64::from(self.substeps);
        let smallest = |robot: &Robot| {
            let same = self.robots.iter().filter(|other| other.layer == robot.layer);
            same.map(|other| other.radius_m).fold(f64::INFINITY, f64::min)
        };
        let most = |robot: &Robot| MAX_TRAVEL_RADII * smallest(robot) / substep;
        let too_fast = |robot: &Robot| robot.max_speed_mps > most(robot) * (1.0 + 1e-12);
        match self.robots.iter().position(too_fast) {
            Some(index) if self.engine == Engine::Rapier => {
                let (most, smallest) = (most(&self.robots[index]), smallest(&self.robots[index]));
                let rule = format!(
                    "must be at most {most:.6} m/s: no robot may move farther in a substep (dt_s / substeps = \
                     {substep:.6} s) than {MAX_TRAVEL_RADII} times the smallest radius_m ({smallest} m); use \
                     more substeps, a smaller dt_s or engine = \"discs\""
                );
                broken(&format!("robots[{index}].max_speed_mps"), &self.robots[index].max_speed_mps, &rule)
            }
            _ => Ok(()),
        }
    }
}

/// Refuses amounts out of range.
fn validate_amounts(abilities: &Abilities, key: &str) -> Result<()> {
    let (low, high) = AMOUNTS;
    abilities
        .amounts()
        .into_iter()
        .flatten()
        .try_for_each(|(name, amount)| within(&format!("{key}.{name}"), *amount, low, high, ""))
}

/// Refuses services and deadlines out of range, and a deadline that comes before the service can end.
fn validate_times(task: &Task, key: impl Fn(&str) -> String) -> Result<()> {
    within(&key("service_s"), task.service_s, 0.0, MAX_TIME_S, "s")?;
    let Some(deadline) = task.deadline_s else { return Ok(()) };
    let [low, high] = deadline.range();
    for seconds in [low, high] {
        within(&key("deadline_s"), seconds, 0.001, MAX_TIME_S, "s")?;
    }
    if low > high {
        let rule = "must be a pair [low, high] whose low is at most its high";
        return broken(&key("deadline_s"), &format!("[{low}, {high}]"), rule);
    }
    if low < task.service_s {
        let rule = format!("must be at least service_s = {}, or no victim can be rescued", task.service_s);
        return broken(&key("deadline_s"), &low, &rule);
    }
    Ok(())
}
