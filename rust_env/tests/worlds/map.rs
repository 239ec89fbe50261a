//! Maps: the boxes over their solid cells against the cells themselves, and what worlds do with them.

use innerattn_env::blocks::Blocks;
use innerattn_env::geometry::{Solid, Vec2};
use innerattn_env::rng::Stream;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Engine, Map, Obstacle, Scenario, Shape};
use innerattn_env::world::World;

use crate::common::{Table, cells_of, chance, options, random_drive, some_obstacles, with_layers, with_map};

/// A map whose cells are solid with a chance of their own, and one cell free.
fn random_map(source: &mut Stream, side: usize) -> Map {
    let share = source.between(0.05, 0.95);
    let free = source.below(side * side);
    let mut cell = |index: usize| if index != free && source.between(0.0, 1.0) < share { '#' } else { '.' };
    let rows = (0..side).map(|row| (0..side).map(|column| cell(row * side + column)).collect());
    Map { rows: rows.collect(), layers: None }
}

/// An arena with a map and neither robots' places nor victims' that it could be in the way of.
fn described(map: Map, half: f64) -> Scenario {
    Scenario { map: Some(map), arena_half_width_m: half, ..Scenario::default() }
}

fn place(source: &mut Stream, half: f32) -> Vec2 {
    Vec2::new(source.between(-half, half), source.between(-half, half))
}

#[test]
fn boxes_say_what_the_cells_say() {
    let mut source = chance(31);
    let (mut crossed, mut inside, mut seen) = ([0; 2], [0; 2], 0);
    for case in 0..60 {
        let side = [2, 3, 7, 20, 50, 200][case % 6];
        let half = [1.0, 0.3, 12.5][case % 3];
        let scenario = described(random_map(&mut source, side), half);
        let cells = cells_of(&scenario);
        let blocks = Blocks::new(scenario.map.as_ref().expect("a map"), half, 1);
        let half = half as f32;
        let area = |half: &Vec2| 4.0 * half.x * half.y;
        let sum = |solids: &mut dyn Iterator<Item = Solid>| {
            solids.map(|solid| if let Solid::Box(half) = solid { area(&half) } else { 0.0 }).sum::<f32>()
        };
        let (own, all) =
            (sum(&mut blocks.all().iter().map(|block| block.0)), sum(&mut cells.iter().map(|cell| cell.0)));
        assert!((own - all).abs() <= 1e-3 * all, "{own} {all}: boxes overlap or leave something out");
        assert!(blocks.all().len() <= cells.len());
        for _ in 0..40 {
            let (at, reach) = (place(&mut source, half), source.between(0.0, 0.5) * half);
            let distances = |solids: &mut dyn Iterator<Item = (Solid, Vec2)>| {
                solids.map(|(solid, centre)| solid.distance(at - centre)).fold(f32::INFINITY, f32::min)
            };
            let nearest = distances(&mut cells.iter().copied());
            let found = blocks.distance(at, reach);
            if (nearest - reach).abs() > 1e-5 * half {
                let expected = if nearest < reach { nearest } else { f32::INFINITY };
                let same = found.is_infinite() == expected.is_infinite();
                assert!(
                    same && (found.is_infinite() || (found - expected).abs() < 1e-5 * half),
                    "{found} {expected}"
                );
            }
            inside[usize::from(nearest <= 0.0)] += 1;
            let near: Vec<Vec2> = blocks.near(at, reach).map(|(_, centre)| centre).collect();
            for (solid, centre) in blocks.all() {
                let times = near.iter().filter(|other| *other == centre).count();
                assert!(times <= 1 && (times == 1 || solid.distance(at - centre) >= reach * 0.9999));
            }
            seen += near.len();
            // Along an axis, too; a way that only touches a corner is none of this test.
            let mut way = place(&mut source, half) - at;
            match source.below(4) {
                0 => way.x = 0.0,
                1 => way.y = 0.0,
                _ => {}
            }
            let reach = |grown: f32| {
                cells.iter().any(|(solid, centre)| {
                    let Solid::Box(half) = solid else { return false };
                    Solid::Box(half * grown).is_crossed(at - centre, way)
                })
            };
            if reach(0.999) == reach(1.001) {
                assert_eq!(blocks.is_crossed(at, way), reach(1.0), "{side} {at} {way}");
                crossed[usize::from(reach(1.0))] += 1;
            }
        }
    }
    assert!(crossed.iter().chain(&inside).all(|count| *count > 100), "{crossed:?} {inside:?}");
    assert!(seen > 1000);
}

#[test]
fn what_starts_or_appears_is_clear_of_solid_cells_that_block_it() {
    let scenario = with_map(with_layers(Scenario { obstacles: some_obstacles(), ..Scenario::default() }));
    let map = scenario.map.as_ref().expect("a map");
    let rules = Rules::new(scenario.clone()).expect("a valid scenario");
    let cells = cells_of(&scenario);
    let (mut inside, mut victims) = (0, 0);
    for episode in 0..300 {
        let world = World::new(&rules, 3, episode);
        let room = |at: Vec2| {
            cells.iter().map(|(solid, centre)| solid.distance(at - centre)).fold(f32::INFINITY, f32::min)
        };
        for ((at, body), robot) in world.positions.iter().zip(&rules.team).zip(&scenario.robots) {
            if map.blocks(&robot.layer) {
                assert!(room(*at) >= body.radius, "{robot:?} starts at {at}");
            } else {
                inside += usize::from(room(*at) < body.radius);
            }
        }
        for victim in world.victims.iter().flatten() {
            assert!(room(victim.position) >= scenario.wall_clearance_m as f32 - 1e-6);
            victims += 1;
        }
        for (solid, centre) in rules.solids.iter().zip(&world.obstacles).take(3) {
            assert!(room(*centre) >= solid.reach() - 1e-6, "an obstacle at {centre}");
        }
    }
    assert!(inside > 20 && victims > 300, "{inside} {victims}");
}

/// A map with one box does what an obstacle does there: to the bit with discs, and all but so with rapier,
/// which knows the box as part of a larger shape.
#[test]
fn a_box_of_a_map_is_as_solid_as_an_obstacle() {
    let rows =
        ["........", "........", "..###...", "..###...", "........", "........", "........", "........"];
    let map = Map { rows: rows.map(String::from).to_vec(), layers: None };
    let obstacle = Obstacle {
        shape: Shape::Box,
        radius_m: None,
        half_extents_m: Some([0.375, 0.25]),
        position_m: Some([-0.125, 0.25]),
        layers: None,
    };
    for (engine, tolerance) in [(Engine::Discs, 0.0), (Engine::Rapier, 2e-3)] {
        let plain = Scenario { engine, occlusion: true, contact_cost: 1.0, ..Scenario::default() };
        let mapped = Scenario { map: Some(map.clone()), ..plain.clone() };
        let mut mapped = Table::new(mapped, options(40, 1));
        let mut placed = Table::new(Scenario { obstacles: vec![obstacle.clone()], ..plain }, options(40, 1));
        let mut source = chance(5);
        let mut pushed = 0;
        for _ in 0..25 {
            let towards = |world: &World| {
                let each = world.positions.iter();
                each.map(|at| (Vec2::new(-0.125, 0.25) - at).normalize().into()).collect::<Vec<[f32; 2]>>()
            };
            let mut actions: Vec<[f32; 2]> = mapped.batch.worlds().flat_map(towards).collect();
            actions.iter_mut().step_by(3).for_each(|action| *action = random_drive(&mut source));
            let actions: Vec<[f32; 2]> = actions;
            mapped.step(&actions);
            placed.step(&actions);
            for (one, other) in mapped.batch.worlds().zip(placed.batch.worlds()) {
                for (at, same) in one.positions.iter().zip(&other.positions) {
                    assert!((at - same).norm() <= tolerance, "{engine:?}: {at} {same}");
                }
            }
            pushed += mapped.reward.iter().filter(|reward| **reward < -0.5).count();
        }
        assert!(pushed > 100, "{engine:?}: {pushed} contacts");
    }
}

#[test]
fn wrong_maps_are_refused() {
    let rows = |rows: &[&str]| Map { rows: rows.iter().map(ToString::to_string).collect(), layers: None };
    let layers = |names: &[&str]| Map {
        layers: Some(names.iter().map(ToString::to_string).collect()),
        ..rows(&["#.", ".."])
    };
    for (map, expected) in [
        (rows(&["."]), "scenario.map.rows (their number) = 1: must be in 2..=200"),
        (
            rows(&["#.", "..."]),
            "scenario.map.rows[1] = \"...\": must have 2 cells, as many as there are rows",
        ),
        (rows(&["#.", "x."]), "scenario.map.rows[1] = 'x': cells must be '#', which is solid, or '.'"),
        (rows(&["#ģ", ".."]), "scenario.map.rows[0] = \"#ģ\": must have 2 cells, as many as there are rows"),
        (rows(&["##", "##"]), "scenario.map.rows = all '#': some cells must be free"),
        (layers(&[]), "scenario.map.layers (their number) = 0: must be in 1..=64"),
        (layers(&["air"]), "scenario.map.layers = \"air\": no robot is in this layer; the layers are ground"),
        (layers(&["ground", "ground"]), "scenario.map.layers = \"ground\": is named twice"),
    ] {
        let refused = Rules::new(Scenario { map: Some(map), ..Scenario::default() }).err().expect("refused");
        assert_eq!(refused.to_string(), expected);
    }
    let none = Scenario { engine: Engine::None, map: Some(rows(&["#.", ".."])), ..Scenario::default() };
    let refused = Rules::new(none).err().expect("refused").to_string();
    assert!(
        refused.starts_with("scenario.map = a map: must be left out with engine = \"none\""),
        "{refused}"
    );
    let walled =
        Scenario { victim_places_m: vec![[0.5, -0.5], [-0.5, 0.5]], ..described(rows(&["#.", ".."]), 1.0) };
    let refused = Rules::new(walled).err().expect("refused").to_string();
    assert!(refused.starts_with("scenario.victim_places_m[1] = [-0.5, 0.5]: must be"), "{refused}");
}
