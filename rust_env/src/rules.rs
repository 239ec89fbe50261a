//! A scenario found valid and made ready to play: every constant that worlds share, computed once. There
//! is no other way from a description to a world.

use crate::blocks::Blocks;
use crate::energy::Energy;
use crate::error::{Error, Result};
use crate::fault::{HEALTHY, Kind};
use crate::geometry::{Solid, Vec2};
use crate::meeting::{can_reach, least_rescue_radius};
use crate::observe::Layout;
use crate::physics::Physics;
use crate::radio::Radio;
use crate::rays::Rays;
use crate::reward::Weights;
use crate::robot::{Body, bodies};
use crate::scenario::{Arrival, Engine, Scenario};
use crate::sight::Sight;
use crate::spawn::{Crowded, Spawn};
use crate::supply::Supplies;
use crate::tasks::Needs;
use crate::tasks::arrivals::Arrivals;
use crate::tasks::deadline::Deadlines;
use crate::tasks::order::Order;
use crate::tasks::service::Service;
use crate::wheels::Wheels;

/// One of the scenario's faults, as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    /// Index of the robot.
    pub robot: usize,
    /// What goes wrong.
    pub kind: Kind,
    /// How badly.
    pub value: f32,
    /// Step at which it begins, or may begin.
    pub onset: u32,
    /// How often it begins in a control step, if at random.
    pub rate: Option<f32>,
    /// Steps it lasts; `u32::MAX` for ever.
    pub duration: u32,
}

/// What all worlds of a batch share, made of a valid scenario.
#[non_exhaustive] // made by `Rules::new` alone
pub struct Rules {
    /// The description it was made from.
    pub scenario: Scenario,
    /// The robots' constants, in team order.
    pub team: Vec<Body>,
    /// What each task needs.
    pub tasks: Vec<Needs>,
    /// How long each task's victims are served.
    pub services: Vec<Service>,
    /// When victims are lost, if ever.
    pub deadlines: Option<Deadlines>,
    /// How many victims come whatever becomes of others, if any.
    pub arrivals: Option<Arrivals>,
    /// Which tasks come before which, if any.
    pub order: Option<Order>,
    /// Batteries and stations, if any.
    pub energy: Option<Energy>,
    /// Loads and depots, if any.
    pub supplies: Option<Supplies>,
    /// Robots on wheels, if any.
    pub wheels: Option<Wheels>,
    /// How far robots see, where something limits it.
    pub sight: Option<Sight>,
    /// How robots communicate, where something limits it or they share something.
    pub radio: Option<Radio>,
    /// The obstacles' forms.
    pub solids: Vec<Solid>,
    /// Solid cells of the map, if there is one.
    pub blocks: Option<Blocks>,
    /// Motion and contacts.
    pub physics: Physics,
    /// Columns of an observation.
    pub layout: Layout,
    /// Weights of the rewards.
    pub weights: Weights,
    /// What appears where.
    pub spawn: Spawn,
    /// The scenario's faults, but for those that leave their robot healthy.
    pub faults: Vec<Process>,
}

impl Rules {
    /// The one door for a scenario: checks every value, every rule between values and, in 64 trial
    /// episodes, that everything finds a place, then makes it ready. All else takes what this returns.
    ///
    /// What no scenario says is checked where it is given: the number of worlds and threads, and whether
    /// their memory is to be had, when a [`crate::batch::Batch`] is made.
    ///
    /// # Errors
    /// [`Error::Scenario`] for the first rule that is broken.
    pub fn new(scenario: Scenario) -> Result<Self> {
        scenario.validate()?;
        let team = bodies(&scenario);
        let tasks = Needs::of_tasks(&scenario);
        let solids: Vec<Solid> = scenario.obstacles.iter().map(Solid::of).collect();
        let spawn = Spawn::new(&scenario, &team, &solids);
        if let Some(crowded) = spawn.find_crowding() {
            return Err(too_crowded(&scenario, crowded));
        }
        refuse_tasks_out_of_reach(&scenario, &team, &tasks)?;
        let arriving: Vec<[f64; 2]> = scenario.arrivals.iter().map(|arrival| arrival.position_m).collect();
        for (places, one) in [(&scenario.victim_places_m, "victim_places_m"), (&arriving, "arrivals")] {
            if let Some(index) = spawn.blocked_place(places) {
                return Err(Error::Scenario {
                    key: format!("scenario.{one}[{index}]"),
                    value: format!("{:?}", places[index]),
                    rule: "must be wall_clearance_m away from every obstacle that has a place".into(),
                });
            }
        }
        let (sight, radio) = (Sight::new(&scenario, &team, &solids), Radio::new(&scenario));
        Ok(Self {
            physics: Physics::new(&scenario),
            layout: Layout::new(
                &scenario,
                &tasks,
                sight.clone(),
                radio.clone(),
                Rays::new(&scenario, &solids),
            ),
            services: Service::of_tasks(&scenario),
            deadlines: Deadlines::new(&scenario),
            arrivals: Arrivals::new(&scenario),
            order: Order::new(&scenario),
            energy: Energy::new(&scenario),
            supplies: Supplies::new(&scenario),
            wheels: Wheels::new(&scenario),
            weights: Weights::new(&scenario),
            faults: processes(&scenario),
            blocks: Blocks::of(&scenario),
            sight,
            radio,
            spawn,
            scenario,
            team,
            tasks,
            solids,
        })
    }

    /// Reads a description from JSON and takes it through the door.
    ///
    /// # Errors
    /// [`Error::ScenarioText`] for text of the wrong form, [`Error::Scenario`] for the first broken rule.
    pub fn from_json(text: &str) -> Result<Self> {
        Self::new(Scenario::from_json(text)?)
    }
}

/// Refuses what no team can do for want of room: helpers that cannot meet, places that they cannot reach.
fn refuse_tasks_out_of_reach(scenario: &Scenario, team: &[Body], tasks: &[Needs]) -> Result<()> {
    let (radius, arena) = (scenario.rescue_radius_m as f32, scenario.arena_half_width_m as f32);
    for (task, needs) in scenario.tasks.iter().zip(tasks) {
        let (apart, at_most) = least_rescue_radius(needs, team);
        if radius < at_most && scenario.engine != Engine::None {
            return Err(Error::Scenario {
                key: "scenario.rescue_radius_m".into(),
                value: scenario.rescue_radius_m.to_string(),
                rule: format!(
                    "must be at least {:.3}, or the helpers of task {} cannot be so near to a victim together",
                    (apart * 1e3).ceil() / 1e3,
                    task.name
                ),
            });
        }
        let far =
            |at: &[f64; 2]| !can_reach(needs, team, Vec2::new(at[0] as f32, at[1] as f32), radius, arena);
        let arrives_far = |one: &Arrival| one.task == task.name && far(&one.position_m);
        let place = scenario.victim_places_m.iter().position(|at| task.holds(at) && far(at));
        let place = place.map(|index| ("victim_places_m", index, scenario.victim_places_m[index]));
        let arrival = scenario.arrivals.iter().position(arrives_far);
        let arrival = arrival.map(|index| ("arrivals", index, scenario.arrivals[index].position_m));
        if let Some((one, index, at)) = place.or(arrival) {
            return Err(Error::Scenario {
                key: format!("scenario.{one}[{index}]"),
                value: format!("{at:?}"),
                rule: format!(
                    "is farther than rescue_radius_m from where helpers of task {} can be; walls keep them off",
                    task.name
                ),
            });
        }
    }
    Ok(())
}

/// The error that names what does not fit into the arena.
fn too_crowded(scenario: &Scenario, crowded: Crowded) -> Error {
    if let Crowded::Victims(task) = crowded
        && let Some(area) = scenario.tasks[task].area_m
    {
        return Error::Scenario {
            key: format!("scenario.tasks[{task}].area_m"),
            value: format!("{area:?}"),
            rule: format!(
                "no place in it is spawn_clearance_m = {} from all robots (and wall_clearance_m from obstacles); \
                 task {:?} needs a larger one, or smaller clearances",
                scenario.spawn_clearance_m, scenario.tasks[task].name
            ),
        };
    }
    let (key, value, rule) = match crowded {
        Crowded::Obstacles => (
            "scenario.obstacles (their number)",
            scenario.obstacles.len().to_string(),
            "no room for them at random places without overlap; use fewer, smaller, or a wider arena",
        ),
        Crowded::Robots => (
            "scenario.robots (their number)",
            scenario.robots.len().to_string(),
            "no room for them without overlap; use fewer, smaller, or a wider arena, and start_m that are apart",
        ),
        Crowded::Victims(_) => (
            "scenario.spawn_clearance_m",
            scenario.spawn_clearance_m.to_string(),
            "no place is so far from all robots (and wall_clearance_m from obstacles); use a smaller one",
        ),
    };
    Error::Scenario { key: key.into(), value, rule: rule.into() }
}

#[allow(clippy::float_cmp)] // the healthy value itself, not one near it
fn processes(scenario: &Scenario) -> Vec<Process> {
    let index = |name: &String| scenario.robots.iter().position(|robot| robot.name == *name);
    scenario
        .faults
        .iter()
        .filter(|fault| fault.value as f32 != HEALTHY[fault.kind as usize]) // it would do nothing
        .map(|fault| Process {
            robot: index(&fault.robot).unwrap_or_default(),
            kind: fault.kind,
            value: fault.value as f32,
            onset: fault.onset_step,
            rate: fault.onset_rate_hz.map(|rate| (rate * scenario.dt_s) as f32),
            duration: fault.duration_steps.unwrap_or(u32::MAX),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Obstacle, Shape, Situation};

    fn refusal(change: impl Fn(&mut Scenario)) -> String {
        let mut scenario = Scenario::default();
        change(&mut scenario);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    }

    #[test]
    fn what_finds_no_place_is_refused() {
        let refused = refusal(|scenario| scenario.spawn_clearance_m = 3.0);
        assert!(refused.starts_with("scenario.spawn_clearance_m = 3: no place is so far"), "{refused}");
        let refused = refusal(|scenario| scenario.robots.iter_mut().for_each(|robot| robot.radius_m = 0.45));
        assert!(refused.starts_with("scenario.robots (their number) = 4: no room for them"), "{refused}");
        let refused = refusal(|scenario| {
            for robot in &mut scenario.robots[..2] {
                robot.start_m = Some([0.5, 0.5]);
            }
        });
        assert!(refused.ends_with("start_m that are apart"), "{refused}");
        let refused = refusal(|scenario| {
            scenario.victim_places_m = vec![[0.0, 0.0], [0.5, 0.5]];
            scenario.obstacles = vec![Obstacle {
                shape: Shape::Disc,
                radius_m: Some(0.1),
                half_extents_m: None,
                position_m: Some([0.5, 0.65]),
                layers: None,
            }];
        });
        assert!(
            refused.starts_with("scenario.victim_places_m[1] = [0.5, 0.5]: must be wall_clear"),
            "{refused}"
        );
        let refused = refusal(|scenario| {
            scenario.situation = Situation::Listed;
            scenario.arrivals = vec![Arrival { at_s: 0.0, task: "task_1".into(), position_m: [0.5, 0.5] }];
            scenario.obstacles = vec![Obstacle {
                shape: Shape::Disc,
                radius_m: Some(0.1),
                half_extents_m: None,
                position_m: Some([0.5, 0.65]),
                layers: None,
            }];
        });
        assert!(refused.starts_with("scenario.arrivals[0] = [0.5, 0.5]: must be wall_clear"), "{refused}");
        let disc = r#"{"shape": "disc", "radius_m": 0.6}"#;
        let text = format!(r#"{{"obstacles": [{disc}, {disc}, {disc}]}}"#);
        let refused = Rules::from_json(&text).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.starts_with("scenario.obstacles (their number) = 3: no room for them"), "{refused}");
    }

    #[test]
    fn the_door_refuses_what_breaks_a_rule_and_what_is_no_scenario() {
        assert!(refusal(|scenario| scenario.substeps = 0).starts_with("scenario.substeps = 0: must be"));
        assert!(matches!(Rules::from_json("[]"), Err(Error::ScenarioText(_))));
        assert_eq!(refusal(|_| ()), "");
    }

    #[test]
    fn a_fault_of_the_healthy_value_is_left_out() {
        let fault = |kind: Kind, value: f64| crate::fault::Fault {
            robot: "food_1".into(),
            kind,
            value,
            onset_step: 3,
            onset_rate_hz: Some(2.0),
            duration_steps: None,
        };
        let faults = vec![fault(Kind::MotorGain, 1.0), fault(Kind::Blackout, 0.5)];
        let rules = Rules::new(Scenario { faults, ..Scenario::default() });
        let wanted = Process {
            robot: 1,
            kind: Kind::Blackout,
            value: 0.5,
            onset: 3,
            rate: Some(0.2),
            duration: u32::MAX,
        };
        assert_eq!(rules.map(|rules| rules.faults), Ok(vec![wanted]));
    }

    fn refused_team(robots: &str, more: &str) -> String {
        let lifter = |name: &str, radius: f32| {
            format!(
                r#"{{"name": "{name}", "kind": "lifter", "abilities": ["lift"], "radius_m": {radius},
                "max_speed_mps": 1.0, "mass_kg": 1.0}}"#
            )
        };
        let team: Vec<String> = robots
            .split(' ')
            .map(|radius| lifter(&format!("r{}", radius.replace('.', "_")), radius.parse().unwrap()))
            .collect();
        let text = format!(
            r#"{{"arena_half_width_m": 3.0, "robots": [{}], "tasks": [{{"name": "beam", "needs": ["lift", "lift"]}}]{more}}}"#,
            team.join(", ")
        );
        Rules::from_json(&text).err().map(|error| error.to_string()).unwrap_or_default()
    }

    #[test]
    fn helpers_that_cannot_meet_are_refused_with_the_radius_that_would_do() {
        let narrow = r#", "rescue_radius_m": 0.15"#;
        let refused = refused_team("0.3 0.301", narrow);
        assert!(refused.starts_with("scenario.rescue_radius_m = 0.15: must be at least 0.301"), "{refused}");
        assert_eq!(refused_team("0.3 0.301", r#", "rescue_radius_m": 0.301"#), "");
        assert_eq!(refused_team("0.3 0.301 0.1 0.11", narrow), ""); // two others can
        assert_ne!(refused_team("0.3 0.301 0.1", narrow), "");
        // Without contacts all can be at one place.
        assert_eq!(refused_team("0.3 0.301", r#", "rescue_radius_m": 0.15, "engine": "none""#), "");
    }

    #[test]
    fn listed_places_that_no_helper_reaches_are_refused() {
        let corner = r#", "rescue_radius_m": 0.35, "wall_clearance_m": 0.0, "victim_places_m": [[0.0, 0.0], [3.0, 3.0]]"#;
        assert!(refused_team("0.3 0.301", corner).starts_with("scenario.victim_places_m[1] = [3.0, 3.0]: "));
        assert_eq!(refused_team("0.2 0.201", corner), "");
    }
}
