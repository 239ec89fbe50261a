//! What a scenario may be.

use super::*;

/// The error's text when `change` is made to the default scenario.
fn refusal(change: impl Fn(&mut Scenario)) -> String {
    let mut scenario = Scenario::default();
    change(&mut scenario);
    scenario.validate().expect_err("a bad scenario").to_string()
}

fn team_of(count: usize) -> Vec<Robot> {
    let named =
        |index: usize| Robot { name: format!("r{index}"), ..Scenario::default().robots[index % 4].clone() };
    (0..count).map(named).collect()
}

#[test]
fn the_default_is_valid_and_survives_json() {
    let scenario = Scenario::default();
    assert_eq!(Scenario::from_json(&scenario.to_json()), Ok(scenario.clone()));
    assert_eq!(Scenario::from_json("{}"), Ok(scenario));
}

#[test]
fn text_that_is_no_scenario_is_refused() {
    for text in [
        "",
        "[]",
        " [1]",
        "{\"colour\": 1}",
        "{\"robots\": [{\"wheels\": 3}]}",
        "{\"engine\": \"bullet\"}",
        "{\"dt_s\": NaN}",
    ] {
        assert!(matches!(Scenario::from_json(text), Err(Error::ScenarioText(_))), "{text}");
    }
}

#[test]
fn numbers_out_of_range_are_named() {
    let refused = refusal(|scenario| scenario.robots[2].mass_kg = -1.0);
    assert_eq!(refused, "scenario.robots[2].mass_kg = -1: must be in 0.01..=1000 kg");
    assert!(refusal(|scenario| scenario.dt_s = f64::NAN).starts_with("scenario.dt_s = NaN: must be"));
    assert!(refusal(|scenario| scenario.damping = 1.01).contains("in 0..=1"));
    assert!(refusal(|scenario| scenario.substeps = 0).contains("scenario.substeps = 0: must be in 1..=1000"));
    assert!(refusal(|scenario| scenario.max_victims = 33).contains("must be in 1..=32"));
    assert!(refusal(|scenario| scenario.end_when_rescued = Some(0)).contains("end_when_rescued = 0"));
    let refused = refusal(|scenario| scenario.end_when_done = true);
    assert!(refused.contains("end_when_done = true: must be false but where situation = \"listed\""));
    assert!(
        refusal(|scenario| scenario.robots[3].radius_m = f64::INFINITY).contains("robots[3].radius_m = inf")
    );
}

#[test]
fn teams_have_their_limits() {
    assert!(refusal(|scenario| scenario.robots.clear()).contains("robots (their number) = 0"));
    assert!(refusal(|scenario| scenario.robots = team_of(65)).contains("= 65: must be in 1..=64"));
    assert!(refusal(|scenario| scenario.robots[1].name = "food_0".into()).contains("names must differ"));
    assert!(refusal(|scenario| scenario.robots[0].kind = "a b".into()).contains("robots[0].kind = \"a b\""));
    let masses = "scenario.robots (heaviest to lightest mass_kg)";
    let heavy = refusal(|scenario| scenario.robots[1].mass_kg = 8.5);
    let pair = "\"food_1\" weighs 8.5 kg and \"navigation_0\" 0.5 kg";
    let rule = "must be at most 16 with engine = \"rapier\", and 100 with \"discs\"";
    assert_eq!(heavy, format!("{masses} = 17: {pair}; {rule}"));
    let heavy = |mass_kg, engine| {
        let mut scenario = Scenario { engine, ..Scenario::default() };
        scenario.robots[1].mass_kg = mass_kg;
        scenario.validate()
    };
    assert_eq!(heavy(8.0, Engine::Rapier), Ok(()));
    assert_eq!(heavy(50.0, Engine::Discs), Ok(()));
    let refused = heavy(51.0, Engine::Discs).expect_err("beyond what contacts are true for").to_string();
    let pair = "\"food_1\" weighs 51 kg and \"navigation_0\" 0.5 kg";
    assert_eq!(refused, format!("{masses} = 102: {pair}; must be at most 100"));
    assert_eq!(heavy(900.0, Engine::None), Ok(()));
    let scenario = Scenario { robots: team_of(64), ..Scenario::default() };
    assert_eq!(scenario.validate(), Ok(()));
}

#[test]
fn without_contacts_nothing_is_in_the_way_and_nothing_rubs() {
    let none = |change: fn(&mut Scenario)| {
        refusal(move |scenario| {
            scenario.engine = Engine::None;
            change(scenario);
        })
    };
    let rubbing = none(|scenario| scenario.friction = 0.5);
    assert_eq!(rubbing, "scenario.friction = 0.5: must be 0 where engine is not \"rapier\"");
    let obstacle = none(|scenario| {
        scenario.obstacles = vec![Obstacle {
            shape: Shape::Disc,
            radius_m: Some(0.1),
            half_extents_m: None,
            position_m: None,
            layers: None,
        }];
    });
    let rule = "must be none where engine = \"none\", in which nothing is in the way";
    assert_eq!(obstacle, format!("scenario.obstacles (their number) = 1: {rule}"));
}

#[test]
fn amounts_are_finite_and_the_team_has_what_is_needed() {
    let needing = |amount: f64| {
        refusal(move |scenario| {
            scenario.robots[0].abilities = [("food", 1.5), ("water", 0.25)].into();
            scenario.tasks[1].needs = [("food", amount)].into();
        })
    };
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e7] {
        assert!(needing(bad).starts_with("scenario.tasks[1].needs.food = "), "{}", needing(bad));
        assert!(needing(bad).ends_with(": must be in 0.000001..=1000000"), "{}", needing(bad));
    }
    let rule = "task \"task_2\" needs more than the whole team has, which is 2.5";
    assert_eq!(needing(2.6), format!("scenario.tasks[1].needs.food = 2.6: {rule}"));
    let mut scenario = Scenario::default();
    scenario.robots[0].abilities = [("food", 0.7), ("water", 0.25)].into();
    scenario.tasks[0].needs = [("food", 1.7), ("water", 0.25)].into();
    assert_eq!(scenario.validate(), Ok(()), "a name is an amount of 1");
    assert_eq!(scenario.abilities(), ["food", "information", "medicine", "water"]);
    assert_eq!(scenario.max_helpers(), 2);
    assert_eq!(Scenario::from_json(&scenario.to_json()), Ok(scenario));
    let zero = refusal(|scenario| scenario.robots[3].abilities = [("medicine", 0.0)].into());
    assert!(zero.starts_with("scenario.robots[3].abilities.medicine = 0: must be in"), "{zero}");
    let none = refusal(|scenario| scenario.tasks[0].needs = [].into());
    assert_eq!(none, "scenario.tasks[0].needs (their number) = 0: must be in 1..=8");
    let text = Scenario::from_json(r#"{"tasks": [{"name": "t", "needs": 3}]}"#).expect_err("a number");
    assert!(text.to_string().contains("must be a list of names or a table of amounts"), "{text}");
}

#[test]
fn a_task_needs_distinct_able_robots() {
    let needs = |needs: &[&str]| {
        let mut scenario = Scenario::default();
        scenario.tasks[1].needs = needs.iter().map(ToString::to_string).collect::<Vec<_>>().into();
        scenario.validate()
    };
    assert_eq!(needs(&["food", "food", "medicine"]), Ok(()));
    for bad in [&["food", "food", "food"][..], &["water"], &["medicine", "medicine"]] {
        let error = needs(bad).expect_err("unservable").to_string();
        assert!(error.starts_with("scenario.tasks[1].needs = "), "{error}");
    }
    assert!(needs(&[]).is_err() && needs(&["food"; 9]).is_err());
    // One robot of two abilities cannot fill two needs, but may free another for one.
    let mut scenario = Scenario::default();
    scenario.robots[2].abilities = vec!["medicine".into(), "information".into()].into();
    scenario.tasks[0].needs = vec!["medicine".into(), "information".into()].into();
    assert_eq!(scenario.validate(), Ok(()));
    scenario.tasks[0].needs = ["medicine", "information", "medicine"].map(String::from).to_vec().into();
    assert!(scenario.validate().is_err());
}

#[test]
fn an_obstacle_has_the_measures_of_its_shape() {
    let obstacle = |shape, radius_m, half_extents_m, position_m| {
        let obstacles = vec![Obstacle { shape, radius_m, half_extents_m, position_m, layers: None }];
        Scenario { obstacles, ..Scenario::default() }.validate()
    };
    assert_eq!(obstacle(Shape::Disc, Some(0.1), None, Some([0.5, -0.5])), Ok(()));
    assert_eq!(obstacle(Shape::Box, None, Some([0.1, 0.2]), None), Ok(()));
    assert!(obstacle(Shape::Disc, Some(0.1), Some([0.1, 0.1]), None).is_err());
    assert!(obstacle(Shape::Disc, None, None, None).is_err());
    assert!(obstacle(Shape::Box, Some(0.1), None, None).is_err());
    assert!(obstacle(Shape::Box, None, Some([0.0, 0.1]), None).is_err());
    assert!(obstacle(Shape::Disc, Some(0.1), None, Some([1.5, 0.0])).is_err());
}

#[test]
fn what_could_stand_nowhere_is_refused() {
    let narrow = refusal(|scenario| scenario.wall_clearance_m = 1.0);
    assert!(narrow.starts_with("scenario.wall_clearance_m = 1: must be below"), "{narrow}");
    let wide = refusal(|scenario| scenario.robots[3].radius_m = 0.5);
    assert!(wide.starts_with("scenario.robots[3].radius_m = 0.5: must be below"), "{wide}");
}

#[test]
fn robots_too_fast_for_their_substeps_are_refused() {
    let refused = refusal(|scenario| (scenario.robots[1].max_speed_mps, scenario.dt_s) = (100.0, 0.9));
    assert_eq!(
        refused,
        "scenario.robots[1].max_speed_mps = 100: must be at most 1.000000 m/s: no robot may move farther in a \
         substep (dt_s / substeps = 0.150000 s) than 3 times the smallest radius_m (0.05 m); use more substeps, \
         a smaller dt_s or engine = \"discs\""
    );
    let one = Scenario { substeps: 1, ..Scenario::default() };
    assert_eq!(one.validate(), Ok(()), "1.5 m/s are just three radii in 0.1 s");
    let fast = |engine| {
        let mut scenario = Scenario { engine, dt_s: 1.0, ..Scenario::default() };
        scenario.robots[3].max_speed_mps = 100.0;
        scenario.validate()
    };
    assert!(fast(Engine::Rapier).is_err() && fast(Engine::Discs).is_ok());
}

#[test]
fn given_places_are_inside_and_fit_together() {
    let refused = refusal(|scenario| scenario.robots[1].start_m = Some([0.0, -0.95]));
    assert!(refused.starts_with("scenario.robots[1].start_m[1] = -0.95: must be in"), "{refused}");
    let refused = refusal(|scenario| scenario.victim_area_m = Some([-0.5, -0.5, 0.95, 0.5]));
    assert!(refused.starts_with("scenario.victim_area_m[2] = 0.95: must be in -0.9..=0.9 m"), "{refused}");
    let refused = refusal(|scenario| scenario.victim_area_m = Some([0.5, f64::NAN, 0.6, 0.5]));
    assert!(refused.starts_with("scenario.victim_area_m[1] = NaN: must be"), "{refused}");
    let refused = refusal(|scenario| scenario.victim_area_m = Some([-0.5, 0.5, 0.5, 0.25]));
    let wanted = "scenario.victim_area_m[1] = 0.5: must be at most victim_area_m[3], which is 0.25";
    assert_eq!(refused, wanted);
    let refused = refusal(|scenario| scenario.victim_places_m = vec![[0.0, 0.0]]);
    assert_eq!(refused, "scenario.victim_places_m (their number) = 1: must be in 2..=256");
    let refused = refusal(|scenario| scenario.victim_places_m = vec![[0.0, 0.0], [0.0, 1.0]]);
    assert!(refused.starts_with("scenario.victim_places_m[1][1] = 1: must be in"), "{refused}");
    let refused = refusal(|scenario| {
        scenario.victim_places_m = vec![[0.5, 0.0], [0.1, 0.0], [0.100_000_000_001, -0.0]];
    });
    let wanted = "scenario.victim_places_m[2] = [0.100000000001, -0.0]: is victim_places_m[1] once more; \
                  places must differ";
    assert_eq!(refused, wanted);
    let refused = refusal(|scenario| {
        scenario.victim_places_m = vec![[0.0, 0.0], [0.5, 0.0]];
        scenario.victim_area_m = Some([-0.5, -0.5, 0.5, 0.5]);
    });
    assert!(refused.ends_with("= 2: must be 0 where victim_area_m is given"), "{refused}");
}

#[test]
fn areas_of_tasks_are_inside_and_hold_what_is_given() {
    let refused = refusal(|scenario| scenario.tasks[1].area_m = Some([-0.5, -0.5, 0.95, 0.5]));
    assert!(refused.starts_with("scenario.tasks[1].area_m[2] = 0.95: must be in -0.9..=0.9 m"), "{refused}");
    let refused = refusal(|scenario| scenario.tasks[0].area_m = Some([0.5, -0.5, 0.25, f64::NAN]));
    assert!(refused.starts_with("scenario.tasks[0].area_m[3] = NaN: must be"), "{refused}");
    let refused = refusal(|scenario| scenario.tasks[0].area_m = Some([0.5, -0.5, 0.25, 0.5]));
    assert_eq!(
        refused,
        "scenario.tasks[0].area_m[0] = 0.5: must be at most tasks[0].area_m[2], which is 0.25"
    );
    let with = |situation, places: &[[f64; 2]]| Scenario {
        situation,
        victim_places_m: places.to_vec(),
        tasks: [[-0.9, 0.0, -0.1, 0.5], [-0.5, 0.0, 0.9, 0.5]]
            .into_iter()
            .zip(Scenario::default().tasks)
            .map(|(area, task)| Task { area_m: Some(area), ..task })
            .collect(),
        ..Scenario::default()
    };
    let (left, both, right) = ([-0.9, 0.5], [-0.5, 0.0], [0.5, 0.25]);
    assert_eq!(with(Situation::Double, &[left, right]).validate(), Ok(()));
    assert_eq!(with(Situation::Double, &[left, both, right]).validate(), Ok(()));
    assert_eq!(with(Situation::Single, &[both]).validate(), Ok(()));
    let outside = [0.0, 0.75];
    let refused = with(Situation::Single, &[left, outside]).validate().expect_err("none").to_string();
    assert_eq!(
        refused,
        "scenario.tasks[1].area_m = [-0.5, 0.0, 0.9, 0.5]: has 0 of victim_places_m in it; must have at least 1, \
         or a victim of task \"task_2\" may find all of them taken"
    );
    // The other task's victim may be at the place that both have.
    let refused = with(Situation::Double, &[both, right]).validate().expect_err("one").to_string();
    assert!(refused.starts_with("scenario.tasks[0].area_m = [-0.9, 0.0, -0.1, 0.5]: has 1 of"), "{refused}");
    assert!(refused.contains("must have at least 2, or a victim of task \"task_1\""), "{refused}");
    let refused = with(Situation::Mixed, &[left, both, outside]).validate().expect_err("one").to_string();
    assert!(refused.starts_with("scenario.tasks[1].area_m"), "all of a wave may be of a task: {refused}");
    let arriving = |position_m| Scenario {
        arrivals: vec![Arrival { at_s: 0.0, task: "task_2".into(), position_m }],
        ..with(Situation::Listed, &[])
    };
    assert_eq!(arriving(right).validate(), Ok(()));
    assert_eq!(
        arriving(left).validate().expect_err("outside").to_string(),
        "scenario.arrivals[0].position_m = [-0.9, 0.5]: must be in the area of its task \"task_2\": \
         tasks[1].area_m = [-0.5, 0.0, 0.9, 0.5]"
    );
}

#[test]
fn services_and_deadlines_have_their_limits() {
    let task = |service_s: f64, deadline_s: Option<Deadline>| {
        let mut scenario = Scenario::default();
        (scenario.tasks[1].service_s, scenario.tasks[1].deadline_s) = (service_s, deadline_s);
        scenario.validate().err().map(|error| error.to_string()).unwrap_or_default()
    };
    let (same, pair) = (|s| Some(Deadline::Same(s)), |low, high| Some(Deadline::Between([low, high])));
    assert_eq!(task(-0.1, None), "scenario.tasks[1].service_s = -0.1: must be in 0..=1000000 s");
    assert!(task(f64::NAN, None).starts_with("scenario.tasks[1].service_s = NaN: must be in"));
    assert_eq!(task(0.0, same(0.0)), "scenario.tasks[1].deadline_s = 0: must be in 0.001..=1000000 s");
    assert!(
        task(0.0, pair(1.0, f64::INFINITY)).starts_with("scenario.tasks[1].deadline_s = inf: must be in")
    );
    assert_eq!(
        task(0.0, pair(2.0, 1.0)),
        "scenario.tasks[1].deadline_s = [2, 1]: must be a pair [low, high] whose low is at most its high"
    );
    assert_eq!(
        task(1.5, pair(1.0, 2.0)),
        "scenario.tasks[1].deadline_s = 1: must be at least service_s = 1.5, or no victim can be rescued"
    );
    assert_eq!(task(1.5, pair(1.5, 1.5)), "");
    assert!(
        refusal(|scenario| scenario.lost_cost = 1e7).starts_with("scenario.lost_cost = 10000000: must be")
    );
}

#[test]
fn a_deadline_is_a_number_or_a_pair() {
    let read = |deadline: &str| {
        let task = format!(r#"{{"name": "task", "needs": ["food"], "deadline_s": {deadline}}}"#);
        Scenario::from_json(&format!(r#"{{"tasks": [{task}]}}"#)).map(|scenario| scenario.tasks[0].deadline_s)
    };
    assert_eq!(read("3"), Ok(Some(Deadline::Same(3.0))));
    assert_eq!(read("[1.5, 3]"), Ok(Some(Deadline::Between([1.5, 3.0]))));
    assert_eq!(read("null"), Ok(None));
    for wrong in ["[1.5]", "[1, 2, 3]", "true", "\"soon\"", "{}"] {
        let error = read(wrong).expect_err(wrong).to_string();
        assert!(error.starts_with("scenario: deadline_s must be a number or a pair [low, high]"), "{error}");
    }
}

#[test]
fn rates_of_arrival_are_for_one_situation_and_slots_are_few() {
    let refused = |situation, rate, max_victims| {
        let mut scenario = Scenario { situation, max_victims, ..Scenario::default() };
        scenario.tasks[1].arrival_rate_hz = rate;
        scenario.validate().err().map(|error| error.to_string()).unwrap_or_default()
    };
    let of = |rest: &str| format!("scenario.tasks[1].arrival_rate_hz = {rest}");
    assert_eq!(refused(Situation::Poisson, 2.5, 16), "");
    assert_eq!(refused(Situation::Mixed, 0.0, 32), "");
    assert_eq!(refused(Situation::Mixed, 0.1, 2), of("0.1: must be 0 but where situation = \"poisson\""));
    assert!(refused(Situation::Poisson, -1.0, 2).starts_with(&of("-1: must be in 0..=100 1/s")));
    assert!(refused(Situation::Poisson, f64::NAN, 2).starts_with(&of("NaN: must be")));
    let slots = "scenario.max_victims = 17: must be at most 16: 2 tasks have 32 slots together";
    assert_eq!(refused(Situation::Poisson, 1.0, 17), slots);
}

#[test]
fn a_list_of_arrivals_names_tasks_times_and_places() {
    let refused = |change: &dyn Fn(&mut Scenario)| {
        let one = Arrival { at_s: 1.5, task: "task_2".into(), position_m: [0.5, -0.9] };
        let arrivals = vec![Arrival { at_s: 1.41, ..one.clone() }, one.clone(), one];
        let mut scenario = Scenario { situation: Situation::Listed, arrivals, ..Scenario::default() };
        scenario.max_victims = 3;
        change(&mut scenario);
        scenario.validate().err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(refused(&|_| ()), "");
    assert_eq!(refused(&|scenario| scenario.arrivals.clear()), "");
    let number = "scenario.arrivals (their number) = 3: must be 0 but where situation = \"listed\"";
    assert_eq!(refused(&|scenario| scenario.situation = Situation::Poisson), number);
    let times = refused(&|scenario| scenario.arrivals[1].at_s = -0.1);
    assert_eq!(times, "scenario.arrivals[1].at_s = -0.1: must be in 0..=1000000 s");
    let place = refused(&|scenario| scenario.arrivals[2].position_m[1] = 0.95);
    assert_eq!(place, "scenario.arrivals[2].position_m[1] = 0.95: must be in -0.9..=0.9 m");
    let task = refused(&|scenario| scenario.arrivals[0].task = "fire".into());
    assert_eq!(task, "scenario.arrivals[0].task = \"fire\": no such task; the scenario has task_1, task_2");
    let many =
        "scenario.arrivals[2].at_s = 1.5: 3 of task \"task_2\" in one control step; at most max_victims = 2";
    assert_eq!(refused(&|scenario| scenario.max_victims = 2), many);
    let obstacle = Obstacle {
        shape: Shape::Disc,
        radius_m: Some(0.1),
        half_extents_m: None,
        position_m: None,
        layers: None,
    };
    let somewhere = refused(&|scenario| scenario.obstacles = vec![obstacle.clone()]);
    assert!(somewhere.starts_with("scenario.obstacles[0].position_m = none: must be given"), "{somewhere}");
}

#[test]
fn tasks_come_after_known_others_and_never_after_themselves() {
    let after = |first: &[&str], second: &[&str]| {
        refusal(|scenario| {
            for (task, names) in scenario.tasks.iter_mut().zip([first, second]) {
                task.after = names.iter().map(ToString::to_string).collect();
            }
        })
    };
    let of = |rest: &str| format!("scenario.tasks[1].after = {rest}");
    assert_eq!(after(&[], &["task_2"]), of("\"task_2\": a task cannot come after itself"));
    assert_eq!(after(&[], &["fire"]), of("\"fire\": no such task; the scenario has task_1, task_2"));
    assert_eq!(after(&[], &["task_1", "task_1"]), of("\"task_1\": is named twice"));
    assert_eq!(
        after(&["task_2"], &["task_1"]),
        "scenario.tasks[0].after = [task_2]: \"task_1\" would come after itself; the order must have no cycle"
    );
    let mut scenario = Scenario::default();
    scenario.tasks[1].after = vec!["task_1".into()];
    assert_eq!(scenario.validate(), Ok(()));
}

/// What is said of the usual scenario with a change; nothing if it is taken.
fn words(change: impl Fn(&mut Scenario)) -> String {
    let mut scenario = Scenario::default();
    change(&mut scenario);
    scenario.validate().err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn layers_are_names_and_obstacles_block_those_of_robots() {
    let mut block = Obstacle {
        shape: Shape::Disc,
        radius_m: Some(0.1),
        half_extents_m: None,
        position_m: None,
        layers: None,
    };
    let mut refused = |layers: Option<&[&str]>| {
        block.layers = layers.map(|layers| layers.iter().map(ToString::to_string).collect());
        let obstacles = vec![block.clone()];
        words(move |scenario| {
            scenario.robots[3].layer = "air".into();
            scenario.obstacles = obstacles.clone();
        })
    };
    let of = |rest: &str| format!("scenario.obstacles[0].layers{rest}");
    assert_eq!(refused(None), "");
    assert_eq!(refused(Some(&["air"])), "");
    assert_eq!(refused(Some(&["ground", "air"])), "");
    assert_eq!(refused(Some(&[])), of(" (their number) = 0: must be in 1..=64"));
    assert_eq!(refused(Some(&["air", "air"])), of(" = \"air\": is named twice"));
    let unknown = of(" = \"sky\": no robot is in this layer; the layers are ground, air");
    assert_eq!(refused(Some(&["air", "sky"])), unknown);
    let name = words(|scenario| scenario.robots[1].layer = "the air".into());
    assert!(name.starts_with("scenario.robots[1].layer = \"the air\": must be 1 to 64 letters"), "{name}");
}

#[test]
fn masses_and_sizes_count_in_a_layer_alone() {
    let apart = |layer: &str| {
        let layer = layer.to_string();
        words(move |scenario| {
            (scenario.robots[1].mass_kg, scenario.robots[1].radius_m) = (50.0, 0.005);
            scenario.robots[1].layer = layer.clone();
            scenario.robots[1].max_speed_mps = 0.1;
        })
    };
    assert!(apart("ground").starts_with("scenario.robots (heaviest to lightest mass_kg) = 100"));
    assert_eq!(apart("air"), "");
}
