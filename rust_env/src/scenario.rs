//! `Scenario`: what a rescue world is made of, as plain data. Nothing here moves or draws anything, and
//! nothing plays by a scenario before [`crate::rules::Rules::new`] has found it valid.

mod abilities;
mod area;
mod arrivals;
mod battery;
mod check;
mod communication;
mod depot;
mod layers;
mod map;
mod order;
mod range_sensor;
mod sight;
mod spot;
mod task;
mod validity;
mod wheels;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fault::Fault;

pub use abilities::{Abilities, reaches};
pub use arrivals::Arrival;
pub use battery::{Battery, Station};
pub use communication::{Communication, Share};
pub use depot::Depot;
pub use map::Map;
pub use range_sensor::{MAX_RAYS, RangeSensor};
pub(crate) use task::steps_of;
pub use task::{Deadline, Interrupted, Task};

/// Most robots in a team.
pub const MAX_ROBOTS: usize = 64;
/// Most victims present at once.
pub const MAX_VICTIMS: usize = 32;
/// Most obstacles in an arena.
pub const MAX_OBSTACLES: usize = 64;
/// Most stations in a scenario, and most depots.
pub const MAX_STATIONS: usize = 64;
/// Most places in a list of those at which victims appear.
pub const MAX_PLACES: usize = 256;
/// Most different abilities in a scenario.
pub const MAX_ABILITIES: usize = 32;
/// Most faults in a scenario.
pub const MAX_FAULTS: usize = 256;
/// Most needs that one victim may have.
pub const MAX_NEEDS: usize = 8;
/// Most robots that may help one victim: more than its needs, where these are sums.
pub const MAX_HELPERS: usize = MAX_ROBOTS;
/// Least and largest amount of an ability or a need.
pub const AMOUNTS: (f64, f64) = (1e-6, 1e6);
/// Most victims in a list of arrivals.
pub const MAX_ARRIVALS: usize = 1000;
/// Largest rate at which victims of a task arrive, 1/s.
pub const MAX_ARRIVAL_RATE_HZ: f64 = 100.0;
/// Longest service or deadline of a victim, s; no episode takes longer.
pub const MAX_TIME_S: f64 = 1e6;
/// Gap between robots, and between robots and solids, when an episode starts, m.
pub const START_GAP_M: f64 = 1e-3;
/// Most that the heaviest robot may weigh, in weights of the lightest: contacts are true up to here.
pub const MAX_MASS_RATIO: f64 = 100.0;
/// The same for rapier, which squeezes lighter robots deep into heavier ones and into walls.
pub const MAX_MASS_RATIO_RAPIER: f64 = 16.0;

/// Farthest that a robot may move in a substep of rapier, in smallest radii: up to here robots of one size
/// overlap by no more than a tenth of a radius, and it is rare that one has to be held back.
pub const MAX_TRAVEL_RADII: f64 = 3.0;

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
    /// Victims of each task arrive at random, at its own rate; up to `max_victims` of each wait at once.
    Poisson,
    /// Victims arrive as the list `arrivals` says; up to `max_victims` of each task wait at once.
    Listed,
}

/// What a robot is told to do each step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// 0 stay, 1 +x, 2 −x, 3 +y, 4 −y; on wheels 0 stop, 1 forward, 2 backward, 3 turn left, 4 turn right.
    Discrete,
    /// Two numbers in [−1, 1], the drive's direction and share; the vector's length is clipped to 1. On wheels
    /// the shares of speed and turn rate, or of the speeds of the left and the right wheel.
    Continuous,
}

/// What an action sets of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveMode {
    /// A force, so that it takes time until the robot is fast and until it stands.
    #[default]
    Force,
    /// Its velocity, at once.
    Velocity,
    /// The speed along its heading, and the turn rate.
    Unicycle,
    /// The speeds of its two wheels.
    Differential,
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

/// What becomes of a robot while it is not available.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unavailable {
    /// It stays in the arena as a body that does not drive.
    Stay,
    /// It leaves the arena, and comes back at a random place.
    Leave,
}

/// The contact solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Engine {
    /// rapier's rigid bodies.
    Rapier,
    /// Exact contacts of frictionless discs, walls and boxes.
    Discs,
    /// No contacts: robots pass through each other.
    None,
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
    pub abilities: Abilities,
    /// Speed that no period begins with more than, m/s.
    pub max_speed_mps: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Radius of its disc, m.
    #[serde(default = "default_radius_m")]
    pub radius_m: f64,
    /// Force of its drive, N; of use where actions set a force.
    #[serde(default = "default_drive_force_n")]
    pub drive_force_n: f64,
    /// What actions set.
    #[serde(default)]
    pub drive: DriveMode,
    /// Highest turn rate of a robot on wheels, rad/s.
    #[serde(default = "wheels::default_max_turn_rad_s")]
    pub max_turn_rad_s: f64,
    /// Acceleration of a robot on wheels along its heading, or of each of its two wheels, m/s².
    #[serde(default = "wheels::default_acceleration_m_s2")]
    pub acceleration_m_s2: f64,
    /// Acceleration of the turn rate of a unicycle, rad/s².
    #[serde(default = "wheels::default_turn_acceleration_rad_s2")]
    pub turn_acceleration_rad_s2: f64,
    /// Distance of the two wheels of a differential drive, m; twice the radius if absent.
    #[serde(default)]
    pub wheel_base_m: Option<f64>,
    /// Robots of different layers do not touch each other.
    #[serde(default = "layers::default_layer")]
    pub layer: String,
    /// Where it is when an episode starts, m; a random place in each episode if absent.
    #[serde(default)]
    pub start_m: Option<[f64; 2]>,
    /// Its battery; it needs no energy if absent.
    #[serde(default)]
    pub battery: Option<Battery>,
    /// How many rescues it can help with before a depot refills it; any number if absent.
    #[serde(default)]
    pub load: Option<u32>,
    /// How far it sees from its centre, m; everything if absent.
    #[serde(default)]
    pub sight_m: Option<f64>,
    /// The angle within which it sees, the middle straight ahead, degrees.
    #[serde(default = "sight::default_field_of_view_deg")]
    pub field_of_view_deg: f64,
    /// What measures how far things are around it; nothing if absent.
    #[serde(default)]
    pub range_sensor: Option<RangeSensor>,
}

fn default_radius_m() -> f64 {
    0.05
}

fn default_drive_force_n() -> f64 {
    5.0
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
    /// The layers of the robots that touch it; all if absent.
    #[serde(default)]
    pub layers: Option<Vec<String>>,
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
    /// Most victims of a wave in the mixed situation, and of each task at once where they arrive.
    pub max_victims: usize,
    /// Which victims arrive in the listed situation.
    pub arrivals: Vec<Arrival>,
    /// Solid things in the arena.
    pub obstacles: Vec<Obstacle>,
    /// Which cells of a grid over the arena are solid; none if absent.
    pub map: Option<Map>,
    /// Whether obstacles hide from robots what is behind them.
    pub occlusion: bool,
    /// How robots communicate; everybody hears everybody, at once, if absent.
    pub communication: Option<Communication>,
    /// Places that charge batteries.
    pub stations: Vec<Station>,
    /// Places that refill loads.
    pub depots: Vec<Depot>,
    /// Half the side of the square arena, m.
    pub arena_half_width_m: f64,
    /// How near a helper must be, m.
    pub rescue_radius_m: f64,
    /// How far from every robot a victim appears, m.
    pub spawn_clearance_m: f64,
    /// How far from walls and obstacles a victim appears, m.
    pub wall_clearance_m: f64,
    /// Least x and y, then largest x and y, of the places at which victims appear, m; wherever the
    /// clearances are kept if absent.
    pub victim_area_m: Option<[f64; 4]>,
    /// The only places at which victims appear, m; any if empty.
    pub victim_places_m: Vec<[f64; 2]>,
    /// Control steps of an episode.
    pub episode_steps: u32,
    /// Terminates the episode after so many rescues; never if absent.
    pub end_when_rescued: Option<u32>,
    /// Terminates the episode when all victims of the list have come and gone.
    pub end_when_done: bool,
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
    /// Subtracted from every robot's reward for each victim that is lost.
    pub lost_cost: f64,
    /// The order in which a robot sees the victims.
    pub victim_order: VictimOrder,
    /// Teammates in an observation, the nearest first; all, in team order, if absent.
    pub observed_teammates: Option<usize>,
    /// Victims in an observation, the first in order; all if absent.
    pub observed_victims: Option<usize>,
    /// What goes wrong with which robot, and when.
    pub faults: Vec<Fault>,
    /// Whether observations have columns for the faults in effect.
    pub observe_faults: bool,
    /// What becomes of robots while they are not available.
    pub unavailable_robots: Unavailable,
}

impl Default for Scenario {
    fn default() -> Self {
        let robot = |name: &str, kind: &str, ability: &str, max_speed_mps, mass_kg| Robot {
            name: name.into(),
            kind: kind.into(),
            abilities: vec![ability.into()].into(),
            max_speed_mps,
            mass_kg,
            radius_m: default_radius_m(),
            drive_force_n: default_drive_force_n(),
            drive: DriveMode::Force,
            max_turn_rad_s: wheels::default_max_turn_rad_s(),
            acceleration_m_s2: wheels::default_acceleration_m_s2(),
            turn_acceleration_rad_s2: wheels::default_turn_acceleration_rad_s2(),
            wheel_base_m: None,
            layer: layers::default_layer(),
            start_m: None,
            battery: None,
            load: None,
            sight_m: None,
            field_of_view_deg: sight::default_field_of_view_deg(),
            range_sensor: None,
        };
        let task = |name: &str, needs: [&str; 2]| Task::new(name, needs.map(String::from).to_vec());
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
            arrivals: vec![],
            obstacles: vec![],
            map: None,
            occlusion: false,
            communication: None,
            stations: vec![],
            depots: vec![],
            arena_half_width_m: 1.0,
            rescue_radius_m: 0.15,
            spawn_clearance_m: 0.2,
            wall_clearance_m: 0.1,
            victim_area_m: None,
            victim_places_m: vec![],
            episode_steps: 25,
            end_when_rescued: None,
            end_when_done: false,
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
            lost_cost: 0.0,
            victim_order: VictimOrder::Relevant,
            observed_teammates: None,
            observed_victims: None,
            faults: vec![],
            observe_faults: false,
            unavailable_robots: Unavailable::Stay,
        }
    }
}

impl Scenario {
    /// Reads a description from JSON; absent keys take their defaults. Its values are not checked here.
    ///
    /// # Errors
    /// [`Error::ScenarioText`] for text of the wrong form: syntax, an unknown key, a value of another type.
    pub fn from_json(text: &str) -> Result<Self> {
        if !text.trim_start().starts_with('{') {
            return Err(Error::ScenarioText("must be a JSON object".into())); // a list would do for serde
        }
        serde_json::from_str(text).map_err(|error| Error::ScenarioText(error.to_string()))
    }

    /// The scenario as JSON with every key written out.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("plain data serialises")
    }

    /// Slots for victims: 1 in single, one per task in double, `max_victims` in mixed, `max_victims` per task
    /// where they arrive.
    #[must_use]
    pub fn num_victims(&self) -> usize {
        match self.situation {
            Situation::Single => 1,
            Situation::Double => self.tasks.len(),
            Situation::Mixed => self.max_victims,
            Situation::Poisson | Situation::Listed => self.tasks.len() * self.max_victims,
        }
    }

    /// Whether the rescue of some victims takes time.
    #[must_use]
    pub fn has_services(&self) -> bool {
        self.tasks.iter().any(|task| task.service_s > 0.0)
    }

    /// Whether some victims can be lost.
    #[must_use]
    pub fn has_deadlines(&self) -> bool {
        self.tasks.iter().any(|task| task.deadline_s.is_some())
    }

    /// All abilities named by robots, sorted; the order of ability columns.
    #[must_use]
    pub fn abilities(&self) -> Vec<&str> {
        let mut abilities: Vec<&str> = self.robots.iter().flat_map(|robot| robot.abilities.names()).collect();
        abilities.sort_unstable();
        abilities.dedup();
        abilities
    }

    /// Most helpers that a victim of any task can have: one for each need of a list, and where needs are
    /// sums as many robots as have any of the abilities.
    #[must_use]
    pub fn max_helpers(&self) -> usize {
        let helps =
            |task: &Task, robot: &Robot| task.needs.names().any(|need| robot.abilities.amount(need) > 0.0);
        let most = |task: &Task| match task.needs.amounts() {
            None => task.needs.names().count(),
            Some(_) => self.robots.iter().filter(|robot| helps(task, robot)).count(),
        };
        self.tasks.iter().map(most).max().unwrap_or(0)
    }

    /// The heaviest and the lightest robot; the first of several. None in an empty team.
    #[must_use]
    pub fn most_unlike(&self) -> Option<(&Robot, &Robot)> {
        let heaviest = self.robots.iter().reduce(|a, b| if b.mass_kg > a.mass_kg { b } else { a })?;
        let lightest = self.robots.iter().reduce(|a, b| if b.mass_kg < a.mass_kg { b } else { a })?;
        Some((heaviest, lightest))
    }

    /// What the heaviest robot weighs, in weights of the lightest.
    #[must_use]
    pub fn mass_ratio(&self) -> f64 {
        self.most_unlike().map_or(1.0, |(heaviest, lightest)| heaviest.mass_kg / lightest.mass_kg)
    }
}

#[cfg(test)]
mod tests;
