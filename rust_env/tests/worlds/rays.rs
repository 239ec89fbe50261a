//! Range sensors: what rays measure, against a plain ray caster in 64 bits that tries everything.
#![allow(clippy::float_cmp)] // readings of nothing, and rows to the bit

use innerattn_env::fault::Kind;
use innerattn_env::geometry::{Solid, Vec2};
use innerattn_env::rng::Stream;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{DriveMode, Engine, Map, Obstacle, RangeSensor, Scenario, Shape};
use innerattn_env::world::World;
use proptest::prelude::*;

use crate::common::{
    ENGINES, Table, cells_of, chance, coming_and_going, fault, mixed_team, options, random_drive,
    some_obstacles, with_layers, with_leaving, with_map, with_rays, with_sight, with_wheels,
};

const STEPS: usize = 40;

/// How far a ray goes from the place `from` until it meets a disc or a box grown by `gap`, in 64 bits.
fn met_after(solid: Solid, centre: Vec2, gap: f64, from: [f64; 2], angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let at = [from[0] - f64::from(centre.x), from[1] - f64::from(centre.y)];
    match solid {
        Solid::Disc(radius) => {
            // The roots of |at + t · direction|² = radius².
            let radius = f64::from(radius) + gap;
            let (half, rest) = (at[0] * cos + at[1] * sin, at[0] * at[0] + at[1] * at[1] - radius * radius);
            let root = half * half - rest;
            match (rest <= 0.0, root < 0.0) {
                (true, _) => 0.0,
                (false, false) if half < 0.0 => -half - root.sqrt(),
                _ => f64::INFINITY,
            }
        }
        Solid::Box(half) => {
            let half = [f64::from(half.x) + gap, f64::from(half.y) + gap];
            if at[0].abs() <= half[0] && at[1].abs() <= half[1] {
                return 0.0;
            }
            // Each of the four sides for itself.
            let mut nearest = f64::INFINITY;
            for (axis, speed, other_speed) in [(0, cos, sin), (1, sin, cos)] {
                for side in [-half[axis], half[axis]] {
                    let time = (side - at[axis]) / speed;
                    let aside = at[1 - axis] + time * other_speed;
                    if time >= 0.0 && aside.abs() <= half[1 - axis] {
                        nearest = nearest.min(time);
                    }
                }
            }
            nearest
        }
    }
}

/// What a ray of robot `own` reads where everything is grown by `gap`.
fn reading(scenario: &Scenario, world: &World, absent: u64, own: usize, angle: f64, gap: f64) -> f64 {
    let robot = &scenario.robots[own];
    let sensor = robot.range_sensor.as_ref().expect("a sensor");
    let meets = |layer: &str| match &sensor.layers {
        Some(layers) => layers.iter().any(|name| name == layer),
        None => robot.layer == layer,
    };
    let layers: Vec<&str> = scenario.robots.iter().map(|robot| robot.layer.as_str()).collect();
    let from = [f64::from(world.positions[own].x), f64::from(world.positions[own].y)];
    let angle = angle + world.headings.get(own).map_or(0.0, |heading| f64::from(heading.angle));
    let mut nearest = sensor.range_m;
    let mut meet = |solid: Solid, centre: Vec2| {
        nearest = nearest.min(met_after(solid, centre, gap, from, angle));
    };
    for (other, mate) in scenario.robots.iter().enumerate() {
        if other != own && absent >> other & 1 == 0 && meets(&mate.layer) {
            meet(Solid::Disc(mate.radius_m as f32), world.positions[other]);
        }
    }
    for (obstacle, centre) in scenario.obstacles.iter().zip(&world.obstacles) {
        if layers.iter().any(|layer| obstacle.blocks(layer) && meets(layer)) {
            meet(solid_of(obstacle), *centre);
        }
    }
    let blocks = |map: &Map| layers.iter().any(|layer| map.blocks(layer) && meets(layer));
    if scenario.map.as_ref().is_some_and(blocks) {
        for (solid, centre) in cells_of(scenario) {
            meet(solid, centre);
        }
    }
    let (sin, cos) = angle.sin_cos();
    for (at, speed) in [(from[0], cos), (from[1], sin)] {
        let room = scenario.arena_half_width_m - gap - at * speed.signum();
        nearest = nearest.min((room / speed.abs()).max(0.0));
    }
    1.0 - nearest / sensor.range_m
}

fn solid_of(obstacle: &Obstacle) -> Solid {
    match (obstacle.radius_m, obstacle.half_extents_m) {
        (Some(radius), _) => Solid::Disc(radius as f32),
        (None, half) => Solid::Box(half.map(|[x, y]| Vec2::new(x as f32, y as f32)).expect("a box")),
    }
}

/// The angles of a sensor's rays, rad.
fn angles(sensor: &RangeSensor) -> Vec<f64> {
    let (count, field) = (sensor.rays as f64, sensor.field_of_view_deg * std::f64::consts::PI / 180.0);
    (0..sensor.rays)
        .map(|ray| match (sensor.rays, sensor.field_of_view_deg < 360.0) {
            (1, _) => 0.0,
            (_, true) => field * (ray as f64 / (count - 1.0) - 0.5),
            (_, false) => field * ray as f64 / count,
        })
        .collect()
}

/// Holds all readings of a world against the plain caster; counts those of nothing, of something, and
/// those that rounding decides.
fn check(table: &Table, scenario: &Scenario, counts: &mut [usize; 3]) {
    let rules = table.batch.rules();
    let names = rules.layout.names();
    let first = names.iter().position(|name| name == "own.ray.0").expect("rays");
    let width = names.iter().filter(|name| name.starts_with("own.ray.")).count();
    for (env, world) in table.batch.worlds().enumerate() {
        let absent = world.absent(rules);
        for (own, robot) in scenario.robots.iter().enumerate() {
            let row = &table.obs[(env * rules.team.len() + own) * names.len()..][..names.len()];
            let found = &row[first..first + width];
            let Some(sensor) = robot.range_sensor.as_ref().filter(|_| absent >> own & 1 == 0) else {
                assert!(found.iter().all(|value| *value == 0.0));
                continue;
            };
            assert!(found[sensor.rays..].iter().all(|value| *value == 0.0), "of rays that it lacks");
            for (value, angle) in found.iter().zip(angles(sensor)) {
                let [least, most] =
                    [-2e-4, 2e-4].map(|gap| reading(scenario, world, absent, own, angle, gap));
                // A ray that grazes something may miss it, or may not.
                if most - least > 0.02 / sensor.range_m.min(1.0) {
                    counts[2] += 1;
                    continue;
                }
                let (value, slack) = (f64::from(*value), 1e-4);
                assert!(
                    (least - slack..=most + slack).contains(&value),
                    "{value} is not in {least}..={most}: robot {own}, {angle} rad, {world:?}"
                );
                counts[usize::from(value > 0.0)] += 1;
            }
        }
    }
}

/// A scenario of some sort whose robots have rays.
fn some_scenario(sort: usize, engine: Engine) -> Scenario {
    let plain = Scenario { engine, robots: mixed_team(7), arena_half_width_m: 1.3, ..Scenario::default() };
    let scattered = Scenario { obstacles: some_obstacles(), ..plain.clone() };
    with_rays(match sort {
        0 => plain,
        1 => scattered,
        2 => with_layers(scattered),
        3 => with_wheels(scattered),
        4 => with_map(with_wheels(with_layers(scattered))),
        5 => with_leaving(scattered),
        _ => with_map(with_sight(scattered)),
    })
}

#[test]
fn rays_measure_what_a_plain_caster_measures() {
    let mut all = [0; 3];
    for sort in 0..7 {
        let mut counts = [0; 3];
        for engine in ENGINES {
            let scenario = some_scenario(sort, engine);
            let mut table = Table::new(scenario.clone(), options(2, sort as u64));
            let mut chance = chance(sort as u64);
            for _ in 0..STEPS {
                check(&table, &scenario, &mut counts);
                let drives: Vec<_> = (0..table.reward.len()).map(|_| random_drive(&mut chance)).collect();
                table.step(&drives);
            }
        }
        assert!(counts[0] > 200 && counts[1] > 2000, "{sort}: {counts:?}");
        assert!(counts[2] * 20 < counts[0] + counts[1], "{sort}: {counts:?}");
        all = [0, 1, 2].map(|at| all[at] + counts[at]);
    }
    println!("nothing, something, unsure: {all:?}");
}

/// Robot 0 at the origin, with rays, of a team that stands elsewhere.
fn readings(change: impl Fn(&mut Scenario), others: [[f32; 2]; 3]) -> Vec<f32> {
    let mut scenario = Scenario::default();
    let sensor = RangeSensor { rays: 4, range_m: 0.8, field_of_view_deg: 360.0, layers: None };
    scenario.robots[0].range_sensor = Some(sensor);
    change(&mut scenario);
    let rules = Rules::new(scenario).expect("a valid scenario");
    let mut world = World::new(&rules, 0, 0);
    world.positions[0] = Vec2::zeros();
    for (place, other) in world.positions[1..].iter_mut().zip(others) {
        *place = other.into();
    }
    world.headings.iter_mut().for_each(|heading| heading.angle = 0.0);
    let mut rows = vec![0.0; 4 * rules.layout.width()];
    world.observe(&rules, &mut rows);
    let names = rules.layout.names();
    names
        .iter()
        .zip(&rows)
        .filter(|(name, _)| name.starts_with("own.ray."))
        .map(|(_, value)| *value)
        .collect()
}

#[test]
fn readings_are_shares_of_the_range_from_the_centre() {
    let near = |found: Vec<f32>, wanted: &[f32]| {
        assert_eq!(found.len(), wanted.len());
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {wanted:?}");
    };
    // East 0.45 m to the rim, north out of range, west 0.2 − 0.05 m, south behind the first.
    let others = [[0.5, 0.0], [-0.2, 0.0], [-0.6, 0.0]];
    near(readings(|_| (), others), &[1.0 - 0.45 / 0.8, 0.0, 1.0 - 0.15 / 0.8, 0.0]);
    // In another layer there is nothing, unless the sensor looks there.
    let aloft = |scenario: &mut Scenario| scenario.robots[1].layer = "air".into();
    near(readings(aloft, others), &[0.0, 0.0, 1.0 - 0.15 / 0.8, 0.0]);
    let looks_up = |scenario: &mut Scenario| {
        aloft(scenario);
        let sensor = scenario.robots[0].range_sensor.as_mut().expect("a sensor");
        sensor.layers = Some(vec!["air".into()]);
    };
    near(readings(looks_up, others), &[1.0 - 0.45 / 0.8, 0.0, 0.0, 0.0]);
    // A fan of rays from right to left, straight ahead in the middle.
    let fan = |scenario: &mut Scenario| {
        scenario.robots[0].drive = DriveMode::Unicycle;
        let sensor = scenario.robots[0].range_sensor.as_mut().expect("a sensor");
        (sensor.rays, sensor.field_of_view_deg, sensor.range_m) = (3, 180.0, 2.0);
    };
    near(readings(fan, others), &[0.5, 1.0 - 0.45 / 2.0, 0.5]);
    // What begins inside of something reads 1: without contacts robots may stand on each other.
    let through = |scenario: &mut Scenario| scenario.engine = Engine::None;
    near(readings(through, [[0.01, 0.0], [0.9, 0.9], [-0.9, 0.9]]), &[1.0; 4]);
}

#[test]
fn failing_senses_measure_nothing_or_what_they_measured_before() {
    let struck = |kind: Kind| {
        let mut scenario = with_rays(Scenario { obstacles: some_obstacles(), ..Scenario::default() });
        scenario.faults = vec![fault("food_1", kind, 1.0)];
        let mut healthy = Table::new(Scenario { faults: vec![], ..scenario.clone() }, options(1, 3));
        let mut table = Table::new(scenario, options(1, 3));
        let names = table.batch.rules().layout.names();
        let rays: Vec<usize> = (0..names.len()).filter(|at| names[*at].starts_with("own.ray.")).collect();
        let of = |table: &Table| rays.iter().map(|at| table.obs[names.len() + at]).collect::<Vec<_>>();
        let before = of(&table);
        for table in [&mut table, &mut healthy] {
            for _ in 0..5 {
                table.step(&[[1.0, 0.0]; 4]);
            }
        }
        (before, of(&table), of(&healthy))
    };
    let (before, dark, healthy) = struck(Kind::Blackout);
    assert!(
        before.iter().chain(&dark).all(|value| *value == 0.0) && healthy.iter().any(|value| *value > 0.0)
    );
    let (before, frozen, healthy) = struck(Kind::FrozenSensor);
    assert!(before == frozen && frozen != healthy);
    let (_, noisy, healthy) = struck(Kind::PositionNoise);
    assert_eq!(noisy, healthy, "rays measure from where the robot is");
    let (_, deaf, healthy) = struck(Kind::LostCommunication);
    assert_eq!(deaf, healthy);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Rays that reach farther change what is measured by the range alone, and nothing else of a world.
    #[test]
    fn rays_change_nothing_but_their_columns(seed in 0..10_000_u64, engine in 0..2_usize, sort in 0..7_usize) {
        let rays = some_scenario(sort, ENGINES[engine]);
        let mut plain = rays.clone();
        plain.robots.iter_mut().for_each(|robot| robot.range_sensor = None);
        let mut far = rays.clone();
        for sensor in far.robots.iter_mut().filter_map(|robot| robot.range_sensor.as_mut()) {
            sensor.range_m *= 2.0;
        }
        let mut tables = [plain, rays, far].map(|scenario| Table::new(scenario, options(2, seed)));
        let names = tables.each_ref().map(|table| table.batch.rules().layout.names());
        let is_ray = |name: &String| name.starts_with("own.ray.");
        let kept: Vec<usize> = (0..names[1].len()).filter(|at| !is_ray(&names[1][*at])).collect();
        let rays: Vec<usize> = (0..names[1].len()).filter(|at| is_ray(&names[1][*at])).collect();
        prop_assert!(kept.iter().map(|at| &names[1][*at]).eq(&names[0]) && names[1] == names[2]);
        let mut chance: Stream = chance(seed);
        for _ in 0..STEPS {
            let drives: Vec<_> = (0..tables[0].reward.len()).map(|_| random_drive(&mut chance)).collect();
            for table in &mut tables {
                table.step(&drives);
            }
            let [plain, near, far] = &tables;
            prop_assert!(plain.reward == near.reward && plain.rescues == near.rescues);
            let rows = near.obs.chunks_exact(names[1].len());
            let old: Vec<u32> = rows.clone().flat_map(|row| kept.iter().map(|at| row[*at].to_bits())).collect();
            prop_assert!(old.into_iter().eq(plain.obs.iter().map(|value| value.to_bits())));
            for (row, far) in rows.zip(far.obs.chunks_exact(names[1].len())) {
                for at in &rays {
                    let (near, far) = (row[*at], far[*at]);
                    prop_assert!((0.0..=1.0).contains(&near));
                    // 1 − d / 2r = (1 + (1 − d / r)) / 2 where something is within r.
                    prop_assert!(near == 0.0 && far <= 0.5 || (far - 0.5 * (1.0 + near)).abs() < 1e-5);
                }
            }
        }
    }
}

#[test]
fn sensors_that_make_no_sense_are_refused() {
    let refusal = |change: fn(&mut RangeSensor, &mut Scenario)| {
        let mut scenario = Scenario::default();
        let mut sensor = RangeSensor { rays: 8, range_m: 1.0, field_of_view_deg: 360.0, layers: None };
        change(&mut sensor, &mut scenario);
        scenario.robots[1].range_sensor = Some(sensor);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(refusal(|_, _| ()), "");
    let key = "scenario.robots[1].range_sensor";
    for (found, wanted) in [
        (refusal(|sensor, _| sensor.rays = 0), "rays = 0: must be in 1..=360"),
        (refusal(|sensor, _| sensor.rays = 361), "rays = 361: must be in 1..=360"),
        (refusal(|sensor, _| sensor.range_m = 0.05), "range_m = 0.05: must be above radius_m = 0.05 m"),
        (refusal(|sensor, _| sensor.range_m = f64::NAN), "range_m = NaN: must be in 0.005..=1000 m"),
        (
            refusal(|sensor, _| sensor.field_of_view_deg = 90.0),
            "field_of_view_deg = 90: must be 360 of a robot",
        ),
        (refusal(|sensor, _| sensor.field_of_view_deg = 0.5), "field_of_view_deg = 0.5: must be in 1..=360"),
        (
            refusal(|sensor, _| sensor.layers = Some(vec!["air".into()])),
            "layers = \"air\": no robot is in this layer",
        ),
        (refusal(|sensor, _| sensor.layers = Some(vec![])), "layers (their number) = 0: must be in 1..=64"),
    ] {
        assert!(found.starts_with(&format!("{key}.{wanted}")), "{found}");
    }
    let wheels = refusal(|sensor, scenario| {
        sensor.field_of_view_deg = 90.0;
        scenario.robots[1].drive = DriveMode::Differential;
    });
    assert_eq!(wheels, "");
}

#[test]
fn robots_that_come_and_go_are_met_only_while_they_are_there() {
    let team = Scenario::default().robots;
    let scenario =
        with_rays(with_leaving(Scenario { faults: coming_and_going(&team), ..Scenario::default() }));
    let mut table = Table::new(scenario.clone(), options(4, 5));
    let (mut counts, mut chance, mut gone) = ([0; 3], chance(5), 0);
    for _ in 0..60 {
        let drives: Vec<_> = (0..table.reward.len()).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        gone += table.batch.worlds().filter(|world| world.absent(table.batch.rules()) != 0).count();
        check(&table, &scenario, &mut counts);
    }
    assert!(gone > 50, "{gone}");
}

#[test]
fn obstacles_of_both_forms_are_met_from_everywhere() {
    // Against the distance: no ray is shorter than it, and the best of many comes near to it.
    let mut source = chance(8);
    for case in 0..300 {
        let solid = if case % 2 == 0 { Solid::Disc(0.3) } else { Solid::Box(Vec2::new(0.4, 0.1)) };
        let way = Vec2::new(source.between(-1.0, 1.0), source.between(-1.0, 1.0));
        let distance = solid.distance(-way);
        let rays = (0..720).map(|ray| (ray as f32).to_radians() * 0.5);
        let met = rays.map(|angle| solid.met_after(way, Vec2::new(angle.cos(), angle.sin())));
        let nearest = met.fold(f32::INFINITY, f32::min);
        assert!(nearest >= distance - 1e-5 && nearest <= distance + 0.02, "{solid:?} {way} {nearest}");
    }
}

#[test]
fn rays_of_a_turned_world_change_places_to_the_bit() {
    let box_of = |half| Obstacle {
        shape: Shape::Box,
        radius_m: None,
        half_extents_m: Some([half, half]),
        position_m: None,
        layers: None,
    };
    let mut scenario = Scenario { obstacles: vec![box_of(0.1), box_of(0.04)], ..Scenario::default() };
    scenario.obstacles.push(some_obstacles().remove(0));
    for robot in &mut scenario.robots {
        let sensor = RangeSensor { rays: 24, range_m: 1.2, field_of_view_deg: 360.0, layers: None };
        robot.range_sensor = Some(sensor);
    }
    let rules = Rules::new(scenario).expect("a valid scenario");
    let rays: Vec<usize> =
        (0..rules.layout.width()).filter(|at| rules.layout.names()[*at].starts_with("own.ray.")).collect();
    let read = |world: &World| {
        let mut rows = vec![0.0; 4 * rules.layout.width()];
        world.observe(&rules, &mut rows);
        let rows = rows.chunks_exact(rules.layout.width());
        rows.map(|row| rays.iter().map(|at| row[*at]).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    for stream in 0..200 {
        let world = World::new(&rules, 1, stream);
        let plain = read(&world);
        let turned = |turn: fn(Vec2) -> Vec2| {
            let mut world = world.clone();
            world.positions.iter_mut().chain(&mut world.obstacles).for_each(|at| *at = turn(*at));
            read(&world)
        };
        let (mirrored, swapped) = (turned(|at| Vec2::new(-at.x, at.y)), turned(|at| at.yx()));
        for robot in 0..4 {
            for ray in 0..24 {
                assert_eq!(mirrored[robot][(12 + 24 - ray) % 24], plain[robot][ray]);
                assert_eq!(swapped[robot][(6 + 24 - ray) % 24], plain[robot][ray]);
            }
        }
    }
}
