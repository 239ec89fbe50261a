//! Whether the helpers of a task can meet at a victim: bodies take room, and walls keep them off.
//!
//! Only what is certain is refused. Bodies count with the share of a radius by which contacts may let them
//! overlap, and obstacles do not count.

use std::collections::{HashMap, HashSet};

use crate::geometry::Vec2;
use crate::matching::{bits, fillable};
use crate::robot::Body;
use crate::tasks::Needs;

/// Deepest overlap of two robots in contact, as a share of a radius.
const MOST_OVERLAP: f32 = 0.15;

/// The least rescue radius with which enough able robots can be near a victim at the same time, m: if bodies of
/// one layer may not overlap, and what is left of it if they overlap as deep as contacts let them.
#[must_use]
pub fn least_rescue_radius(needs: &Needs, team: &[Body]) -> (f32, f32) {
    let smallest_first = |able: &mut Vec<usize>| {
        able.sort_by(|a, b| team[*a].radius.total_cmp(&team[*b].radius));
    };
    let least = if let Some(sums) = needs.sums() {
        let mut able: Vec<usize> = bits(sums.able()).collect();
        smallest_first(&mut able);
        // What one more robot needs, of each layer in turn: it grows with their number.
        let with = |last: usize| {
            let same = able[..=last].iter().map(|robot| &team[*robot]);
            radius_of(same.filter(|body| body.layer == team[able[last]].layer).map(|body| body.radius))
        };
        let mut radii: Vec<f32> = (0..able.len()).map(with).collect();
        radii.sort_by(f32::total_cmp);
        radii[sums.fewest().max(1) - 1]
    } else {
        let most = needs.abilities().len();
        let able = |need: &u32| {
            let mut able: Vec<usize> = (0..team.len()).filter(|robot| can(&team[*robot], *need)).collect();
            smallest_first(&mut able);
            let mut counts = HashMap::new();
            able.retain(|robot| {
                let count = counts.entry(team[*robot].layer).or_insert(0);
                *count += 1;
                *count <= most // of more in a layer, the smallest ones suffice
            });
            able
        };
        let candidates: Vec<Vec<usize>> = needs.abilities().iter().map(able).collect();
        least_of(&candidates, 0, &mut HashSet::new(), team)
    };
    (least, least * (1.0 - MOST_OVERLAP))
}

/// Whether enough able robots can be within `radius` of a place that far from the walls of an arena of half
/// width `arena`.
#[must_use]
pub fn can_reach(needs: &Needs, team: &[Body], at: Vec2, radius: f32, arena: f32) -> bool {
    let near = |body: &Body| {
        let beyond = at.map(|value| (value.abs() - (arena - body.radius)).max(0.0));
        beyond.norm() <= radius
    };
    if let Some(sums) = needs.sums() {
        let near = bits(sums.able()).filter(|robot| near(&team[*robot]));
        return sums.short_of(near.fold(0, |mask, robot| mask | 1 << robot)).is_none();
    }
    let able = |need: &u32| {
        let fits = |(_, body): &(usize, &Body)| can(body, *need) && near(body);
        team.iter().enumerate().filter(fits).fold(0_u64, |mask, (robot, _)| mask | 1 << robot)
    };
    fillable(&needs.abilities().iter().map(able).collect::<Vec<u64>>())
}

fn can(body: &Body, need: u32) -> bool {
    body.abilities >> need & 1 == 1
}

/// The least radius over all ways to give the remaining needs on robots of their own that are not `chosen` (as
/// bits), which have the others. Sets that were `seen` before are passed over.
fn least_of(candidates: &[Vec<usize>], chosen: u64, seen: &mut HashSet<u64>, team: &[Body]) -> f32 {
    if !seen.insert(chosen) {
        return f32::INFINITY;
    }
    let Some(able) = candidates.get(chosen.count_ones() as usize) else {
        let layers = bits(chosen).map(|robot| team[robot].layer);
        let in_layer = |layer| bits(chosen).filter(move |robot| team[*robot].layer == layer);
        let radii = layers.map(|layer| radius_of(in_layer(layer).map(|robot| team[robot].radius)));
        return radii.fold(0.0, f32::max);
    };
    let free = able.iter().filter(|robot| chosen >> **robot & 1 == 0);
    free.map(|robot| least_of(candidates, chosen | 1 << robot, seen, team)).fold(f32::INFINITY, f32::min)
}

/// A circle that holds the centres of discs that do not overlap has at least this radius, m: half the distance
/// of the two largest ones, and for up to six discs as if all were as small as the smallest two and on the rim.
fn radius_of(radii: impl Iterator<Item = f32>) -> f32 {
    let mut sorted: Vec<f32> = radii.collect();
    sorted.sort_by(f32::total_cmp);
    let [smallest, next, ..] = sorted[..] else { return 0.0 };
    let count = sorted.len();
    let pair = f32::midpoint(sorted[count - 1], sorted[count - 2]);
    let rim = 2.0 * (std::f32::consts::PI / count.min(6) as f32).sin();
    pair.max((smallest + next) / rim)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::robot::bodies;
    use crate::scenario::{Robot, Scenario};

    #[test]
    fn circles_around_discs_are_as_small_as_geometry_allows() {
        for (radii, wanted) in [
            (vec![0.3], 0.0),
            (vec![0.3, 0.3], 0.3),
            (vec![0.1, 0.5], 0.3),
            (vec![0.1, 0.1, 0.1], 0.2 / 3.0_f32.sqrt()),
            (vec![0.1; 4], 0.2 / 2.0_f32.sqrt()),
            (vec![0.1; 7], 0.2),
            (vec![0.1; 8], 0.2),
            (vec![0.01, 0.01, 0.5, 0.7], 0.6),
        ] {
            assert!((radius_of(radii.iter().copied()) - wanted).abs() < 1e-6, "{radii:?}");
        }
    }

    /// Whether robots (as bits) fill the needs of the first task one by one, or reach its sums together.
    fn suffice(chosen: u64, scenario: &Scenario) -> bool {
        let needs = &scenario.tasks[0].needs;
        let team: Vec<&Robot> = bits(chosen).map(|robot| &scenario.robots[robot]).collect();
        let given = |need: &str| team.iter().map(|robot| robot.abilities.amount(need)).sum::<f64>();
        if let Some(amounts) = needs.amounts() {
            return amounts.iter().all(|(need, amount)| given(need) > amount - 1e-9);
        }
        in_some_order(&needs.names().collect::<Vec<&str>>(), &team)
    }

    /// The least radius over all sets of robots that suffice and can spare nobody.
    fn plain(scenario: &Scenario) -> f32 {
        let sets = 0..1_u64 << scenario.robots.len();
        let spares = |chosen: &u64| bits(*chosen).any(|robot| suffice(chosen & !(1 << robot), scenario));
        let helpers = sets.filter(|chosen| suffice(*chosen, scenario) && !spares(chosen));
        let radius = |chosen: u64| {
            let of = |layer: &str| {
                let team = bits(chosen).map(|robot| &scenario.robots[robot]);
                radius_of(team.filter(|robot| robot.layer == layer).map(|robot| robot.radius_m as f32))
            };
            scenario.layers().into_iter().map(of).fold(0.0, f32::max)
        };
        helpers.map(radius).fold(f32::INFINITY, f32::min)
    }

    fn in_some_order(needs: &[&str], team: &[&Robot]) -> bool {
        let [need, others @ ..] = needs else { return true };
        (0..team.len()).any(|robot| {
            let mut rest = team.to_vec();
            rest.remove(robot).abilities.amount(need) > 0.0 && in_some_order(others, &rest)
        })
    }

    #[test]
    fn the_least_radius_is_that_of_the_best_helpers_in_whatever_layers() {
        let mut chance = Stream::new(3, 0, 0, Purpose::Start);
        let (mut apart, mut found) = (0, 0);
        for case in 0..400 {
            let mut scenario = Scenario::default();
            let like = scenario.robots[0].clone();
            let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
            scenario.robots = (0..2 + chance.below(6))
                .map(|index| Robot {
                    name: format!("robot_{index}"),
                    abilities: names([&["food", "medicine"], &["food"][..], &["medicine"]][chance.below(3)])
                        .into(),
                    radius_m: f64::from(chance.between(0.02, 0.3)),
                    layer: ["ground", "air", "water"][chance.below(1 + case % 3)].into(),
                    ..like.clone()
                })
                .collect();
            scenario.tasks.truncate(1);
            let (food, medicine) = (chance.below(4), chance.below(3));
            scenario.tasks[0].needs = if case % 2 == 0 {
                names(&[&["food"; 3][..food], &["medicine"; 3][..medicine]].concat()).into()
            } else {
                [("food", 1.0 + food as f64)].into()
            };
            if scenario.validate().is_err() {
                continue;
            }
            let needs = &Needs::of_tasks(&scenario)[0];
            let team = bodies(&scenario);
            let least = least_rescue_radius(needs, &team).0;
            assert!((least - plain(&scenario)).abs() < 1e-6, "{least}: {scenario:?}");
            found += 1;
            let one_layer: Vec<Body> = team.iter().map(|body| Body { layer: 1, ..*body }).collect();
            apart += i32::from(least < least_rescue_radius(needs, &one_layer).0);
        }
        assert!(found > 100 && apart > 30, "{found} {apart}");
    }
}
