//! A snapshot is the whole state: a batch restored from it goes on bit for bit, and bytes that are not
//! exactly a snapshot of this batch are refused without a trace.

use innerattn_env::batch::{Autoreset, Options};
use innerattn_env::scenario::{Scenario, Situation};
use proptest::prelude::*;

use crate::common::{
    Table, chance, coming_and_going, mixed_team, options, random_drive, some_obstacles, with_amounts,
    with_an_end, with_areas, with_arrivals, with_batteries, with_layers, with_leaving, with_list, with_loads,
    with_order, with_radio, with_rays, with_sight, with_times, with_wheels,
};

const ENVS: usize = 6;

/// Narrow arenas with contacts in most steps.
fn scenarios() -> Vec<Scenario> {
    let tight = Scenario { arena_half_width_m: 0.5, spawn_clearance_m: 0.1, ..Scenario::default() };
    vec![
        tight.clone(),
        Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() },
        Scenario { situation: Situation::Double, obstacles: some_obstacles(), ..Scenario::default() },
        Scenario {
            robots: mixed_team(9),
            max_victims: 5,
            end_when_rescued: Some(3),
            contact_cost: 1.0,
            ..tight.clone()
        },
        with_amounts(tight.clone()),
        with_order(tight.clone()),
        with_areas(tight.clone()),
        with_arrivals(tight.clone()),
        with_list(tight.clone()),
        with_an_end(tight.clone()),
        with_leaving(tight.clone()),
        with_batteries(with_leaving(tight.clone())),
        with_batteries(tight.clone()),
        with_loads(with_leaving(tight.clone())),
        with_loads(with_batteries(tight.clone())),
        with_layers(tight.clone()),
        with_sight(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() }),
        with_sight(with_leaving(Scenario { obstacles: some_obstacles(), ..Scenario::default() })),
        with_radio(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() }),
        with_rays(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() }),
        with_radio(with_leaving(Scenario { obstacles: some_obstacles(), ..Scenario::default() })),
        with_wheels(with_leaving(tight.clone())),
        with_sight(with_wheels(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() })),
        with_times(tight),
    ]
}

fn walk(table: &mut Table, seed: u64, steps: usize) -> Vec<Vec<u32>> {
    let mut chance = chance(seed);
    let robots = ENVS * table.batch.rules().team.len();
    let drives = |_| {
        let actions: Vec<[f32; 2]> = (0..robots).map(|_| random_drive(&mut chance)).collect();
        table.step(&actions);
        table.shown(0, ENVS)
    };
    (0..steps).map(drives).collect()
}

#[test]
fn a_restored_batch_goes_on_bit_for_bit() {
    for scenario in scenarios() {
        let mut first = Table::new(scenario.clone(), options(ENVS, 1));
        walk(&mut first, 1, 37);
        let image = first.batch.snapshot();
        // Another seed, another history and more threads: nothing of it must be left.
        let other = Options { num_threads: Some(2), first_env: 50, ..options(ENVS, 99) };
        let mut second = Table::new(scenario, other);
        walk(&mut second, 2, 11);
        second.batch.restore(&image).expect("its own image");
        assert_eq!(second.batch.snapshot(), image);
        let goes_on = walk(&mut first, 3, 300);
        assert!(walk(&mut second, 3, 300) == goes_on);
        assert_eq!(first.batch.snapshot(), second.batch.snapshot());
        // The first can be put back as well.
        first.batch.restore(&image).expect("its own image");
        assert!(walk(&mut first, 3, 300) == goes_on);
    }
}

#[test]
fn an_ended_world_stays_ended() {
    let options = Options { autoreset: Autoreset::Disabled, ..options(ENVS, 1) };
    let scenario = Scenario { episode_steps: 5, ..Scenario::default() };
    let mut first = Table::new(scenario.clone(), options);
    walk(&mut first, 1, 5);
    let mut second = Table::new(scenario.clone(), options);
    second.batch.restore(&first.batch.snapshot()).expect("its own image");
    assert!(second.batch.worlds().all(|world| world.over));
    // A batch that begins episodes by itself could not go on from there.
    let mut other = Table::new(scenario, crate::common::options(ENVS, 1));
    assert_refused(&mut other, &first.batch.snapshot(), "an image of ended worlds");
}

/// A batch in mid-episode, and an image of it some steps before.
fn sample() -> (Table, Vec<u8>) {
    let mut table = Table::new(scenarios().remove(1), options(ENVS, 1));
    walk(&mut table, 1, 12);
    let image = table.batch.snapshot();
    walk(&mut table, 2, 3);
    (table, image)
}

fn assert_refused(table: &mut Table, image: &[u8], what: &str) {
    let before = table.batch.snapshot();
    let error = table.batch.restore(image).expect_err(what).to_string();
    assert!(error.starts_with("snapshot: ") && !error.contains('\n'), "{error}");
    assert!(table.batch.snapshot() == before, "{what} changed the batch");
}

#[test]
fn every_truncation_and_any_extension_is_refused() {
    let (mut table, image) = sample();
    for length in 0..image.len() {
        assert_refused(&mut table, &image[..length], "a truncated image");
    }
    for tail in [&[0_u8][..], &[0; 4], &image] {
        assert_refused(&mut table, &[&image, tail].concat(), "an extended image");
    }
}

#[test]
fn every_altered_byte_is_refused() {
    let (mut table, mut image) = sample();
    for at in 0..image.len() {
        for bit in [0, 3, 7] {
            image[at] ^= 1 << bit;
            assert_refused(&mut table, &image, "an altered image");
            image[at] ^= 1 << bit;
        }
    }
    table.batch.restore(&image).expect("the image itself");
}

#[test]
fn foreign_images_are_refused() {
    let (mut table, _) = sample();
    let scenario = table.batch.rules().scenario.clone();
    let fewer = Table::new(scenario.clone(), options(ENVS - 1, 1));
    assert_refused(&mut table, &fewer.batch.snapshot(), "an image of fewer worlds");
    let other = Table::new(Scenario { dt_s: 0.2, ..scenario }, options(ENVS, 1));
    assert_refused(&mut table, &other.batch.snapshot(), "an image of another scenario");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn bytes_that_are_no_image_are_refused(
        (bytes, keep) in (proptest::collection::vec(any::<u8>(), 0..600), 0..200_usize),
    ) {
        let (mut table, image) = sample();
        assert_refused(&mut table, &[&image[..keep], &bytes].concat(), "random bytes");
        assert_refused(&mut table, &[&bytes, &image[keep..]].concat(), "random bytes before an image");
    }

    #[test]
    fn several_altered_bytes_are_refused(
        edits in proptest::collection::vec((any::<proptest::sample::Index>(), 1..=255_u8), 1..20),
    ) {
        let (mut table, image) = sample();
        let mut altered = image.clone();
        for (at, mask) in edits {
            let at = at.index(altered.len());
            altered[at] ^= mask;
        }
        prop_assume!(altered != image);
        assert_refused(&mut table, &altered, "an altered image");
    }

    #[test]
    fn any_history_continues(which in 0..scenarios().len(), seed: u64, before in 0..60_usize, after in 1..40_usize) {
        let mut first = Table::new(scenarios().swap_remove(which), options(ENVS, seed));
        let mut second = Table::new(scenarios().swap_remove(which), options(ENVS, seed ^ 1));
        walk(&mut first, seed, before);
        second.batch.restore(&first.batch.snapshot()).expect("its own image");
        prop_assert!(walk(&mut first, seed ^ 2, after) == walk(&mut second, seed ^ 2, after));
    }
}
