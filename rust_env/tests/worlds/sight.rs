//! Limited sight: what robots see, what they remember of it, and what is none of their business.
#![allow(clippy::float_cmp, clippy::case_sensitive_file_extension_comparisons)] // flags, and names of columns

use std::collections::HashMap;
use std::iter::zip;

use innerattn_env::fault::Kind;
use innerattn_env::rng::Stream;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{DriveMode, Engine, Obstacle, Scenario, Shape, Situation, VictimOrder};
use innerattn_env::world::World;
use proptest::prelude::*;

use crate::common::{
    ENGINES, Table, chance, coming_and_going, fault, mixed_team, options, random_drive, some_obstacles,
    with_arrivals, with_batteries, with_layers, with_leaving, with_sight, with_times, with_wheels,
};

const ENVS: usize = 3;
const STEPS: usize = 60;

fn tight(engine: Engine) -> Scenario {
    Scenario { engine, spawn_clearance_m: 0.1, ..Scenario::default() }
}

/// Whether a straight way is nearer than `gap` to an obstacle's inside, in 64 bits.
fn is_crossed(obstacle: &Obstacle, gap: f64, from: [f64; 2], to: [f64; 2]) -> bool {
    let way = [to[0] - from[0], to[1] - from[1]];
    if let Some(radius) = obstacle.radius_m {
        let length = way[0].hypot(way[1]).max(1e-12);
        let along = (-(from[0] * way[0] + from[1] * way[1]) / length).clamp(0.0, length);
        let at = [from[0] + way[0] * along / length, from[1] + way[1] * along / length];
        return at[0].hypot(at[1]) < radius + gap;
    }
    // The part of the way between each pair of opposite sides (Liang & Barsky 1984).
    let half = obstacle.half_extents_m.expect("a box");
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let reach = half[axis] + gap;
        if way[axis] == 0.0 {
            if from[axis].abs() >= reach {
                return false;
            }
            continue;
        }
        let ends = [-reach, reach].map(|side| (side - from[axis]) / way[axis]);
        enters = enters.max(ends[0].min(ends[1]));
        leaves = leaves.min(ends[0].max(ends[1]));
    }
    enters < leaves
}

/// Whether a robot whose senses work sees a place; nothing where rounding decides.
fn sees(scenario: &Scenario, world: &World, own: usize, at: [f32; 2]) -> Option<bool> {
    let wide = |at: [f32; 2]| at.map(f64::from);
    let (from, to, robot) = (wide(world.positions[own].into()), wide(at), &scenario.robots[own]);
    let distance = (to[0] - from[0]).hypot(to[1] - from[1]);
    let sees = |gap: f64| {
        let hides = |(obstacle, centre): (&Obstacle, [f64; 2])| {
            let relative = |place: [f64; 2]| [place[0] - centre[0], place[1] - centre[1]];
            obstacle.blocks(&robot.layer) && is_crossed(obstacle, gap, relative(from), relative(to))
        };
        let centres = world.obstacles.iter().map(|centre| wide((*centre).into()));
        let hidden = scenario.occlusion && zip(&scenario.obstacles, centres).any(hides);
        let off = world.headings.get(own).map_or(0.0, |heading| {
            let off = (to[1] - from[1]).atan2(to[0] - from[0]) - f64::from(heading.angle);
            off.sin().atan2(off.cos()).abs()
        });
        let half = robot.field_of_view_deg.to_radians() / 2.0;
        let in_front = distance == 0.0 || robot.field_of_view_deg == 360.0 || off <= half - gap / distance;
        robot.sight_m.is_none_or(|sight| distance <= sight - gap) && in_front && !hidden
    };
    (sees(1e-5) == sees(-1e-5)).then(|| sees(0.0))
}

/// What robots of one world saw last, and when: by robot and teammate, and by robot and number of a victim.
#[derive(Default)]
struct Memory {
    mates: HashMap<(usize, usize), u32>,
    victims: HashMap<(usize, u32), u32>,
}

/// The time since, as a share.
fn share(last: Option<&u32>, world: &World, scenario: &Scenario) -> f32 {
    last.map_or(1.0, |last| {
        let time = f64::from(world.step - last) * scenario.dt_s;
        (time / (time + 1.0)) as f32
    })
}

fn near(found: f32, wanted: f32) -> bool {
    (found - wanted).abs() < 1e-5
}

/// Columns of a row, by the start of their names.
struct Columns {
    mate: usize,
    mates_from: usize,
    victim: usize,
    victims_from: usize,
}

impl Columns {
    fn new(names: &[String]) -> Self {
        let count = |start: &str| names.iter().filter(|name| name.starts_with(start)).count();
        let from = |start: &str| names.iter().position(|name| name.starts_with(start)).unwrap_or(0);
        Self {
            mate: count("teammate_0."),
            mates_from: from("teammate_"),
            victim: count("victim_0."),
            victims_from: from("victim_"),
        }
    }
}

fn changed(scenario: Scenario, more: usize) -> Scenario {
    match more {
        0 => scenario,
        1 => Scenario { faults: coming_and_going(&scenario.robots), observe_faults: true, ..scenario },
        2 => with_leaving(Scenario { obstacles: some_obstacles(), ..scenario }),
        3 => with_layers(Scenario { obstacles: some_obstacles(), robots: mixed_team(7), ..scenario }),
        4 => with_batteries(with_arrivals(scenario)),
        _ => with_times(Scenario { situation: Situation::Double, obstacles: some_obstacles(), ..scenario }),
    }
}

#[test]
fn robots_with_a_heading_see_what_is_in_their_field_of_view() {
    let plain = Scenario { obstacles: some_obstacles(), robots: mixed_team(6), ..tight(Engine::Discs) };
    let scenario = with_sight(with_wheels(plain));
    let mut table = Table::new(scenario.clone(), options(ENVS, 4));
    let (mut chance, mut counts) = (chance(4), [0; 2]);
    for _ in 0..2 * STEPS {
        let drives: Vec<_> = (0..table.reward.len()).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        for world in table.batch.worlds() {
            let victims = world.victims.iter().map(|victim| victim.map(|victim| victim.position));
            let things: Vec<_> = world.positions.iter().copied().map(Some).chain(victims).collect();
            for (own, row) in world.sightings.chunks_exact(things.len()).enumerate() {
                for (at, (last, place)) in zip(row, &things).enumerate().filter(|(at, _)| *at != own) {
                    let place = place.map(<[f32; 2]>::from);
                    let Some(seen) = place.and_then(|place| sees(&scenario, world, own, place)) else {
                        continue;
                    };
                    assert_eq!(*last == world.step, seen, "robot {own}, {at}");
                    counts[usize::from(seen)] += 1;
                }
            }
        }
    }
    assert!(counts.iter().all(|count| *count > 1000), "{counts:?}");
    let angle = |degrees: f64, drive: DriveMode| {
        let mut scenario = Scenario::default();
        (scenario.robots[2].field_of_view_deg, scenario.robots[2].drive) = (degrees, drive);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let key = "scenario.robots[2].field_of_view_deg";
    assert!(angle(90.0, DriveMode::Velocity).starts_with(&format!("{key} = 90: must be 360 of a robot")));
    assert!(angle(0.5, DriveMode::Unicycle).starts_with(&format!("{key} = 0.5: must be in 1..=360")));
    assert_eq!(angle(90.0, DriveMode::Unicycle), "");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Beside a twin that sees everything and is the same in all else: what is seen is what the twin sees, what
    /// is not seen is zeros, and the time since then is right.
    #[test]
    fn rows_hold_what_is_seen_and_when_the_rest_was(
        seed in 0..10_000_u64,
        engine in 0..2_usize,
        more in 0..6_usize,
        by_slot in any::<bool>(),
    ) {
        let mut scenario = with_sight(changed(tight(ENGINES[engine]), more));
        scenario.victim_order = if by_slot { VictimOrder::Slot } else { VictimOrder::Relevant };
        let mut blind = scenario.clone();
        blind.occlusion = false;
        blind.robots.iter_mut().for_each(|robot| robot.sight_m = None);
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let mut twin = Table::new(blind, options(ENVS, seed));
        let width = table.batch.rules().layout.width();
        let at = [&table, &twin].map(|table| Columns::new(&table.batch.rules().layout.names()));
        let other_width = twin.batch.rules().layout.width();
        let (robots, slots) = (scenario.robots.len(), scenario.num_victims());
        let mut memories: Vec<Memory> = (0..ENVS).map(|_| Memory::default()).collect();
        let (mut chance, mut unseen) = (chance(seed), 0);
        let mut before: Vec<World> = table.batch.worlds().cloned().collect();
        for step in 0..STEPS {
            let drives: Vec<_> = (0..ENVS * robots).map(|_| random_drive(&mut chance)).collect();
            if step > 0 {
                table.step(&drives);
                twin.step(&drives);
            }
            prop_assert!(table.reward == twin.reward && table.rescues == twin.rescues);
            let after: Vec<World> = table.batch.worlds().cloned().collect();
            for (env, world) in after.iter().enumerate() {
                let memory = &mut memories[env];
                if world.step == 0 {
                    *memory = Memory::default();
                }
                let absent = world.absent(table.batch.rules());
                for own in 0..robots {
                    let row = &table.obs[(env * robots + own) * width..][..width];
                    let all = &twin.obs[(env * robots + own) * other_width..][..other_width];
                    let is = |kind| world.faults.is_struck(kind, own);
                    let frozen = world.faults.frozen_row(own).is_some();
                    let held = is(Kind::FrozenSensor) && world.step > 0 && before[env].faults.frozen_row(own).is_some();
                    let freezes = world.faults.levels(own)[Kind::FrozenSensor as usize] > 0.0;
                    let looks = absent >> own & 1 == 0 && (freezes || !is(Kind::Blackout));
                    let shown = looks && !frozen && !is(Kind::Blackout);
                    prop_assert_eq!(&row[..at[0].mates_from], &all[..at[1].mates_from]);
                    let others = (0..robots).filter(|other| *other != own);
                    for (index, other) in others.enumerate() {
                        let block = &row[at[0].mates_from + index * at[0].mate..][..at[0].mate];
                        let wanted = &all[at[1].mates_from + index * at[1].mate..][..at[1].mate];
                        let there = absent >> other & 1 == 0;
                        let senses = looks && !is(Kind::LostCommunication) && there;
                        let place: [f32; 2] = world.positions[other].into();
                        let seen = match senses.then(|| sees(&scenario, world, own, place)) {
                            None => false,
                            Some(Some(seen)) => seen,
                            Some(None) => world.sightings[own * (robots + slots) + other] == world.step,
                        };
                        if !held && seen {
                            memory.mates.insert((own, other), world.step);
                        }
                        if shown {
                            let since = share(memory.mates.get(&(own, other)), world, &scenario);
                            let (block, flags) = block.split_at(at[1].mate);
                            prop_assert_eq!(flags[0], f32::from(u8::from(seen)));
                            prop_assert!(near(flags[1], since), "{} {}", flags[1], since);
                            let zeros = vec![0.0; at[1].mate];
                            prop_assert_eq!(block, if seen { wanted } else { &zeros });
                        }
                        unseen += usize::from(!seen);
                    }
                    let (mut hidden, mut in_sight) = (vec![], vec![]);
                    for (slot, victim) in world.victims.iter().enumerate() {
                        let Some(victim) = victim else {
                            hidden.push((slot, 1.0));
                            continue;
                        };
                        let place: [f32; 2] = victim.position.into();
                        let seen = looks && sees(&scenario, world, own, place).unwrap_or_else(|| {
                            world.sightings[own * (robots + slots) + robots + slot] == world.step
                        });
                        if !held && seen {
                            memory.victims.insert((own, victim.id), world.step);
                        }
                        if seen {
                            in_sight.push(slot);
                        } else {
                            hidden.push((slot, share(memory.victims.get(&(own, victim.id)), world, &scenario)));
                            unseen += 1;
                        }
                    }
                    if !shown {
                        continue;
                    }
                    let rows = row[at[0].victims_from..].chunks_exact(at[0].victim);
                    let wanted = all[at[1].victims_from..].chunks_exact(at[1].victim);
                    // The blocks of the twin whose victims are in sight, told by their places.
                    let own_place = [row[0], row[1]];
                    let place_at = 1 + scenario.abilities().len();
                    let is_in_sight = |block: &&[f32]| {
                        let to = |slot: &usize| world.victims[*slot].expect("it is there").position;
                        let fits = |slot: &usize| {
                            near(block[place_at] + own_place[0], to(slot).x)
                                && near(block[place_at + 1] + own_place[1], to(slot).y)
                        };
                        block[0] == 1.0 && in_sight.iter().any(fits)
                    };
                    if by_slot {
                        for (slot, (block, wanted)) in zip(rows, wanted).enumerate() {
                            let since = hidden.iter().find(|(other, _)| *other == slot).map_or(0.0, |one| one.1);
                            let (block, last) = block.split_at(at[1].victim);
                            let zeros = vec![0.0; at[1].victim];
                            let seen = in_sight.contains(&slot);
                            prop_assert_eq!(block, if seen { wanted } else { &zeros });
                            prop_assert!(near(last[0], since));
                        }
                    } else {
                        let wanted: Vec<&[f32]> = wanted.filter(is_in_sight).collect();
                        prop_assert_eq!(wanted.len(), in_sight.len());
                        let mut since: Vec<f32> = hidden.iter().map(|one| one.1).collect();
                        since.sort_by(f32::total_cmp);
                        for (place, block) in rows.enumerate() {
                            let (block, last) = block.split_at(at[1].victim);
                            let zeros = vec![0.0; at[1].victim];
                            prop_assert_eq!(block, wanted.get(place).copied().unwrap_or(&zeros));
                            let since = place.checked_sub(wanted.len()).map_or(0.0, |index| since[index]);
                            prop_assert!(near(last[0], since), "{} {}", last[0], since);
                        }
                    }
                }
            }
            before = after;
        }
        prop_assert!(unseen > 0, "nothing was out of sight");
    }

    /// Who sees farther than the arena is wide has the rows of one who sees everything, but for the new columns.
    #[test]
    fn a_sight_beyond_all_walls_changes_nothing(
        seed in 0..10_000_u64,
        engine in 0..2_usize,
        more in 0..6_usize,
    ) {
        let plain = changed(tight(ENGINES[engine]), more);
        let mut far = plain.clone();
        far.robots.iter_mut().for_each(|robot| robot.sight_m = Some(1000.0));
        let mut tables = [plain, far].map(|scenario| Table::new(scenario, options(ENVS, seed)));
        let names = tables.each_ref().map(|table| table.batch.rules().layout.names());
        let is_new = |name: &String| name.ends_with(".seen") || name.ends_with(".since_seen");
        let kept: Vec<usize> = (0..names[1].len()).filter(|at| !is_new(&names[1][*at])).collect();
        prop_assert!(kept.iter().map(|at| &names[1][*at]).eq(&names[0]));
        let mut chance = chance(seed);
        for _ in 0..STEPS {
            let drives: Vec<_> = (0..tables[0].reward.len()).map(|_| random_drive(&mut chance)).collect();
            for table in &mut tables {
                table.step(&drives);
            }
            prop_assert!(tables[0].reward == tables[1].reward && tables[0].rescues == tables[1].rescues);
            let rows = tables[1].obs.chunks_exact(names[1].len());
            let old: Vec<u32> = rows.flat_map(|row| kept.iter().map(|at| row[*at].to_bits())).collect();
            prop_assert!(old.into_iter().eq(tables[0].obs.iter().map(|value| value.to_bits())));
            for row in tables[1].obs.chunks_exact(names[1].len()).filter(|row| more != 1 && row[..4] != [0.0; 4]) {
                for (at, name) in names[1].iter().enumerate().filter(|(_, name)| name.ends_with(".seen")) {
                    prop_assert!(row[at] == 1.0 || more == 2, "{name}");
                    prop_assert!(row[at] == 0.0 || row[at + 1] == 0.0, "{name}");
                }
            }
        }
    }

    /// Whatever becomes of what a robot does not see, as long as it does not see it: its row is the same.
    #[test]
    fn what_is_out_of_sight_never_changes_a_row(
        seed in 0..10_000_u64,
        ordered in any::<bool>(),
        walls in any::<bool>(),
    ) {
        let obstacles = if walls { some_obstacles() } else { vec![] };
        let mut scenario = Scenario { max_victims: 6, obstacles, ..Scenario::default() };
        if ordered {
            scenario.tasks[1].after = vec!["task_1".into()];
        }
        let scenario = Scenario { rescue_radius_m: 0.15, ..with_sight(scenario) };
        let mut table = Table::new(scenario.clone(), options(1, seed));
        let (robots, slots) = (scenario.robots.len(), scenario.num_victims());
        let width = table.batch.rules().layout.width();
        let mut chance = chance(seed);
        let place = |chance: &mut Stream| [chance.between(-0.9, 0.9), chance.between(-0.9, 0.9)];
        let mut moved = 0;
        for _ in 0..STEPS {
            table.step(&(0..robots).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            let own = chance.below(robots);
            let image = table.batch.snapshot();
            let world = table.batch.worlds().next().expect("one").clone();
            let row = table.obs[own * width..][..width].to_vec();
            let out_of_sight = |at: [f32; 2]| sees(&scenario, &world, own, at) == Some(false);
            let (mut places, mut speeds) = (vec![], vec![]);
            for (robot, (at, speed)) in zip(&world.positions, &world.velocities).enumerate() {
                let (mut at, mut speed): ([f32; 2], [f32; 2]) = ((*at).into(), (*speed).into());
                let elsewhere = place(&mut chance);
                if robot != own && out_of_sight(at) && out_of_sight(elsewhere) {
                    (at, speed) = (elsewhere, [0.1, -0.2]);
                    moved += 1;
                }
                places.extend(at);
                speeds.extend(speed);
            }
            let (mut present, mut tasks, mut spots) = (vec![], vec![], vec![]);
            for victim in &world.victims {
                let (mut task, mut at) = victim.map_or((0, [0.0; 2]), |one| (one.task, one.position.into()));
                let elsewhere = place(&mut chance);
                if victim.is_some() && out_of_sight(at) && out_of_sight(elsewhere) {
                    (task, at) = (chance.below(2) as u32, elsewhere);
                    moved += 1;
                }
                // One that appears where the robot does not see it, too.
                let appears = victim.is_none() && out_of_sight(elsewhere) && chance.below(2) == 0;
                present.push(victim.is_some() || appears);
                tasks.push(i64::from(task));
                spots.extend(if appears { elsewhere } else { at });
            }
            prop_assert_eq!(present.len(), slots);
            table.batch.set_motion(&places, &speeds).expect("places inside");
            table.batch.set_victims(&present, &tasks, &spots).expect("victims inside");
            let mut rows = vec![f32::NAN; robots * width];
            table.batch.observe(&mut rows);
            prop_assert_eq!(&rows[own * width..][..width], &row[..]);
            table.batch.restore(&image).expect("its own image");
        }
        prop_assert!(moved > 0, "nothing was out of sight");
    }

    /// A world and its mirror image have mirrored rows, to the bit, whatever was seen before.
    #[test]
    fn mirrored_worlds_give_mirrored_rows(seed in 0..10_000_u64, mirror in 0..4_usize) {
        let block = |shape, radius_m, half_extents_m, at| Obstacle {
            shape,
            radius_m,
            half_extents_m,
            position_m: Some(at),
            layers: None,
        };
        let turned = |[x, y]: [f32; 2]| match mirror {
            0 => [-x, y],
            1 => [x, -y],
            2 => [y, x],
            _ => [-y, x],
        };
        let fixed = |[x, y]: [f64; 2]| turned([x as f32, y as f32]).map(f64::from);
        let half = |[x, y]: [f64; 2]| if mirror < 2 { [x, y] } else { [y, x] };
        let worlds = [false, true].map(|is_turned| {
            let at = |place| if is_turned { fixed(place) } else { place };
            let size = |sides| Some(if is_turned { half(sides) } else { sides });
            let obstacles = vec![
                block(Shape::Disc, Some(0.15), None, at([0.3, -0.25])),
                block(Shape::Box, None, size([0.25, 0.1]), at([-0.25, 0.375])),
            ];
            // Nothing moves by itself, and nobody is rescued.
            let scenario = with_sight(Scenario { obstacles, ..Scenario::default() });
            Scenario { rescue_radius_m: 0.1, damping: 1.0, engine: Engine::Discs, ..scenario }
        });
        let mut tables = worlds.map(|scenario| Table::new(scenario, options(1, seed)));
        let names = tables[0].batch.rules().layout.names();
        let mut chance = chance(seed);
        let mut hidden = 0;
        for step in 0..20 {
            let tasks = [0, 1];
            let draw = |chance: &mut Stream, count: usize| -> Vec<[f32; 2]> {
                (0..count).map(|_| [chance.between(-0.9, 0.9), chance.between(-0.9, 0.9)]).collect()
            };
            let (places, spots) = (draw(&mut chance, 4), draw(&mut chance, 2));
            let all = [false, true].map(|is_turned| {
                let table = &mut tables[usize::from(is_turned)];
                if step > 0 {
                    table.step(&[[0.0; 2]; 4]);
                }
                let of = |values: &[[f32; 2]]| -> Vec<f32> {
                    values.iter().flat_map(|one| if is_turned { turned(*one) } else { *one }).collect()
                };
                table.batch.set_motion(&of(&places), &[0.0; 8]).expect("places inside");
                table.batch.set_victims(&[true; 2], &tasks, &of(&spots)).expect("victims inside");
                let mut rows = vec![f32::NAN; 4 * names.len()];
                table.batch.observe(&mut rows);
                rows
            });
            let row_of = |rows: &[f32], robot: usize| rows[robot * names.len()..][..names.len()].to_vec();
            for robot in 0..4 {
                let (mut row, other) = (row_of(&all[0], robot), row_of(&all[1], robot));
                for (at, name) in names.iter().enumerate().filter(|(_, name)| name.ends_with(".x")) {
                    prop_assert!(names[at + 1].ends_with(".y"), "{name}");
                    [row[at], row[at + 1]] = turned([row[at], row[at + 1]]);
                }
                hidden += names.iter().zip(&row).filter(|(name, seen)| name.ends_with(".seen") && **seen == 0.0).count();
                prop_assert_eq!(row, other);
            }
        }
        prop_assert!(hidden > 0);
    }
}

#[test]
fn a_victim_that_waits_for_one_out_of_sight_does_not_look_blocked() {
    let mut scenario = Scenario { situation: Situation::Double, ..Scenario::default() };
    scenario.tasks[1].after = vec!["task_1".into()];
    scenario.robots[0].sight_m = Some(0.5);
    let mut table = Table::new(scenario, options(1, 0));
    let names = table.batch.rules().layout.names();
    let places = [0.0, 0.0, -0.9, 0.9, -0.8, 0.9, -0.7, 0.9];
    table.batch.set_motion(&places, &[0.0; 8]).expect("places inside");
    table.batch.set_victims(&[true; 2], &[0, 1], &[0.6, 0.0, 0.3, 0.0]).expect("victims inside");
    let mut rows = vec![0.0; 4 * names.len()];
    table.batch.observe(&mut rows);
    let shown = |robot: usize, name: &str| {
        rows[robot * names.len() + names.iter().position(|other| other == name).expect(name)]
    };
    let blocked = |robot| [shown(robot, "victim_0.blocked"), shown(robot, "victim_1.blocked")];
    let present = |robot| [shown(robot, "victim_0.present"), shown(robot, "victim_1.present")];
    assert_eq!((present(0), blocked(0)), ([1.0, 0.0], [0.0, 0.0]));
    assert_eq!((present(1), blocked(1)), ([1.0, 1.0], [1.0, 0.0]), "the nearer one comes first");
}

#[test]
fn sights_that_see_nothing_and_occlusion_without_obstacles_are_refused() {
    type Change = fn(&mut Scenario);
    let refusal = |change: Change| {
        let mut scenario = Scenario::default();
        change(&mut scenario);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let cases: [(Change, &str); 7] = [
        (|scenario| scenario.robots[1].sight_m = Some(0.051), ""),
        (|scenario| scenario.robots[1].sight_m = Some(1000.0), ""),
        (
            |scenario| scenario.robots[1].sight_m = Some(0.05),
            "scenario.robots[1].sight_m = 0.05: must be above radius_m = 0.05 m",
        ),
        (
            |scenario| scenario.robots[1].sight_m = Some(-1.0),
            "scenario.robots[1].sight_m = -1: must be in 0.005..=1000 m",
        ),
        (
            |scenario| scenario.robots[1].sight_m = Some(f64::NAN),
            "scenario.robots[1].sight_m = NaN: must be in 0.005..=1000 m",
        ),
        (
            |scenario| scenario.robots[1].sight_m = Some(f64::INFINITY),
            "scenario.robots[1].sight_m = inf: must be in 0.005..=1000 m",
        ),
        (
            |scenario| scenario.occlusion = true,
            "scenario.occlusion = true: must be false where there are no obstacles to hide behind",
        ),
    ];
    for (change, wanted) in cases {
        let refused = refusal(change);
        assert!(refused.starts_with(wanted) && refused.is_empty() == wanted.is_empty(), "{refused}");
    }
}

#[test]
fn a_frozen_sensor_keeps_what_was_seen_and_nothing_is_noted_meanwhile() {
    let mut scenario = Scenario { engine: Engine::Discs, damping: 1.0, ..Scenario::default() };
    scenario.robots[0].sight_m = Some(0.5);
    scenario.rescue_radius_m = 0.1;
    let mut held = fault("food_0", Kind::FrozenSensor, 1.0);
    (held.onset_step, held.duration_steps) = (3, Some(4));
    scenario.faults = vec![held];
    let mut table = Table::new(scenario, options(1, 0));
    let names = table.batch.rules().layout.names();
    let column = |name: &str| names.iter().position(|other| other == name).expect(name);
    let (seen, since) = (column("teammate_0.seen"), column("teammate_0.since_seen"));
    let mut shown = vec![];
    for step in 0..8 {
        // In sight up to step 3 and in steps 5 and 6, while its sensors are frozen.
        let x = if step < 3 || (4..6).contains(&step) { 0.3 } else { 0.8 };
        table.batch.set_motion(&[0.0, 0.0, x, 0.0, -0.9, 0.9, 0.9, 0.9], &[0.0; 8]).expect("inside");
        let mut rows = vec![0.0; 4 * names.len()];
        table.batch.observe(&mut rows);
        shown.push((rows[seen], (10.0 * rows[since] / (1.0 - rows[since])).round()));
        table.step(&[[0.0; 2]; 4]);
    }
    assert_eq!(shown[..7], [(1.0, 0.0); 7]);
    assert_eq!(shown[7], (0.0, 4.0), "last seen at step 3");
}
