//! Communication: who hears whom, and what robots learn of victims from those that they hear.
#![allow(clippy::float_cmp, clippy::case_sensitive_file_extension_comparisons)] // flags, and names of columns

use std::collections::HashMap;

use innerattn_env::fault::Kind;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Communication, Engine, Scenario, Share, Situation, VictimOrder};
use innerattn_env::sight::NEVER;
use innerattn_env::world::World;
use proptest::prelude::*;

use crate::common::{
    Table, chance, coming_and_going, fault, mixed_team, options, random_drive, some_obstacles, with_arrivals,
    with_layers, with_leaving, with_sight, with_times,
};

const ENVS: usize = 3;
const STEPS: usize = 70;

fn changed(more: usize) -> Scenario {
    let plain = Scenario { engine: Engine::Discs, spawn_clearance_m: 0.1, ..Scenario::default() };
    with_sight(match more {
        0 => plain,
        1 => Scenario { faults: coming_and_going(&plain.robots), ..plain },
        2 => with_leaving(Scenario { obstacles: some_obstacles(), ..plain }),
        3 => with_layers(Scenario { robots: mixed_team(7), ..plain }),
        4 => with_arrivals(plain),
        _ => with_times(Scenario { situation: Situation::Double, ..plain }),
    })
}

/// What a world was like in a step.
struct Past {
    world: World,
    absent: u64,
    /// The numbers of the victims that each robot saw itself.
    saw: Vec<Vec<u32>>,
}

fn past(world: &World, rules: &Rules) -> Past {
    let (robots, slots) = (world.positions.len(), world.victims.len());
    let saw = |own: usize| {
        let row = &world.sightings[own * (robots + slots) + robots..][..slots];
        let seen = world.victims.iter().zip(row).filter(|(_, last)| **last == world.step);
        seen.filter_map(|(victim, _)| victim.map(|victim| victim.id)).collect()
    };
    Past { world: world.clone(), absent: world.absent(rules), saw: (0..robots).map(saw).collect() }
}

/// The time since, as a share.
fn share(last: Option<&u32>, step: u32, dt: f64) -> f32 {
    last.map_or(1.0, |last| {
        let time = f64::from(step - last) * dt;
        (time / (time + 1.0)) as f32
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// By plain memory of all that was: who hears whom, and whose victims each robot knows since when.
    #[test]
    fn robots_hear_those_in_range_and_know_what_they_saw(
        seed in 0..10_000_u64,
        more in 0..6_usize,
        range in 0..3_usize,
        delay in 0..4_u32,
        lossy in any::<bool>(),
        by_slot in any::<bool>(),
    ) {
        let range_m = [Some(0.5), Some(1.1), None][range];
        let loss = if lossy { 0.3 } else { 0.0 };
        let told = Communication { range_m, delay_steps: delay, loss, share: Share::Victims };
        let victim_order = if by_slot { VictimOrder::Slot } else { VictimOrder::Relevant };
        let scenario = Scenario { communication: Some(told), victim_order, ..changed(more) };
        let (robots, dt) = (scenario.robots.len(), scenario.dt_s);
        let mut table = Table::new(scenario, options(ENVS, seed));
        let names = table.batch.rules().layout.names();
        let columns = |end: &str| -> Vec<usize> {
            (0..names.len()).filter(|at| names[*at].ends_with(end)).collect()
        };
        let heard_at: Vec<usize> = columns(".heard");
        prop_assert_eq!(heard_at.len(), if told.limits() { robots - 1 } else { 0 });
        let named = |end: &str| -> Vec<usize> {
            columns(end).into_iter().filter(|at| names[*at].starts_with("victim_")).collect()
        };
        let present = named(".present");
        let [x, y] = ["x", "y"].map(|axis| named(&format!(".relative_position.{axis}")));
        let since = named(".since_seen");
        // By world: the steps of the episode so far, and what robots know of victims, by their numbers.
        let mut all: Vec<Vec<Past>> = (0..ENVS).map(|_| vec![]).collect();
        let mut known: Vec<HashMap<(usize, u32), u32>> = vec![HashMap::new(); ENVS];
        let (mut source, mut heard_some, mut news_some) = (chance(seed), 0, 0);
        let mut frozen = vec![vec![false; robots]; ENVS];
        for step in 0..STEPS {
            if step > 0 {
                let drives: Vec<_> = (0..ENVS * robots).map(|_| random_drive(&mut source)).collect();
                table.step(&drives);
            }
            for (env, world) in table.batch.worlds().enumerate() {
                let rules = table.batch.rules();
                if world.step == 0 {
                    all[env].clear();
                    known[env].clear();
                    frozen[env].fill(false);
                }
                let steps = &mut all[env];
                steps.push(past(world, rules));
                let now = steps.last().expect("just now");
                let sent = steps.len().checked_sub(1 + delay as usize).map(|at| &steps[at]);
                let heard = world.heard(rules);
                for own in 0..robots {
                    let is = |kind| world.faults.is_struck(kind, own);
                    let freezes = world.faults.levels(own)[Kind::FrozenSensor as usize] > 0.0;
                    let held = is(Kind::FrozenSensor) && frozen[env][own];
                    let blind = is(Kind::Blackout) && !freezes;
                    let open = now.absent >> own & 1 == 0 && !blind && !is(Kind::LostCommunication);
                    let mut news = vec![];
                    for other in 0..robots {
                        let hears = heard[own] >> other & 1 == 1;
                        let reach = |slack: f64| sent.is_some_and(|sent| {
                            let [from, to] = [other, own].map(|one| {
                                let at: [f32; 2] = sent.world.positions[one].into();
                                at.map(f64::from)
                            });
                            let distance = (to[0] - from[0]).hypot(to[1] - from[1]);
                            let there = sent.absent & (1 << own | 1 << other) == 0;
                            there && own != other && range_m.is_none_or(|most| distance <= most + slack)
                        });
                        prop_assert!(!hears || open && reach(1e-5), "{own} hears {other}");
                        prop_assert!(hears || lossy || !open || !reach(-1e-5), "{own} does not hear {other}");
                        if hears {
                            heard_some += 1;
                            let sent = sent.expect("it was reached");
                            news.extend(sent.saw[other].iter().copied());
                        }
                    }
                    let ids: Vec<u32> = world.victims.iter().flatten().map(|victim| victim.id).collect();
                    let told_at = world.step.wrapping_sub(delay);
                    if !held {
                        for id in news.iter().filter(|id| ids.contains(id)) {
                            let last = known[env].entry((own, *id)).or_insert(told_at);
                            *last = told_at.max(*last);
                        }
                        for id in &now.saw[own] {
                            known[env].insert((own, *id), world.step);
                        }
                    }
                    let is_kept = world.faults.frozen_row(own).is_some();
                    frozen[env][own] = freezes && (frozen[env][own] || is_kept);
                    let row = &table.obs[(env * robots + own) * names.len()..][..names.len()];
                    if freezes || is(Kind::Blackout) || now.absent >> own & 1 == 1 {
                        continue;
                    }
                    let others = (0..robots).filter(|other| *other != own);
                    for (at, other) in heard_at.iter().zip(others) {
                        prop_assert_eq!(row[*at], f32::from(u8::from(heard[own] >> other & 1 == 1)));
                    }
                    // The victims that it shows, and the times of the others.
                    let shows = |id: &u32| now.saw[own].contains(id) || news.contains(id);
                    let time = |id: u32| share(known[env].get(&(own, id)), world.step, dt);
                    let mut found = vec![];
                    let mut hidden = vec![];
                    for victim in &world.victims {
                        match victim.filter(|victim| shows(&victim.id)) {
                            Some(victim) => found.push((victim.position, time(victim.id))),
                            None => hidden.push(victim.map_or(1.0, |victim| time(victim.id))),
                        }
                    }
                    news_some += found.len();
                    let own_place = world.positions[own];
                    let noisy = more == 1;
                    hidden.sort_by(f32::total_cmp);
                    let mut later = hidden.iter();
                    for slot in 0..present.len() {
                        let at = [row[x[slot]], row[y[slot]]];
                        let last = row[since[slot]];
                        if by_slot {
                            let victim = world.victims[slot];
                            let shown = victim.filter(|victim| shows(&victim.id));
                            prop_assert_eq!(row[present[slot]], f32::from(u8::from(shown.is_some())));
                            let wanted = victim.map_or(1.0, |victim| time(victim.id));
                            prop_assert!((last - wanted).abs() < 1e-5, "{last} {wanted}");
                        } else if slot < found.len() {
                            prop_assert_eq!(row[present[slot]], 1.0);
                            let fits = |(place, time): &(innerattn_env::geometry::Vec2, f32)| {
                                let way = place - own_place;
                                let near = (way.x - at[0]).abs() < 1e-5 && (way.y - at[1]).abs() < 1e-5;
                                (near || noisy) && (time - last).abs() < 1e-5
                            };
                            prop_assert!(found.iter().any(fits), "{found:?} {at:?} {last}");
                        } else {
                            prop_assert_eq!((row[present[slot]], at), (0.0, [0.0; 2]));
                            let wanted = *later.next().expect("as many as slots");
                            prop_assert!((last - wanted).abs() < 1e-5, "{last} {wanted}");
                        }
                    }
                }
            }
        }
        prop_assert!(heard_some > 0 && news_some > 0);
    }

    /// Twins that differ in their radio alone move alike. Without losses hearing is mutual; a larger range and a
    /// smaller loss add to it; a delay shifts it.
    #[test]
    fn hearing_is_mutual_and_grows_with_range_and_a_delay_shifts_it(
        seed in 0..10_000_u64,
        delay in 1..21_u32,
        range in 0.2..1.5_f64,
        loss in 0.05..0.6_f64,
    ) {
        let radio = |range_m, delay_steps, loss| {
            let found = Communication { range_m: Some(range_m), delay_steps, loss, share: Share::Nothing };
            Scenario { communication: Some(found), engine: Engine::Discs, ..Scenario::default() }
        };
        let scenarios = [
            radio(range, 0, 0.0),
            radio(1.5 * range, 0, 0.0),
            radio(range, delay, 0.0),
            radio(range, 0, loss),
            radio(range, 0, 0.5 * loss),
            radio(range, delay, loss),
        ];
        let mut tables = scenarios.map(|scenario| Table::new(scenario, options(1, seed)));
        let mut plain = Table::new(
            Scenario { engine: Engine::Discs, ..Scenario::default() }, options(1, seed),
        );
        let mut source = chance(seed);
        let mut before: Vec<[Vec<u64>; 6]> = vec![];
        for step in 0..60 {
            if step > 0 {
                let drives: Vec<_> = (0..4).map(|_| random_drive(&mut source)).collect();
                for table in &mut tables {
                    table.step(&drives);
                }
                plain.step(&drives);
            }
            let worlds = tables.each_ref().map(|table| table.batch.worlds().next().expect("one"));
            let world = plain.batch.worlds().next().expect("one");
            prop_assert!(worlds.iter().all(|other| other.positions == world.positions));
            prop_assert!(worlds.iter().all(|other| other.victims == world.victims));
            prop_assert!((0..4).all(|own| world.heard(plain.batch.rules())[own] == 0b1111 & !(1 << own)));
            if world.step == 0 {
                before.clear();
            }
            let heard = tables.each_ref().map(|table| {
                let world = table.batch.worlds().next().expect("one");
                world.heard(table.batch.rules())
            });
            for own in 0..4 {
                for other in 0..4 {
                    prop_assert_eq!(heard[0][own] >> other & 1, heard[0][other] >> own & 1);
                }
                prop_assert_eq!(heard[0][own] & !heard[1][own], 0, "a larger range");
                prop_assert_eq!(heard[3][own] & !heard[4][own], 0, "a smaller loss");
                prop_assert_eq!(heard[4][own] & !heard[0][own], 0, "no loss");
            }
            before.push(heard.clone());
            for (now, late) in [(0, 2), (3, 5)] {
                let wanted = before.len().checked_sub(1 + delay as usize);
                let wanted = wanted.map_or(vec![0; 4], |at| before[at][now].clone());
                prop_assert_eq!(&heard[late], &wanted);
            }
        }
    }
}

#[test]
fn a_loss_takes_its_share_and_each_message_by_itself() {
    let lossy = Communication { loss: 0.3, ..Communication::default() };
    let scenario = Scenario { communication: Some(lossy), engine: Engine::None, ..Scenario::default() };
    let mut table = Table::new(scenario, options(50, 3));
    let (mut heard, mut both, mut pairs) = (0_u32, 0_u32, 0_u32);
    for _ in 0..100 {
        table.step(&[[0.0; 2]; 200]);
        for world in table.batch.worlds() {
            let links = world.heard(table.batch.rules());
            heard += links.iter().map(|links| links.count_ones()).sum::<u32>();
            both += (links[0] >> 1 & links[1] & 1) as u32;
            pairs += 1;
        }
    }
    let share = f64::from(heard) / f64::from(12 * pairs);
    assert!((share - 0.7).abs() < 0.01, "{share}"); // 60,000 draws: five standard errors
    let share = f64::from(both) / f64::from(pairs);
    assert!((share - 0.49).abs() < 0.04, "{share}"); // 5,000 draws
}

#[test]
fn what_is_told_of_a_victim_that_has_gone_is_void() {
    let told = Communication { delay_steps: 2, share: Share::Victims, ..Communication::default() };
    let mut scenario = Scenario {
        communication: Some(told),
        situation: Situation::Single,
        engine: Engine::None,
        victim_order: VictimOrder::Slot,
        ..Scenario::default()
    };
    scenario.tasks.truncate(1);
    scenario.robots[0].sight_m = Some(0.1);
    let slots = 5;
    let mut table = Table::new(scenario, options(1, 1));
    let stay = [[0.0; 2]; 4];
    let known = |table: &Table| {
        let world = table.batch.worlds().next().expect("one");
        world.last_seen(table.batch.rules())[..slots][slots - 1]
    };
    let set = |table: &mut Table, robots: [f32; 8], at: [f32; 2]| {
        table.batch.set_motion(&robots, &[0.0; 8]).expect("inside");
        table.batch.set_victims(&[true], &[0], &at).expect("inside");
    };
    let apart = [0.9, 0.9, -0.9, 0.9, -0.9, -0.9, 0.9, -0.9];
    set(&mut table, apart, [0.0, 0.0]);
    table.step(&stay); // others see it all the time
    assert_eq!(known(&table), NEVER);
    table.step(&stay);
    assert_eq!(known(&table), 0, "they told at once");
    table.step(&stay);
    assert_eq!(known(&table), 1);
    // Rescued by two that are there: the next one is another.
    let helped = [0.9, 0.9, 0.0, 0.0, -0.9, -0.9, 0.0, 0.0];
    set(&mut table, helped, [0.0, 0.0]);
    table.step(&stay);
    assert_eq!(table.rescues.len(), 1);
    let far = |table: &Table| {
        let world = table.batch.worlds().next().expect("one");
        (world.victims[0].expect("it is replaced").position - world.positions[0]).norm() > 0.1
    };
    assert!(far(&table), "it would see it itself");
    assert_eq!(known(&table), NEVER, "they told of another");
    table.batch.set_motion(&apart, &[0.0; 8]).expect("inside");
    assert!(far(&table));
    table.step(&stay);
    assert_eq!(known(&table), NEVER);
    table.step(&stay);
    assert_eq!(known(&table), 4, "the step at which it appeared");
}

#[test]
fn hearsay_is_not_passed_on() {
    let told = Communication { range_m: Some(0.6), share: Share::Victims, ..Communication::default() };
    let mut scenario = Scenario { communication: Some(told), engine: Engine::None, ..Scenario::default() };
    scenario.robots.iter_mut().for_each(|robot| robot.sight_m = Some(0.3));
    let mut table = Table::new(scenario, options(1, 1));
    // A chain: the first sees the victim, the second hears the first, the third hears the second alone.
    let places = [-0.9, 0.0, -0.4, 0.0, 0.1, 0.0, 0.9, 0.9];
    table.batch.set_victims(&[true; 2], &[0; 2], &[-0.9, 0.2, -0.9, -0.2]).expect("inside");
    table.batch.set_motion(&places, &[0.0; 8]).expect("inside");
    let world = table.batch.worlds().next().expect("one");
    let heard = world.heard(table.batch.rules());
    assert_eq!(heard, [0b0010, 0b0101, 0b0010, 0]);
    let last = world.last_seen(table.batch.rules());
    let knows: Vec<bool> = (0..4).map(|own| last[own * 6 + 4] == 0 && last[own * 6 + 5] == 0).collect();
    assert_eq!(knows, [true, true, false, false]);
    table.step(&[[0.0; 2]; 4]);
    let world = table.batch.worlds().next().expect("one");
    assert_eq!(world.last_seen(table.batch.rules())[2 * 6 + 4], NEVER, "nor in the next step");
}

#[test]
fn radios_out_of_range_and_sharing_what_all_see_are_refused() {
    type Change = fn(&mut Communication);
    let cases: [(Change, &str); 6] = [
        (|one| one.range_m = Some(0.001), "range_m = 0.001: must be in 0.005..=1000 m"),
        (|one| one.range_m = Some(f64::NAN), "range_m = NaN: must be in 0.005..=1000 m"),
        (|one| one.delay_steps = 21, "delay_steps = 21: must be in 0..=20"),
        (|one| one.loss = 1.0, "loss = 1: must be at least 0 and below 1"),
        (|one| one.loss = -0.1, "loss = -0.1: must be at least 0 and below 1"),
        (
            |one| one.share = Share::Victims,
            "share = \"victims\": must be \"nothing\" where no sight_m and no occlusion limits what robots see",
        ),
    ];
    for (change, wanted) in cases {
        let mut found = Communication::default();
        change(&mut found);
        let refused = Rules::new(Scenario { communication: Some(found), ..Scenario::default() });
        let refused = refused.err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(refused, format!("scenario.communication.{wanted}"));
    }
    let unlimited = Scenario { communication: Some(Communication::default()), ..Scenario::default() };
    assert!(Rules::new(unlimited).is_ok_and(|rules| rules.radio.is_none()));
}

#[test]
fn a_deaf_robot_hears_nobody_and_is_heard() {
    let mut scenario = Scenario { engine: Engine::None, ..Scenario::default() };
    scenario.communication = Some(Communication { range_m: Some(9.0), ..Communication::default() });
    scenario.faults = vec![fault("food_1", Kind::LostCommunication, 1.0)];
    for communication in [None, scenario.communication] {
        let scenario = Scenario { communication, ..scenario.clone() };
        let table = Table::new(scenario, options(1, 0));
        let world = table.batch.worlds().next().expect("one");
        assert_eq!(world.heard(table.batch.rules()), [0b1110, 0, 0b1011, 0b0111]);
    }
}
