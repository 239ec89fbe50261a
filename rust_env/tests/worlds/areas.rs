//! Areas of tasks: each victim appears in the area of its task, and everything else stays as it is.

use innerattn_env::geometry::Vec2;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Engine, Scenario, Situation};
use proptest::prelude::*;

use crate::common::{Table, chance, options, random_drive, with_areas, with_arrivals};

const ENVS: usize = 4;
/// How exact worlds hold places, m.
const EXACT: f32 = 1e-6;

/// Random drives in two worlds, which must show the same.
fn assert_same(one: Scenario, other: Scenario) {
    let [mut one, mut other] = [one, other].map(|scenario| Table::new(scenario, options(ENVS, 5)));
    let mut chance = chance(5);
    for _ in 0..60 {
        let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
        one.step(&drives);
        other.step(&drives);
        assert!(one.shown(0, ENVS) == other.shown(0, ENVS));
    }
}

fn situations() -> Vec<Scenario> {
    let plain = |situation| Scenario { situation, rescue_radius_m: 0.4, ..Scenario::default() };
    let situations = [Situation::Single, Situation::Double, Situation::Mixed];
    situations.into_iter().map(plain).chain([with_arrivals(Scenario::default())]).collect()
}

#[test]
fn the_same_area_for_every_task_is_the_area_of_the_scenario() {
    let area = Some([-0.7, -0.5, 0.3, 0.9]);
    for plain in situations() {
        let whole = Scenario { victim_area_m: area, ..plain.clone() };
        let mut each = plain.clone();
        each.tasks.iter_mut().for_each(|task| task.area_m = area);
        assert_same(whole.clone(), each.clone());
        // A task's own area counts where both are given.
        let elsewhere = Some([0.5, -0.9, 0.9, -0.5]);
        assert_same(whole, Scenario { victim_area_m: elsewhere, ..each });
    }
}

#[test]
fn an_area_around_all_listed_places_changes_nothing() {
    let places = vec![[0.5, 0.5], [-0.5, 0.25], [0.9, -0.9], [-0.2, -0.7], [0.0, 0.0]];
    for plain in situations() {
        let plain = Scenario { victim_places_m: places.clone(), ..plain };
        let mut around = plain.clone();
        around.tasks[1].area_m = Some([-0.5, -0.9, 0.9, 0.5]); // places on its border are in it
        assert_same(plain, around);
    }
}

#[test]
fn a_site_of_one_place_has_one_victim() {
    let places = [[-0.75, 0.25], [0.5, -0.5]];
    let mut scenario = Scenario {
        situation: Situation::Double,
        victim_places_m: places.to_vec(),
        rescue_radius_m: 0.6,
        ..Scenario::default()
    };
    scenario.tasks[0].area_m = Some([-0.9, -0.9, 0.0, 0.9]);
    scenario.tasks[1].area_m = Some([0.0, -0.9, 0.9, 0.9]);
    let mut table = Table::new(scenario, options(ENVS, 2));
    let (mut chance, mut rescues) = (chance(2), 0);
    for _ in 0..100 {
        let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        rescues += table.rescues.len();
        for world in table.batch.worlds() {
            let at = |slot: usize| world.victims[slot].map(|victim| victim.position);
            let place = |slot: usize| Some(Vec2::new(places[slot][0] as f32, places[slot][1] as f32));
            assert_eq!([at(0), at(1)], [place(0), place(1)]);
        }
    }
    assert!(rescues > 50, "{rescues}");
}

fn refusal(scenario: Scenario) -> String {
    Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn an_area_without_room_is_refused_in_every_situation() {
    // Robots start in the middle of the area of the last of many tasks, which few trials draw.
    for mut scenario in situations() {
        let first = scenario.tasks[0].clone();
        for index in 2..16 {
            scenario.tasks.push(first.clone());
            scenario.tasks[index].name = format!("task_{}", index + 1);
        }
        scenario.robots[0].start_m = Some([0.5, 0.5]);
        scenario.tasks[15].area_m = Some([0.4, 0.4, 0.6, 0.6]);
        let refused = refusal(scenario.clone());
        let wanted =
            "scenario.tasks[15].area_m = [0.4, 0.4, 0.6, 0.6]: no place in it is spawn_clearance_m = 0.2";
        assert!(refused.starts_with(wanted), "{refused}");
        assert!(refused.contains("task \"task_16\" needs a larger one"), "{refused}");
        scenario.tasks[15].area_m = Some([0.3, 0.3, 0.7, 0.7]);
        scenario.robots.truncate(1); // nobody else may stand there
        scenario.tasks.iter_mut().for_each(|task| task.needs = vec!["food".to_string()].into());
        assert_eq!(refusal(scenario), "");
    }
}

#[test]
fn a_place_that_is_too_far_for_one_task_may_be_in_the_area_of_another() {
    let mut scenario = Scenario {
        engine: Engine::Discs,
        wall_clearance_m: 0.0,
        rescue_radius_m: 0.15,
        situation: Situation::Double,
        victim_places_m: vec![[0.0, 0.0], [1.0, 1.0]],
        ..Scenario::default()
    };
    scenario.robots[2].radius_m = 0.12; // it keeps 0.17 m from a corner
    scenario.tasks[0].needs = vec!["food".to_string()].into();
    let refused = refusal(scenario.clone());
    assert!(refused.starts_with("scenario.victim_places_m[1] = [1.0, 1.0]: is farther"), "{refused}");
    assert!(refused.contains("task task_2 can be"), "{refused}");
    scenario.tasks[0].area_m = Some([0.5, 0.5, 1.0, 1.0]);
    scenario.tasks[1].area_m = Some([-0.5, -0.5, 0.5, 0.5]);
    assert_eq!(refusal(scenario), "");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whoever is rescued or arrives, each victim is where a plain look at the scenario lets it be.
    #[test]
    fn victims_are_in_the_area_of_their_task(seed in 0..1000_u64, kind in 0..4_usize, whole: bool, listed: bool) {
        let mut scenario = with_areas(situations().swap_remove(kind));
        scenario.spawn_clearance_m = 0.05;
        let mut chance = chance(seed);
        let mut area = || {
            let [x, y] = [0, 1].map(|_| f64::from(chance.between(-0.9, 0.4)));
            let [wide, high] = [0, 1].map(|_| f64::from(chance.between(0.4, 0.9)));
            [x, y, (x + wide).min(0.9), (y + high).min(0.9)]
        };
        scenario.tasks[0].area_m = Some(area());
        scenario.tasks[1].area_m = whole.then(&mut area);
        if listed {
            let grid = |index: usize| [-0.85, -0.5, -0.15, 0.2, 0.55, 0.85].map(|y| [-0.85 + 0.17 * index as f64, y]);
            scenario.victim_places_m = (0..11).flat_map(grid).collect();
        } else {
            scenario.victim_area_m = (!whole).then(&mut area);
        }
        let Ok(rules) = Rules::new(scenario.clone()) else {
            prop_assert!(listed, "few of the places are in a small area");
            return Ok(());
        };
        let slots = rules.scenario.num_victims();
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let mut seen = 0;
        for _ in 0..40 {
            let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            for world in table.batch.worlds() {
                prop_assert!(world.victims.len() == slots);
                let victims: Vec<_> = world.victims.iter().flatten().collect();
                seen += victims.len();
                for (index, victim) in victims.iter().enumerate() {
                    let at = victim.position;
                    let own = scenario.tasks[victim.task as usize].area_m;
                    let [left, bottom, right, top] =
                        own.or(scenario.victim_area_m).unwrap_or([-0.9, -0.9, 0.9, 0.9]).map(|value| value as f32);
                    prop_assert!(left - EXACT <= at.x && at.x <= right + EXACT, "{at:?} {own:?}");
                    prop_assert!(bottom - EXACT <= at.y && at.y <= top + EXACT, "{at:?} {own:?}");
                    let place = |place: &[f64; 2]| at == Vec2::new(place[0] as f32, place[1] as f32);
                    prop_assert!(!listed || scenario.victim_places_m.iter().any(place));
                    prop_assert!(!listed || victims[..index].iter().all(|other| other.position != at));
                }
            }
        }
        prop_assert!(seen > 0);
    }
}
