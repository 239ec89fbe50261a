//! What the integration tests share: a batch with the buffers that its steps write, teams and scenes.
#![allow(dead_code)] // each test program uses a part

use innerattn_env::batch::{Autoreset, Batch, Options, StepBuffers};
use innerattn_env::error::Result;
use innerattn_env::fault::{Fault, KINDS, Kind};
use innerattn_env::geometry::{Solid, Vec2};
use innerattn_env::reward::{COMPONENTS, NUM_COMPONENTS};
use innerattn_env::rng::{Purpose, Stream};
use innerattn_env::robot::Commands;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{
    Abilities, Actions, Arrival, Battery, Communication, Deadline, Depot, DriveMode, Engine, Interrupted,
    Map, Obstacle, RangeSensor, Robot, Scenario, Shape, Share, Situation, Station, Unavailable,
};
use innerattn_env::tasks::{Loss, Rescue};

/// Every engine: each must keep every promise.
pub const ENGINES: [Engine; 2] = [Engine::Rapier, Engine::Discs];

/// Options of a batch that nothing else in a test depends on.
pub fn options(num_envs: usize, seed: u64) -> Options {
    Options { num_envs, seed, num_threads: Some(1), first_env: 0, autoreset: Autoreset::SameStep }
}

/// A batch and everything that its last step wrote.
pub struct Table {
    pub batch: Batch,
    pub obs: Vec<f32>,
    pub final_obs: Vec<f32>,
    pub reward: Vec<f32>,
    pub components: Vec<f32>,
    pub terminated: Vec<bool>,
    pub truncated: Vec<bool>,
    pub rescues: Vec<Rescue>,
    pub losses: Vec<Loss>,
    pub turned_away: Vec<u32>,
}

impl Table {
    pub fn new(scenario: Scenario, options: Options) -> Self {
        let batch = Batch::new(Rules::new(scenario).expect("a valid scenario"), options).expect("a batch");
        let rows = options.num_envs * batch.rules().team.len();
        let width = batch.rules().layout.width();
        let mut table = Self {
            obs: vec![0.0; rows * width],
            final_obs: vec![0.0; rows * width],
            reward: vec![0.0; rows],
            components: vec![0.0; rows * NUM_COMPONENTS],
            terminated: vec![false; options.num_envs],
            truncated: vec![false; options.num_envs],
            rescues: vec![],
            losses: vec![],
            turned_away: vec![],
            batch,
        };
        table.batch.reset(None, None, &mut table.obs);
        table
    }

    pub fn try_step(&mut self, commands: Commands) -> Result<()> {
        let buffers = StepBuffers {
            obs: &mut self.obs,
            final_obs: &mut self.final_obs,
            reward: &mut self.reward,
            components: &mut self.components,
            terminated: &mut self.terminated,
            truncated: &mut self.truncated,
        };
        self.rescues = self.batch.step(commands, buffers)?;
        self.losses = self.batch.losses().copied().collect();
        self.turned_away = self.batch.turned_away().collect();
        Ok(())
    }

    /// A step with actions of the scenario's kind, one row of `actions` for each env.
    pub fn step(&mut self, actions: &[[f32; 2]]) {
        let result = match self.batch.rules().scenario.actions {
            Actions::Discrete => {
                let actions: Vec<i64> = actions.iter().copied().map(nearest_action).collect();
                self.try_step(Commands::Discrete(&actions))
            }
            Actions::Continuous => self.try_step(Commands::Continuous(actions.as_flattened())),
        };
        result.expect("valid actions");
    }

    /// Whether the robot of a row (env × R + robot) paid for a contact in the last step.
    pub fn touched(&self, row: usize) -> bool {
        let contact = COMPONENTS.iter().position(|component| component.name == "contact");
        self.components[row * NUM_COMPONENTS + contact.expect("a component")] < 0.0
    }

    /// Everything that worlds `from..to` showed in the last step, as bits.
    pub fn shown(&self, from: usize, to: usize) -> Vec<u32> {
        let envs = self.terminated.len();
        let part = |values: &[f32]| {
            let row = values.len() / envs;
            values[from * row..to * row].iter().map(|value| value.to_bits()).collect::<Vec<u32>>()
        };
        let mut bits: Vec<u32> = [&self.obs, &self.final_obs, &self.reward, &self.components]
            .into_iter()
            .flat_map(|v| part(v))
            .collect();
        bits.extend(
            self.terminated[from..to].iter().chain(&self.truncated[from..to]).map(|flag| u32::from(*flag)),
        );
        for rescue in self.rescues.iter().filter(|rescue| (from..to).contains(&(rescue.env as usize))) {
            bits.extend([rescue.env - from as u32, rescue.episode as u32, rescue.step, rescue.slot]);
            bits.extend([rescue.victim, rescue.task]);
            bits.extend(rescue.helpers.iter().map(|helper| helper.map_or(u32::MAX, u32::from)));
        }
        for loss in self.losses.iter().filter(|loss| (from..to).contains(&(loss.env as usize))) {
            bits.extend([loss.env - from as u32, loss.episode as u32, loss.step, loss.slot]);
            bits.extend([loss.victim, loss.task]);
        }
        let turned_away = self.turned_away.iter().filter(|env| (from..to).contains(&(**env as usize)));
        bits.extend(turned_away.map(|env| env - from as u32));
        bits
    }
}

/// The discrete action nearest to a drive.
fn nearest_action([x, y]: [f32; 2]) -> i64 {
    if x.abs().max(y.abs()) < 0.5 {
        0
    } else if x.abs() >= y.abs() {
        if x > 0.0 { 1 } else { 2 }
    } else if y > 0.0 {
        3
    } else {
        4
    }
}

/// A source of random test data.
pub fn chance(seed: u64) -> Stream {
    Stream::new(seed, u64::MAX, 0, Purpose::Start)
}

/// One of the five discrete drives.
pub fn random_drive(chance: &mut Stream) -> [f32; 2] {
    [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]][chance.below(5)]
}

/// `count` robots of unlike size, mass and speed, with the default team's abilities in turn.
pub fn mixed_team(count: usize) -> Vec<Robot> {
    let like = Scenario::default().robots;
    (0..count)
        .map(|index| Robot {
            name: format!("robot_{index}"),
            radius_m: [0.05, 0.04, 0.06, 0.08, 0.03][index % 5],
            mass_kg: [1.0, 0.5, 2.0, 4.0, 0.25, 1.5, 0.5][index % 7],
            max_speed_mps: [1.0, 1.5, 1.25][index % 3],
            ..like[index % like.len()].clone()
        })
        .collect()
}

/// The same with victims that take time: the first task's keep their service, the others' start anew, and
/// all are lost after a while.
pub fn with_times(mut scenario: Scenario) -> Scenario {
    for (index, task) in scenario.tasks.iter_mut().enumerate() {
        task.service_s = 2.5 * scenario.dt_s;
        task.service = if index == 0 { Interrupted::Keep } else { Interrupted::Restart };
        task.deadline_s = Some(Deadline::Between([4.0 * scenario.dt_s, 12.0 * scenario.dt_s]));
    }
    Scenario { rescue_radius_m: 0.4, lost_cost: 0.5, ..scenario }
}

/// The same with amounts: some robots have amounts, and the first task needs sums.
pub fn with_amounts(mut scenario: Scenario) -> Scenario {
    for (index, robot) in scenario.robots.iter_mut().enumerate().filter(|(index, _)| index % 2 == 0) {
        let share = |name: &str| (name.to_string(), 0.3 + 0.7 * index as f64);
        robot.abilities = Abilities::Amounts(robot.abilities.names().map(share).collect());
    }
    let names = scenario.abilities();
    let team = |name: &str| scenario.robots.iter().map(|robot| robot.abilities.amount(name)).sum::<f64>();
    let needs = Abilities::Amounts(names.iter().map(|name| (name.to_string(), 0.6 * team(name))).collect());
    scenario.tasks[0].needs = needs;
    Scenario { rescue_radius_m: 0.6, ..scenario }
}

/// The same with an order of tasks: all others come after the first.
pub fn with_order(mut scenario: Scenario) -> Scenario {
    let first = scenario.tasks[0].name.clone();
    scenario.tasks[1..].iter_mut().for_each(|task| task.after = vec![first.clone()]);
    Scenario { rescue_radius_m: 0.4, ..scenario }
}

/// The same with two sites, one always for each task: the left half of the arena and the right one, in turn.
pub fn with_areas(mut scenario: Scenario) -> Scenario {
    let most = scenario.arena_half_width_m - scenario.wall_clearance_m;
    for (index, task) in scenario.tasks.iter_mut().enumerate() {
        task.area_m = Some([[-most, -most, 0.0, most], [0.0, -most, most, most]][index % 2]);
    }
    let situation = match scenario.situation {
        Situation::Mixed => Situation::Double,
        other => other,
    };
    Scenario { situation, rescue_radius_m: 0.4, ..scenario }
}

/// The same with victims that arrive at random, often more than there are slots.
pub fn with_arrivals(mut scenario: Scenario) -> Scenario {
    for (index, task) in scenario.tasks.iter_mut().enumerate() {
        task.arrival_rate_hz = (1.0 + index as f64) / (4.0 * scenario.dt_s);
    }
    Scenario { situation: Situation::Poisson, rescue_radius_m: 0.4, ..scenario }
}

/// The same with victims that arrive from a list, often more than there are slots.
pub fn with_list(scenario: Scenario) -> Scenario {
    let arrival = |number: usize| Arrival {
        at_s: (number / 2) as f64 * scenario.dt_s,
        task: scenario.tasks[number % scenario.tasks.len()].name.clone(),
        position_m: [0.0, 0.3 - 0.01 * number as f64],
    };
    let arrivals = (0..30).map(arrival).collect();
    Scenario { situation: Situation::Listed, arrivals, rescue_radius_m: 0.4, ..scenario }
}

/// The same whose episodes end when all victims of a list were rescued or lost.
pub fn with_an_end(scenario: Scenario) -> Scenario {
    let mut scenario = with_list(with_times(scenario));
    scenario.arrivals.truncate(12);
    Scenario { end_when_done: true, episode_steps: 40, ..scenario }
}

/// The same with robots that leave while they are not available.
pub fn with_leaving(scenario: Scenario) -> Scenario {
    let leaves = |robot: &Robot| Fault {
        onset_rate_hz: Some(0.5),
        duration_steps: Some(7),
        ..fault(&robot.name, Kind::Unavailable, 1.0)
    };
    let faults = scenario.robots.iter().map(leaves).collect();
    Scenario { faults, unavailable_robots: Unavailable::Leave, ..scenario }
}

/// The same with batteries that last for about a second, and two stations; one robot has no battery.
pub fn with_batteries(mut scenario: Scenario) -> Scenario {
    for robot in &mut scenario.robots[1..] {
        robot.battery = Some(Battery { capacity_j: 3.0, per_m_j: 2.0, idle_w: 1.0 });
    }
    let station = |x: f64, recharge_w| Station { position_m: [x, -0.2], radius_m: 0.2, recharge_w };
    Scenario { stations: vec![station(-0.3, 20.0), station(0.3, 4.0)], rescue_radius_m: 0.4, ..scenario }
}

/// The same with loads of one to three rescues, and two depots; one robot never runs out.
pub fn with_loads(mut scenario: Scenario) -> Scenario {
    for (robot, load) in scenario.robots[1..].iter_mut().zip([1, 2, 3].into_iter().cycle()) {
        robot.load = Some(load);
    }
    let depot = |y| Depot { position_m: [0.2, y], radius_m: 0.15 };
    Scenario { depots: vec![depot(-0.3), depot(0.3)], rescue_radius_m: 0.4, ..scenario }
}

/// The same with robots in three layers in turn, every second of which sets its velocity; the obstacles block
/// one, two or all of them.
pub fn with_layers(mut scenario: Scenario) -> Scenario {
    let names = ["ground", "air", "water"];
    for (index, robot) in scenario.robots.iter_mut().enumerate() {
        robot.layer = names[index % names.len()].into();
        robot.drive = [DriveMode::Force, DriveMode::Velocity][index / names.len() % 2];
    }
    let layers = scenario.layers().iter().map(ToString::to_string).collect::<Vec<_>>();
    for (index, obstacle) in scenario.obstacles.iter_mut().enumerate() {
        obstacle.layers = (index % 4 > 0).then(|| layers[..layers.len().min(index % 4)].to_vec());
    }
    Scenario { rescue_radius_m: 0.4, ..scenario }
}

/// The same with robots on wheels, every second a unicycle and every fourth a differential drive, of unlike
/// limits.
pub fn with_wheels(mut scenario: Scenario) -> Scenario {
    for (index, robot) in scenario.robots.iter_mut().enumerate() {
        robot.drive =
            [DriveMode::Unicycle, DriveMode::Differential, DriveMode::Unicycle, DriveMode::Force][index % 4];
        robot.max_turn_rad_s = [4.0, 25.0, 1.5][index % 3];
        robot.acceleration_m_s2 = [5.0, 2.0, 20.0][index % 3];
        robot.turn_acceleration_rad_s2 = [20.0, 100.0][index % 2];
        robot.wheel_base_m = (index % 2 == 0).then_some(robot.radius_m);
    }
    Scenario { rescue_radius_m: 0.4, ..scenario }
}

/// The same with robots that see from a quarter of the arena's half width to all of it, and every fourth
/// everything that no obstacle hides; those on wheels look ahead.
pub fn with_sight(mut scenario: Scenario) -> Scenario {
    let half = scenario.arena_half_width_m;
    for (index, robot) in scenario.robots.iter_mut().enumerate().filter(|(index, _)| index % 4 < 3) {
        robot.sight_m = Some(half * [0.5, 1.0, 0.25][index % 4]);
        if robot.has_wheels() {
            robot.field_of_view_deg = [90.0, 300.0, 180.0][index % 4];
        }
    }
    let occlusion = !scenario.obstacles.is_empty();
    Scenario { occlusion, rescue_radius_m: 0.4, ..scenario }
}

/// Robots with limited sight tell what they see, not far, late, and not always.
pub fn with_radio(scenario: Scenario) -> Scenario {
    let range_m = Some(1.2 * scenario.arena_half_width_m);
    let told = Communication { range_m, delay_steps: 2, loss: 0.2, share: Share::Victims };
    Scenario { communication: Some(told), ..with_sight(scenario) }
}

/// The same with range sensors of unlike numbers of rays and ranges; every fifth robot has none, those on wheels
/// look ahead, and some look into every layer.
pub fn with_rays(mut scenario: Scenario) -> Scenario {
    let half = scenario.arena_half_width_m;
    let layers: Vec<String> = scenario.layers().into_iter().map(String::from).collect();
    for (index, robot) in scenario.robots.iter_mut().enumerate().filter(|(index, _)| index % 5 < 4) {
        robot.range_sensor = Some(RangeSensor {
            rays: [16, 9, 1, 45][index % 4],
            range_m: half * [0.5, 4.0, 1.5][index % 3],
            field_of_view_deg: if robot.has_wheels() { [120.0, 360.0, 350.0][index % 3] } else { 360.0 },
            layers: (index % 2 == 1).then(|| layers.clone()),
        });
    }
    scenario
}

/// The same with solid cells in a grid over the arena, which the first layer and every second other meet.
pub fn with_map(scenario: Scenario) -> Scenario {
    let rows = [
        "...#......",
        ".#.#.####.",
        ".#........",
        ".####.##..",
        "......#...",
        ".#.##.#.#.",
        ".#..#...#.",
        ".##.#.#.#.",
        "......#...",
        "..#.......",
    ];
    let layers = scenario.layers().into_iter().step_by(2).map(String::from).collect();
    let map = Map { rows: rows.map(String::from).to_vec(), layers: Some(layers) };
    Scenario { map: Some(map), arena_half_width_m: 2.0 * scenario.arena_half_width_m, ..scenario }
}

/// The solid cells of a scenario's map, one by one, and their centres, m.
pub fn cells_of(scenario: &Scenario) -> Vec<(Solid, Vec2)> {
    let Some(map) = &scenario.map else { return vec![] };
    let half = scenario.arena_half_width_m as f32;
    let width = 2.0 * half / map.rows.len() as f32;
    let mut cells = vec![];
    for (row, line) in map.rows.iter().enumerate() {
        for (column, _) in line.chars().enumerate().filter(|(_, cell)| *cell == '#') {
            let centre = Vec2::new((column as f32 + 0.5) * width - half, half - (row as f32 + 0.5) * width);
            cells.push((Solid::Box(Vec2::repeat(0.5 * width)), centre));
        }
    }
    cells
}

/// A disc at a random place, a box at a random place, and a box that stays.
pub fn some_obstacles() -> Vec<Obstacle> {
    let disc = |radius| Obstacle {
        shape: Shape::Disc,
        radius_m: Some(radius),
        half_extents_m: None,
        position_m: None,
        layers: None,
    };
    let block = |half, at| Obstacle {
        shape: Shape::Box,
        radius_m: None,
        half_extents_m: Some(half),
        position_m: at,
        layers: None,
    };
    vec![disc(0.12), disc(0.06), block([0.1, 0.04], None), block([0.04, 0.25], Some([-0.3, 0.2]))]
}

/// A fault of the default kind of onset: there from the first step to the last.
pub fn fault(robot: &str, kind: Kind, value: f64) -> Fault {
    Fault { robot: robot.into(), kind, value, onset_step: 0, onset_rate_hz: None, duration_steps: None }
}

/// Faults of every kind for every robot, which come and go at random.
pub fn coming_and_going(robots: &[Robot]) -> Vec<Fault> {
    let each = |robot: &Robot| {
        let name = robot.name.clone();
        KINDS.map(move |kind| Fault {
            onset_step: 2,
            onset_rate_hz: Some(0.5),
            duration_steps: Some(7),
            ..fault(&name, kind, 0.4)
        })
    };
    robots.iter().flat_map(each).collect()
}
