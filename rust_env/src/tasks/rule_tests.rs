//! The rescue rule against its plain reading: of all ways to give each need a robot of its own, the
//! one whose first need has the nearest robot (ties by index), then its second, and so on.

use proptest::prelude::*;

use super::Needs;
use crate::geometry::Vec2;
use crate::robot::{Body, bodies};
use crate::scenario::{Robot, Scenario, Task};

const ABILITIES: [&str; 3] = ["a", "b", "c"];

/// A team with these abilities (bits), and the needs of a task; every task can be served by someone.
fn team_and_needs(abilities: &[u32], needs: &[usize]) -> (Vec<Body>, Needs) {
    let names =
        |bits: u32| (0..3).filter(|bit| bits >> bit & 1 == 1).map(|bit| ABILITIES[bit].to_string()).collect();
    let like = Scenario::default().robots.remove(0);
    let mut robots: Vec<Robot> =
        abilities.iter().map(|bits| Robot { abilities: names(*bits), ..like.clone() }).collect();
    // So that every ability has a number even if nobody near has it.
    robots.push(Robot { abilities: names(7), ..like });
    let needs = needs.iter().map(|need| ABILITIES[*need].to_string()).collect();
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
}
