//! Whether the helpers of a task can meet at a victim: bodies take room, and walls keep them off.
//!
//! Only what is certain is refused. Bodies count with the share of a radius by which contacts may let them
//! overlap, and obstacles do not count.

use crate::geometry::Vec2;
use crate::matching::{bits, fillable};
use crate::robot::Body;
use crate::tasks::Needs;

/// Deepest overlap of two robots in contact, as a share of a radius.
const MOST_OVERLAP: f32 = 0.15;

/// The least rescue radius with which enough able robots can be near a victim at the same time, m: if bodies
/// may not overlap, and what is left of it if they overlap as deep as contacts let them.
#[must_use]
pub fn least_rescue_radius(needs: &Needs, team: &[Body]) -> (f32, f32) {
    if let Some(sums) = needs.sums() {
        let mut radii: Vec<f32> = bits(sums.able()).map(|robot| team[robot].radius).collect();
        radii.sort_by(f32::total_cmp);
        radii.truncate(sums.fewest()); // no others need less room
        let least = radius_of(&radii);
        return (least, least * (1.0 - MOST_OVERLAP));
    }
    let most = needs.abilities().len();
    let candidates: Vec<Vec<usize>> = needs
        .abilities()
        .iter()
        .map(|need| {
            let mut able: Vec<usize> = (0..team.len()).filter(|robot| can(&team[*robot], *need)).collect();
            able.sort_by(|a, b| team[*a].radius.total_cmp(&team[*b].radius));
            able.truncate(most); // of more, the smallest ones suffice
            able
        })
        .collect();
    let least = least_of(&candidates, &mut Vec::with_capacity(most), team);
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

/// The least radius over all ways to give the needs from `chosen.len()` on a robot of its own.
fn least_of(candidates: &[Vec<usize>], chosen: &mut Vec<usize>, team: &[Body]) -> f32 {
    let Some(able) = candidates.get(chosen.len()) else {
        return radius_of(&chosen.iter().map(|robot| team[*robot].radius).collect::<Vec<f32>>());
    };
    let mut least = f32::INFINITY;
    for robot in able {
        if !chosen.contains(robot) {
            chosen.push(*robot);
            least = least.min(least_of(candidates, chosen, team));
            chosen.pop();
        }
    }
    least
}

/// A circle that holds the centres of discs that do not overlap has at least this radius, m: half the distance
/// of the two largest ones, and for up to six discs as if all were as small as the smallest two and on the rim.
fn radius_of(radii: &[f32]) -> f32 {
    let mut sorted = radii.to_vec();
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
            assert!((radius_of(&radii) - wanted).abs() < 1e-6, "{radii:?}");
        }
    }
}
