//! The rescue rule against its plain reading: of all ways to give each need a robot of its own, the
//! one whose first need has the nearest robot (ties by index), then its second, and so on.

use proptest::prelude::*;

use super::Needs;
use crate::geometry::Vec2;
use crate::robot::{Body, bodies};
use crate::scenario::{Abilities, Robot, Scenario, Task};

const ABILITIES: [&str; 3] = ["a", "b", "c"];

/// A team with these abilities (bits), and the needs of a task; every task can be served by someone.
fn team_and_needs(abilities: &[u32], needs: &[usize]) -> (Vec<Body>, Needs) {
    let names = |bits: u32| {
        (0..3).filter(|bit| bits >> bit & 1 == 1).map(|bit| ABILITIES[bit].to_string()).collect::<Vec<_>>()
    };
    let like = Scenario::default().robots.remove(0);
    let mut robots: Vec<Robot> =
        abilities.iter().map(|bits| Robot { abilities: names(*bits).into(), ..like.clone() }).collect();
    // So that every ability has a number even if nobody near has it.
    robots.push(Robot { abilities: names(7).into(), ..like });
    let needs: Vec<String> = needs.iter().map(|need| ABILITIES[*need].to_string()).collect();
    let scenario = Scenario { robots, tasks: vec![Task::new("task", needs)], ..Scenario::default() };
    let mut team = bodies(&scenario);
    team.pop();
    (team, Needs::of_tasks(&scenario).remove(0))
}

/// All ways to fill `needs` in order from robots in reach that are not taken, best first.
fn best(
    needs: &[usize],
    abilities: &[u32],
    distances: &[f32],
    radius: f32,
    taken: &mut Vec<usize>,
) -> Option<Vec<usize>> {
    let Some((need, later)) = needs.split_first() else { return Some(vec![]) };
    let mut nearest: Vec<usize> = (0..abilities.len()).collect();
    nearest.sort_by(|a, b| distances[*a].total_cmp(&distances[*b]).then(a.cmp(b)));
    for robot in nearest {
        let fits = abilities[robot] >> need & 1 == 1 && distances[robot] <= radius * radius;
        if !fits || taken.contains(&robot) {
            continue;
        }
        taken.push(robot);
        let rest = best(later, abilities, distances, radius, taken);
        taken.pop();
        if let Some(rest) = rest {
            return Some([vec![robot], rest].concat());
        }
    }
    None
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn helpers_are_the_best_of_all_assignments(
        robots in proptest::collection::vec((0..8_u32, -2..=2_i8, -2..=2_i8), 1..8),
        needs in proptest::collection::vec(0..3_usize, 1..5),
        reach in 1..=5_u8,
        busy in any::<u64>(),
        someone_is_busy: bool,
    ) {
        // Places on a coarse grid make ties of distance common.
        let place = |&(_, x, y): &(u32, i8, i8)| Vec2::new(f32::from(x), f32::from(y)) * 0.25;
        let positions: Vec<Vec2> = robots.iter().map(place).collect();
        let abilities: Vec<u32> = robots.iter().map(|robot| robot.0).collect();
        let (busy, radius) = (if someone_is_busy { busy } else { 0 }, f32::from(reach) * 0.125);
        let (team, rule) = team_and_needs(&abilities, &needs);
        let found = rule.helpers(Vec2::zeros(), &team, &positions, radius, busy);

        let free: Vec<u32> =
            abilities.iter().enumerate().map(|(robot, bits)| if busy >> robot & 1 == 1 { 0 } else { *bits }).collect();
        let distances: Vec<f32> = positions.iter().map(Vec2::norm_squared).collect();
        let expected = best(&needs, &free, &distances, radius, &mut vec![]);
        let found = found.map(|helpers| helpers.iter().flatten().map(|robot| usize::from(*robot)).collect::<Vec<_>>());
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn distance_counts_the_nearest_able_robots(
        robots in proptest::collection::vec((1..8_u32, -1.0..1.0_f32, -1.0..1.0_f32), 4..9),
        needs in proptest::collection::vec(0..3_usize, 1..5),
    ) {
        let positions: Vec<Vec2> = robots.iter().map(|(_, x, y)| Vec2::new(*x, *y)).collect();
        let abilities: Vec<u32> = robots.iter().map(|robot| robot.0).collect();
        // A task that the team cannot serve is refused before: leave out what is too much.
        let able = |need: usize| abilities.iter().filter(|bits| **bits >> need & 1 == 1).count();
        let mut kept: Vec<usize> = vec![];
        for need in needs {
            if kept.iter().filter(|other| **other == need).count() < able(need) {
                kept.push(need);
            }
        }
        let needs = kept;
        prop_assume!(!needs.is_empty());
        let (team, rule) = team_and_needs(&abilities, &needs);
        let mut expected = 0.0;
        for ability in 0..3 {
            let mut distances: Vec<f32> =
                (0..robots.len()).filter(|robot| abilities[*robot] >> ability & 1 == 1).map(|robot| positions[robot].norm()).collect();
            distances.sort_by(f32::total_cmp);
            expected += distances.iter().take(needs.iter().filter(|need| **need == ability).count()).sum::<f32>();
        }
        let found = rule.distance(Vec2::zeros(), &team, &positions, 0);
        prop_assert!((found - expected).abs() < 1e-5, "{} for {}", found, expected);
    }

    /// Sums against a plain reading: of all rows of the nearest the shortest that reaches them, without those
    /// that the others can do without, the farthest first. Amounts are quarters, so that nothing is rounded.
    #[test]
    fn helpers_of_sums_are_the_nearest_that_are_needed(
        robots in proptest::collection::vec(((0..6_u32, 0..6_u32), -2..=2_i8, -2..=2_i8), 1..9),
        needs in (1..12_u32, 0..12_u32),
        reach in 1..=5_u8,
        (busy, someone_is_busy) in (any::<u64>(), any::<bool>()),
    ) {
        let place = |&(_, x, y): &((u32, u32), i8, i8)| Vec2::new(f32::from(x), f32::from(y)) * 0.25;
        let positions: Vec<Vec2> = robots.iter().map(place).collect();
        let quarters: Vec<[u32; 2]> = robots.iter().map(|robot| [robot.0.0, robot.0.1]).collect();
        let needs = [needs.0, needs.1];
        let (busy, radius) = (if someone_is_busy { busy } else { 0 }, f32::from(reach) * 0.125);
        let rule = sums_of(&quarters, needs);
        let found = rule.helpers(Vec2::zeros(), &[], &positions, radius, busy);
        let found = found.map(|helpers| helpers.iter().flatten().map(|robot| usize::from(*robot)).collect::<Vec<_>>());

        let reached = |row: &[usize]| (0..2).all(|need| row.iter().map(|robot| quarters[*robot][need]).sum::<u32>() >= needs[need]);
        let far = |robot: usize| positions[robot].norm_squared();
        let mut near: Vec<usize> =
            (0..robots.len()).filter(|robot| busy >> robot & 1 == 0 && far(*robot) <= radius * radius).collect();
        near.sort_by(|a, b| far(*a).total_cmp(&far(*b)).then(a.cmp(b)));
        let expected = (0..=near.len()).find(|count| reached(&near[..*count])).map(|count| {
            let mut row = near[..count].to_vec();
            for robot in near[..count].iter().rev() {
                let rest: Vec<usize> = row.iter().copied().filter(|other| other != robot).collect();
                if reached(&rest) {
                    row = rest;
                }
            }
            row
        });
        prop_assert_eq!(&found, &expected);
        for left_out in found.iter().flatten() {
            let rest: Vec<usize> = found.iter().flatten().copied().filter(|robot| robot != left_out).collect();
            prop_assert!(!reached(&rest), "{} is not needed", left_out);
        }

        // The dense reward counts the nearest that reach each sum, or all that there are.
        let mut wanted = 0.0;
        for need in 0..2 {
            let mut given: Vec<usize> = (0..robots.len()).filter(|robot| busy >> robot & 1 == 0 && quarters[*robot][need] > 0).collect();
            given.sort_by(|a, b| far(*a).total_cmp(&far(*b)).then(a.cmp(b)));
            let sum = |count: usize| given[..count].iter().map(|robot| quarters[*robot][need]).sum::<u32>();
            let count = (0..=given.len()).find(|count| sum(*count) >= needs[need]).unwrap_or(given.len());
            wanted += given[..count].iter().map(|robot| positions[*robot].norm()).sum::<f32>();
        }
        let found = rule.distance(Vec2::zeros(), &[], &positions, busy);
        prop_assert!((found - wanted).abs() < 1e-4, "{} for {}", found, wanted);
    }
}

/// Needs as sums, and what robots give, in quarters; 0 is left out.
fn sums_of(quarters: &[[u32; 2]], needs: [u32; 2]) -> Needs {
    let table = |quarters: [u32; 2]| {
        let some = (0..2).filter(|need| quarters[*need] > 0);
        Abilities::Amounts(
            some.map(|need| (ABILITIES[need].into(), f64::from(quarters[need]) / 4.0)).collect(),
        )
    };
    let like = Scenario::default().robots.remove(0);
    let robots = quarters.iter().map(|given| Robot { abilities: table(*given), ..like.clone() }).collect();
    let scenario = Scenario { robots, tasks: vec![Task::new("task", table(needs))], ..Scenario::default() };
    Needs::of_tasks(&scenario).remove(0)
}

#[test]
fn sums_bear_rounding() {
    let amounts = |amount: f64| [("water", amount)];
    let like = Scenario::default().robots.remove(0);
    let robots = [0.7, 0.2, 0.1].map(|amount| Robot { abilities: amounts(amount).into(), ..like.clone() });
    for (needed, met) in [(1.0, true), (1.0 + 1e-6, false)] {
        let tasks = vec![Task::new("task", amounts(needed))];
        let scenario = Scenario { robots: robots.to_vec(), tasks, ..Scenario::default() };
        let rule = Needs::of_tasks(&scenario).remove(0);
        let at = [Vec2::zeros(); 3];
        assert_eq!(rule.helpers(Vec2::zeros(), &[], &at, 0.1, 0).is_some(), met, "{needed}");
    }
}
