//! Images that were forged, with a right checksum.

use super::*;
use crate::scenario::{Arrival, Deadline, Obstacle, Scenario, Shape, Situation};

fn rules(scenario: Scenario) -> Rules {
    Rules::new(scenario).expect("a valid scenario")
}

/// Why worlds are refused that are no worlds of these rules, though the checksum is right.
fn refusal(change: impl Fn(&mut World)) -> String {
    let rules = rules(Scenario { episode_steps: 9, end_when_rescued: Some(3), ..Scenario::default() });
    let mut worlds = [World::new(&rules, 0, 0), World::new(&rules, 0, 1)];
    assert_eq!(load(&rules, 2, &save(&rules, 2, worlds.iter())), Ok(worlds.to_vec()));
    change(&mut worlds[1]);
    let error = load(&rules, 2, &save(&rules, 2, worlds.iter())).expect_err("a forged image").to_string();
    error.strip_prefix("snapshot: env 1 does not fit the scenario: its ").unwrap_or(&error).into()
}

#[test]
fn worlds_that_do_not_fit_are_refused() {
    type Change = fn(&mut World);
    let changes: [(&str, Change); 31] = [
        ("episode", |world| world.episode = u64::MAX),
        ("step", |world| world.step = 10),
        ("step", |world| world.step = u32::MAX),
        ("over", |world| world.step = 9),
        ("over", |world| world.over = true),
        ("over", |world| world.rescued = 3),
        ("fresh", |world| world.episode = 1),
        ("fresh", |world| world.step = 1),
        ("rescued", |world| world.rescued = 1),
        ("appeared", |world| world.appeared = 0),
        ("appeared", |world| world.appeared = u32::MAX),
        ("victim_words", |world| world.victim_words = 1 << 40),
        ("positions", |world| world.positions[2].x = f32::NAN),
        ("positions", |world| world.positions[2].x = 1.01),
        ("positions", |world| world.positions[3].y = -7.0),
        ("positions", |world| world.positions.push(Vec2::zeros())),
        ("velocities", |world| world.velocities[0].y = f32::INFINITY),
        ("velocities", |world| world.velocities[0].y = 2e4),
        ("velocities", |world| world.velocities.clear()),
        ("obstacles", |world| world.obstacles.push(Vec2::zeros())),
        ("victims", |world| world.victims.push(None)),
        ("appeared", |world| world.victims.clear()),
        ("victims", |world| world.victims[0].as_mut().expect("one is present").task = 2),
        ("victims", |world| world.victims[0].as_mut().expect("one is present").id = 9),
        ("victims", |world| world.victims[0].as_mut().expect("one is present").appeared_step = 1),
        ("victims", |world| world.victims[0].as_mut().expect("one is present").position.x = 0.95),
        ("victims", |world| world.victims[0].as_mut().expect("one is present").position.y = f32::NAN),
        ("victims", |world| {
            world.victims = vec![world.victims[0]; 2];
            world.appeared = 2;
        }),
        ("victims", |world| {
            (world.victims, world.appeared) = (vec![None; 2], 0);
        }),
        ("faults", |world| world.faults.forge_level(0, 1, -1.0)),
        ("faults", |world| world.faults.forge_level(0, 1, 0.5)),
    ];
    for (number, (what, change)) in changes.into_iter().enumerate() {
        assert_eq!(refusal(change), what, "change {number}");
    }
}

#[test]
fn obstacles_stay_where_they_are_given() {
    let disc = |position_m| Obstacle {
        shape: Shape::Disc,
        radius_m: Some(0.1),
        half_extents_m: None,
        position_m,
        layers: None,
    };
    let rules =
        rules(Scenario { obstacles: vec![disc(Some([0.5, 0.5])), disc(None)], ..Scenario::default() });
    let refused = |index: usize, at: Vec2| {
        let mut world = World::new(&rules, 0, 0);
        world.obstacles[index] = at;
        load(&rules, 1, &save(&rules, 1, [world].iter())).is_err()
    };
    assert!(refused(0, Vec2::new(0.5, 0.4)) && !refused(0, Vec2::new(0.5, 0.5)));
    assert!(refused(1, Vec2::new(0.0, 0.91)) && !refused(1, Vec2::new(0.0, 0.89)));
}

#[test]
fn another_version_and_bytes_left_over_are_refused() {
    let rules = rules(Scenario::default());
    let head = Head { version: VERSION + 1, scenario: rules.scenario.to_json(), num_envs: 0 };
    let image = sealed(postcard::to_extend(&head, MAGIC.to_vec()).expect("plain data serialises"));
    let error = load(&rules, 0, &image).expect_err("another version").to_string();
    assert_eq!(error, "snapshot: version 3 was found; this version reads 2");
    let mut image = save(&rules, 1, [World::new(&rules, 0, 0)].iter());
    image.truncate(image.len() - CHECKSUM_BYTES);
    image.extend([0; 3]);
    let error = load(&rules, 1, &sealed(image)).expect_err("an extended image").to_string();
    assert_eq!(error, "snapshot: 3 bytes are left over after the last env");
}

#[test]
fn an_image_from_before_a_key_was_added_is_taken() {
    let rules = rules(Scenario::default());
    let worlds = [World::new(&rules, 0, 0)];
    let text = |older: &str| {
        let head = Head { version: VERSION, scenario: older.into(), num_envs: 1 };
        let mut bytes = postcard::to_extend(&head, MAGIC.to_vec()).expect("plain data serialises");
        bytes = postcard::to_extend(&worlds[0], bytes).expect("plain data serialises");
        load(&rules, 1, &sealed(bytes))
    };
    let older =
        rules.scenario.to_json().replace(r#","victim_places_m":[]"#, "").replace(r#","start_m":null"#, "");
    let times = r#","service_s":0.0,"service":"keep","deadline_s":null"#;
    let older = older.replace(times, "").replace(r#","lost_cost":0.0"#, "");
    let keys = r#","after":[],"arrival_rate_hz":0.0,"area_m":null"#;
    let older = older.replace(keys, "").replace(r#","arrivals":[]"#, "");
    let older = older.replace(r#","battery":null"#, "").replace(r#","stations":[]"#, "");
    let older = older.replace(r#","load":null"#, "").replace(r#","depots":[]"#, "");
    let older = older.replace(r#","end_when_done":false"#, "");
    for key in [
        "battery",
        "stations",
        "load",
        "depots",
        "end_when_done",
        "arriv",
        "after",
        "\"area_m",
        "victim_places_m",
        "start_m",
        "service_s",
        "deadline_s",
        "lost_cost",
    ] {
        assert!(!older.contains(key));
    }
    assert_eq!(text(&older), Ok(worlds.to_vec()));
    let other = older.replace(r#""substeps":6"#, r#""substeps":7"#);
    assert_eq!(text(&other), Err(Error::Snapshot("it was made with another scenario".into())));
    assert!(text("{").is_err());
}

/// A scenario whose first task has a service of three steps, and whose second task has deadlines.
fn timed() -> Rules {
    let mut scenario = Scenario { situation: Situation::Double, ..Scenario::default() };
    scenario.tasks[0].service_s = 0.3;
    scenario.tasks[1].deadline_s = Some(Deadline::Between([0.5, 2.0]));
    rules(scenario)
}

#[test]
fn services_and_losses_are_kept_and_checked() {
    type Change = fn(&mut World);
    let rules = timed();
    let mut world = World::new(&rules, 5, 7);
    (world.step, world.fresh) = (4, false);
    (world.lost, world.appeared) = (2, 4);
    world.victims[0].as_mut().expect("double has all").served_steps = 2;
    let bytes = |world: &World| save(&rules, 1, [world].into_iter());
    let back = load(&rules, 1, &bytes(&world)).expect("a state of these rules");
    assert_eq!(back, [world.clone()]);
    assert_ne!(back[0].victims[1].expect("double has all").deadline_step, u32::MAX);
    let changes: [(&str, Change); 4] = [
        ("services", |world| world.victims[0].as_mut().expect("double has all").served_steps = 3),
        ("services", |world| world.victims[1].as_mut().expect("double has all").served_steps = 1),
        ("lost", |world| world.lost = 9),
        ("appeared", |world| world.lost = 1),
    ];
    for (what, change) in changes {
        let mut forged = world.clone();
        change(&mut forged);
        let error = load(&rules, 1, &bytes(&forged)).expect_err("a forged image").to_string();
        assert_eq!(error, format!("snapshot: env 0 does not fit the scenario: its {what}"));
    }
}

#[test]
fn a_world_that_is_done_is_over() {
    let arrivals = vec![Arrival { at_s: 0.3, task: "task_2".into(), position_m: [0.5, 0.5] }];
    let rules = rules(Scenario {
        situation: Situation::Listed,
        arrivals,
        end_when_done: true,
        ..Scenario::default()
    });
    let is_taken = |step, over, waits: bool| {
        let mut world = World::new(&rules, 5, 7);
        (world.step, world.over, world.fresh) = (step, over, false);
        (world.appeared, world.rescued) = (u32::from(step >= 3), u32::from(step >= 3 && !waits));
        world.victims[2] = (step >= 3 && waits).then(|| Victim::new(0, 1, 3, Vec2::new(0.5, 0.5)));
        load(&rules, 1, &save(&rules, 1, [world].iter())).is_ok()
    };
    assert!(is_taken(2, false, false) && !is_taken(2, true, false), "it has not arrived");
    assert!(is_taken(4, true, false) && !is_taken(4, false, false), "nobody is left");
    assert!(is_taken(4, false, true) && is_taken(4, true, true), "it waits, or was put there afterwards");
}

#[test]
fn loads_are_kept_and_checked() {
    let mut scenario = Scenario::default();
    scenario.robots[1].load = Some(3);
    let rules = rules(scenario);
    let bytes = |loads: &[u32]| {
        let mut world = World::new(&rules, 5, 7);
        world.loads = loads.to_vec();
        save(&rules, 1, [world].iter())
    };
    let back = load(&rules, 1, &bytes(&[0, 2, 0, 0])).expect("a state of these rules");
    assert_eq!(back[0].loads, [0, 2, 0, 0]);
    assert!(bytes(&[0, 2, 0, 0]).len() <= most_bytes(&rules, 1));
    for loads in [[0, 4, 0, 0].as_slice(), &[1, 3, 0, 0], &[0, 3, 0], &[0, 3, 0, 0, 0]] {
        let error = load(&rules, 1, &bytes(loads)).expect_err("forged loads").to_string();
        assert_eq!(error, "snapshot: env 0 does not fit the scenario: its loads");
    }
}

#[test]
fn headings_are_kept_and_checked() {
    use crate::scenario::DriveMode;
    use crate::wheels::Heading;
    let mut scenario = Scenario::default();
    scenario.robots[1].drive = DriveMode::Unicycle;
    let rules = rules(scenario);
    let bytes = |headings: &[(f32, f32)]| {
        let mut world = World::new(&rules, 5, 7);
        let heading = |(angle, turn_rate): &(f32, f32)| Heading { angle: *angle, turn_rate: *turn_rate };
        world.headings = headings.iter().map(heading).collect();
        save(&rules, 1, [world].iter())
    };
    let (still, right) = ((0.0, 0.0), (-std::f32::consts::PI, 4.0));
    let back = load(&rules, 1, &bytes(&[still, right, still, still])).expect("a state of these rules");
    assert_eq!(back[0].headings[1], Heading { angle: right.0, turn_rate: right.1 });
    assert!(bytes(&[still, right, still, still]).len() <= most_bytes(&rules, 1));
    for forged in [(3.2, 0.0), (f32::NAN, 0.0), (0.0, 4.1), (0.0, -4.1), (0.0, f32::NAN)] {
        let error = load(&rules, 1, &bytes(&[still, forged, still, still])).expect_err("a forged heading");
        assert_eq!(error.to_string(), "snapshot: env 0 does not fit the scenario: its headings");
    }
    for forged in [&[still, right, still][..], &[still; 5], &[], &[right, right, still, still]] {
        let error = load(&rules, 1, &bytes(forged)).expect_err("forged headings").to_string();
        assert_eq!(error, "snapshot: env 0 does not fit the scenario: its headings");
    }
}

#[test]
fn sightings_are_kept_and_checked() {
    use crate::sight::NEVER;
    type Change = fn(&mut World);
    let mut scenario = Scenario { situation: Situation::Double, ..Scenario::default() };
    scenario.robots[0].sight_m = Some(0.06); // it sees nobody
    let rules = rules(scenario);
    let mut world = World::new(&rules, 5, 7);
    (world.step, world.fresh) = (4, false);
    world.perceive(&rules);
    (world.sightings[1], world.sightings[5]) = (3, 0);
    let bytes = |world: &World| save(&rules, 1, [world].into_iter());
    assert_eq!(load(&rules, 1, &bytes(&world)), Ok(vec![world.clone()]));
    assert!(bytes(&world).len() <= most_bytes(&rules, 1));
    let changes: [Change; 7] = [
        |world| world.sightings[0] = 3,      // itself
        |world| world.sightings[1] = 4,      // whom it does not see
        |world| world.sightings[1] = 5,      // in the future
        |world| world.sightings[7] = 3,      // whom it sees now
        |world| world.sightings[10] = NEVER, // a victim that it sees now
        |world| world.sightings.truncate(23),
        |world| world.sightings.push(NEVER),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut forged = world.clone();
        change(&mut forged);
        let error = load(&rules, 1, &bytes(&forged)).expect_err("a forged image").to_string();
        assert_eq!(error, "snapshot: env 0 does not fit the scenario: its sightings", "{number}");
    }
}

#[test]
fn traffic_is_kept_and_checked() {
    use crate::scenario::{Communication, Share};
    use crate::sight::NEVER;
    type Change = fn(&mut World);
    let told = Communication { delay_steps: 2, share: Share::Victims, ..Communication::default() };
    let mut scenario =
        Scenario { situation: Situation::Double, communication: Some(told), ..Scenario::default() };
    scenario.robots[0].sight_m = Some(0.06); // it sees nobody
    let rules = rules(scenario);
    let mut world = World::new(&rules, 5, 7);
    world.fresh = false;
    for step in 1..5 {
        world.step = step;
        world.perceive(&rules);
    }
    // By step modulo 3: of steps 3, 4 and 2, of which the last is heard now.
    assert_eq!(world.traffic.heard, [0b1110, 0b1101, 0b1011, 0b0111]);
    assert_eq!(world.traffic.sent, [0, 3, 3, 3].repeat(3));
    assert_eq!(world.traffic.told, [2; 8]);
    let bytes = |world: &World| save(&rules, 1, [world].into_iter());
    assert_eq!(load(&rules, 1, &bytes(&world)), Ok(vec![world.clone()]));
    assert!(bytes(&world).len() <= most_bytes(&rules, 1));
    let changes: [Change; 14] = [
        |world| world.traffic.links[0] |= 1,      // itself
        |world| world.traffic.links[0] |= 1 << 4, // nobody
        |world| world.traffic.links[4] &= !2,     // whom it reaches now
        |world| world.traffic.links.truncate(11),
        |world| world.traffic.sent[0] |= 4, // no slot
        |world| world.traffic.sent[5] = 0,  // what it sees now
        |world| world.traffic.sent.push(0),
        |world| world.traffic.heard[0] = 0,
        |world| world.traffic.heard.push(0),
        |world| world.traffic.told[0] = 3, // it cannot have been told yet
        |world| world.traffic.told[0] = 1, // it is told now
        |world| world.traffic.told[0] = NEVER,
        |world| world.traffic.told.truncate(7),
        |world| world.traffic = crate::radio::Traffic::default(),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut forged = world.clone();
        change(&mut forged);
        let error = load(&rules, 1, &bytes(&forged)).expect_err("a forged image").to_string();
        assert_eq!(error, "snapshot: env 0 does not fit the scenario: its traffic", "{number}");
    }
    let mut early = World::new(&rules, 5, 7);
    early.traffic.links[4] = 2; // of a step that has not come
    assert!(load(&rules, 1, &bytes(&early)).is_err());
}

#[test]
fn images_of_worlds_whose_victims_take_no_time_are_what_they_were() {
    let rules = rules(Scenario::default());
    let world = World::new(&rules, 0, 0);
    let head = Head { version: 2, scenario: rules.scenario.to_json(), num_envs: 1 };
    let earlier = postcard::to_extend(&head, MAGIC.to_vec()).expect("plain data serialises");
    let earlier = sealed(postcard::to_extend(&world, earlier).expect("plain data serialises"));
    assert_eq!(save(&rules, 1, [&world].into_iter()), earlier);
}
