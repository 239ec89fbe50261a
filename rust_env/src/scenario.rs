//! `Scenario`: what a rescue world is made of, as plain data, and the rules a valid one obeys.
//! Nothing here moves or draws anything.

use serde::{Deserialize, Serialize};

use crate::check::{broken, counts, named, within};
use crate::error::{Error, Result};
use crate::fault::Fault;

/// Most robots in a team.
pub const MAX_ROBOTS: usize = 64;
/// Most victims present at once.
pub const MAX_VICTIMS: usize = 32;
/// Most obstacles in an arena.
pub const MAX_OBSTACLES: usize = 64;
/// Most different abilities in a scenario.
pub const MAX_ABILITIES: usize = 32;
/// Most faults in a scenario.
pub const MAX_FAULTS: usize = 256;
/// Most helpers that one victim may need.
pub const MAX_NEEDS: usize = 8;
/// Most that the heaviest robot may weigh, in weights of the lightest: contacts are true up to here.
pub const MAX_MASS_RATIO: f64 = 100.0;

/// When and how many victims appear (paper, section III).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Situation {
    /// One victim of a random task, replaced as soon as it is rescued.
    Single,
    /// One victim of each task, each replaced as soon as it is rescued.
    Double,
    /// Waves of 1 to `max_victims` victims of random tasks; the next comes when all are rescued.
    Mixed,
}

/// What a robot is told to do each step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// 0 stay, 1 +x, 2 −x, 3 +y, 4 −y.
    Discrete,
    /// Two numbers in [−1, 1], the drive's direction and share; the vector's length is clipped to 1.
    Continuous,
}

/// Who is rewarded for a rescue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RescueCredit {
    /// The robots that helped.
    Helpers,
    /// Every robot.
    Team,
}

/// The dense term that rewards coming nearer to victims.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shaping {
    /// Minus the change of the distance between needs and their nearest robots; no jump when a
    /// victim comes or goes.
    Progress,
    /// γΦ(s′) − Φ(s), which leaves the best policy as it is (Ng, Harada & Russell 1999).
    Potential,
    /// Rescues only.
    None,
}

/// The order in which a robot sees the victims.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VictimOrder {
    /// Those it can help first, then by distance.
    Relevant,
    /// By slot.
    Slot,
}

/// The contact solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Engine {
    /// rapier's rigid bodies.
    Rapier,
    /// Exact contacts of frictionless discs, walls and boxes.
    Discs,
}

/// An obstacle's form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A disc of `radius_m`.
    Disc,
    /// An upright box of `half_extents_m`.
    Box,
}

/// One robot of the team.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Unique name, such as `food_0`.
    pub name: String,
    /// Kind, such as `food`.
    pub kind: String,
    /// What it can bring to a victim.
    pub abilities: Vec<String>,
    /// Speed above which it does not drive, m/s.
    pub max_speed_mps: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Radius of its disc, m.
    #[serde(default = "default_radius_m")]
    pub radius_m: f64,
    /// Force of its drive, N.
    #[serde(default = "default_drive_force_n")]
    pub drive_force_n: f64,
}

fn default_radius_m() -> f64 {
    0.05
}

fn default_drive_force_n() -> f64 {
    5.0
}

/// A kind of victim: the abilities that must meet at it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Unique name, such as `task_1`.
    pub name: String,
    /// Needed abilities, with repeats if several robots of one ability are needed.
    pub needs: Vec<String>,
}

/// Something solid that does not move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Its form.
    pub shape: Shape,
    /// Radius of a disc, m.
    #[serde(default)]
    pub radius_m: Option<f64>,
    /// Half width and half height of a box, m.
    #[serde(default)]
    pub half_extents_m: Option<[f64; 2]>,
    /// Place of its centre, m; a random place in each episode if absent.
    #[serde(default)]
    pub position_m: Option<[f64; 2]>,
}

/// A rescue world, described. The defaults are the paper's team (Table I) in the mixed situation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// When and how many victims appear.
    pub situation: Situation,
    /// The team, in the order of all arrays.
    pub robots: Vec<Robot>,
    /// The kinds of victims.
    pub tasks: Vec<Task>,
    /// Most victims of a wave in the mixed situation.
    pub max_victims: usize,
    /// Solid things in the arena.
    pub obstacles: Vec<Obstacle>,
    /// Half the side of the square arena, m.
    pub arena_half_width_m: f64,
    /// How near a helper must be, m.
    pub rescue_radius_m: f64,
    /// How far from every robot a victim appears, m.
    pub spawn_clearance_m: f64,
    /// How far from walls and obstacles a victim appears, m.
    pub wall_clearance_m: f64,
    /// Control steps of an episode.
    pub episode_steps: u32,
    /// Terminates the episode after so many rescues; never if absent.
    pub end_when_rescued: Option<u32>,
    /// Control period, s.
    pub dt_s: f64,
    /// Physics substeps of a control period.
    pub substeps: u32,
    /// Share of the velocity that is lost each control period.
    pub damping: f64,
    /// Coulomb friction coefficient of every contact.
    pub friction: f64,
    /// Contact solver.
    pub engine: Engine,
    /// What a robot is told to do.
    pub actions: Actions,
    /// Who is rewarded for a rescue.
    pub rescue_credit: RescueCredit,
    /// Reward for a rescue, to each rewarded robot.
    pub rescue_reward: f64,
    /// The dense term.
    pub shaping: Shaping,
    /// Its weight, per metre.
    pub shaping_weight: f64,
    /// γ of potential shaping.
    pub shaping_discount: f64,
    /// Subtracted from a robot's reward in each step in which it touched something.
    pub contact_cost: f64,
    /// Subtracted for each step of full drive (times the square of a continuous action's length).
    pub action_cost: f64,
    /// The order in which a robot sees the victims.
    pub victim_order: VictimOrder,
    /// What goes wrong with which robot, and when.
    pub faults: Vec<Fault>,
    /// Whether observations have columns for the faults in effect.
    pub observe_faults: bool,
}

impl Default for Scenario {
    fn default() -> Self {
        let robot = |name: &str, kind: &str, ability: &str, max_speed_mps, mass_kg| Robot {
            name: name.into(),
            kind: kind.into(),
            abilities: vec![ability.into()],
            max_speed_mps,
            mass_kg,
            radius_m: default_radius_m(),
            drive_force_n: default_drive_force_n(),
        };
        let task = |name: &str, needs: [&str; 2]| Task {
            name: name.into(),
            needs: needs.map(String::from).to_vec(),
        };
        Self {
            situation: Situation::Mixed,
            robots: vec![
                robot("food_0", "food", "food", 1.0, 1.0),
                robot("food_1", "food", "food", 1.0, 1.0),
                robot("navigation_0", "navigation", "information", 1.5, 0.5),
                robot("medical_0", "medical", "medicine", 1.5, 0.5),
            ],
            tasks: vec![task("task_1", ["food", "medicine"]), task("task_2", ["food", "information"])],
            max_victims: 2,
            obstacles: vec![],
            arena_half_width_m: 1.0,
            rescue_radius_m: 0.15,
            spawn_clearance_m: 0.2,
            wall_clearance_m: 0.1,
            episode_steps: 25,
            end_when_rescued: None,
            dt_s: 0.1,
            substeps: 6,
            damping: 0.25,
            friction: 0.0,
            engine: Engine::Rapier,
            actions: Actions::Discrete,
            rescue_credit: RescueCredit::Helpers,
            rescue_reward: 1.0,
            shaping: Shaping::Progress,
            shaping_weight: 1.0,
            shaping_discount: 0.95,
            contact_cost: 0.0,
            action_cost: 0.0,
            victim_order: VictimOrder::Relevant,
            faults: vec![],
            observe_faults: false,
        }
    }
}

impl Scenario {
    /// Reads a scenario from JSON and checks it; absent keys take their defaults.
    ///
    /// # Errors
    /// [`Error::ScenarioText`] for text of the wrong form, [`Error::Scenario`] for a bad value.
    pub fn from_json(text: &str) -> Result<Self> {
        if !text.trim_start().starts_with('{') {
            return Err(Error::ScenarioText("must be a JSON object".into())); // a list would do for serde
        }
        let scenario: Self =
            serde_json::from_str(text).map_err(|error| Error::ScenarioText(error.to_string()))?;
        scenario.validate()?;
        Ok(scenario)
    }

    /// The scenario as JSON with every key written out.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("plain data serialises")
    }

    /// Slots for victims: 1 in single, one per task in double, `max_victims` in mixed.
    #[must_use]
    pub fn num_victims(&self) -> usize {
        match self.situation {
            Situation::Single => 1,
            Situation::Double => self.tasks.len(),
            Situation::Mixed => self.max_victims,
        }
    }

    /// All abilities named by robots, sorted; the order of ability columns.
    #[must_use]
    pub fn abilities(&self) -> Vec<&str> {
        let mut abilities: Vec<&str> =
            self.robots.iter().flat_map(|robot| &robot.abilities).map(String::as_str).collect();
        abilities.sort_unstable();
        abilities.dedup();
        abilities
    }

    /// Most helpers that any task needs.
    #[must_use]
    pub fn max_needs(&self) -> usize {
        self.tasks.iter().map(|task| task.needs.len()).max().unwrap_or(0)
    }

    /// Checks every value and every rule between values.
    ///
    /// # Errors
    /// [`Error::Scenario`] for the first rule that is broken.
    pub fn validate(&self) -> Result<()> {
        self.validate_numbers()?;
        self.validate_robots()?;
        self.validate_tasks()?;
        self.validate_obstacles()?;
        self.validate_faults()
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
        if self.engine == Engine::Discs && self.friction != 0.0 {
            return broken("friction", &self.friction, "must be 0 where engine = \"discs\"");
        }
        counts("episode_steps", self.episode_steps as usize, 1, 1_000_000)?;
        counts("substeps", self.substeps as usize, 1, 1000)?;
        counts("max_victims", self.max_victims, 1, MAX_VICTIMS)?;
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
            for ability in &robot.abilities {
                named(&key("abilities"), ability)?;
            }
            within(&key("max_speed_mps"), robot.max_speed_mps, 0.01, 100.0, "m/s")?;
            within(&key("mass_kg"), robot.mass_kg, 0.01, 1000.0, "kg")?;
            within(&key("radius_m"), robot.radius_m, 0.005, 10.0, "m")?;
            within(&key("drive_force_n"), robot.drive_force_n, 0.0, 1e5, "N")?;
        }
        let ratio = self.mass_ratio();
        if ratio > MAX_MASS_RATIO {
            let rule = format!("must be at most {MAX_MASS_RATIO}");
            return broken("robots (heaviest to lightest mass_kg)", &ratio, &rule);
        }
        counts("robots (their different abilities)", self.abilities().len(), 0, MAX_ABILITIES)
    }

    /// What the heaviest robot weighs, in weights of the lightest.
    #[must_use]
    pub fn mass_ratio(&self) -> f64 {
        let masses = || self.robots.iter().map(|robot| robot.mass_kg);
        masses().fold(0.0, f64::max) / masses().fold(f64::INFINITY, f64::min)
    }

    fn validate_tasks(&self) -> Result<()> {
        counts("tasks (their number)", self.tasks.len(), 1, MAX_VICTIMS)?;
        for (index, task) in self.tasks.iter().enumerate() {
            let key = |name: &str| format!("tasks[{index}].{name}");
            named(&key("name"), &task.name)?;
            if self.tasks[..index].iter().any(|other| other.name == task.name) {
                return broken(&key("name"), &task.name, "names must differ");
            }
            counts(&key("needs (their number)"), task.needs.len(), 1, MAX_NEEDS)?;
            if !self.can_serve(&task.needs) {
                let needs = task.needs.join(" + ");
                return broken(&key("needs"), &needs, "the team has no distinct able robot for each need");
            }
        }
        Ok(())
    }

    /// Whether distinct robots can fill all needs at once: a matching, found by augmenting paths.
    fn can_serve(&self, needs: &[String]) -> bool {
        fn fill(
            team: &[Robot],
            needs: &[String],
            need: usize,
            tried: &mut [bool],
            by: &mut [Option<usize>],
        ) -> bool {
            for robot in 0..team.len() {
                if tried[robot] || !team[robot].abilities.contains(&needs[need]) {
                    continue;
                }
                tried[robot] = true;
                if by[robot].is_none_or(|other| fill(team, needs, other, tried, by)) {
                    by[robot] = Some(need);
                    return true;
                }
            }
            false
        }
        let mut by = vec![None; self.robots.len()];
        (0..needs.len())
            .all(|need| fill(&self.robots, needs, need, &mut vec![false; self.robots.len()], &mut by))
    }

    fn validate_faults(&self) -> Result<()> {
        counts("faults (their number)", self.faults.len(), 0, MAX_FAULTS)?;
        let names: Vec<&str> = self.robots.iter().map(|robot| robot.name.as_str()).collect();
        let checked = |(index, fault): (usize, &Fault)| {
            fault.validate(&format!("faults[{index}]"), &names, self.episode_steps)
        };
        self.faults.iter().enumerate().try_for_each(checked)
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
}

#[cfg(test)]
mod tests;
