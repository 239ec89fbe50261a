//! Ways by corners against ways by cells: two ways to look for the same.

use innerattn_env::blocks::Blocks;
use innerattn_env::corners::{CornerWays, Corners, MOST_CORNERS};
use innerattn_env::distance_field::DistanceField;
use innerattn_env::free_space::FreeSpace;
use innerattn_env::geometry::{Solid, Vec2};
use innerattn_env::rng::Stream;
use innerattn_env::scenario::Map;

use crate::common::chance;

fn place(source: &mut Stream) -> Vec2 {
    Vec2::new(source.between(-0.95, 0.95), source.between(-0.95, 0.95))
}

/// A map of some thin walls with gaps, and a few solids anywhere.
fn space(source: &mut Stream, radius: f32) -> FreeSpace {
    let mut cells = vec![vec!['.'; 24]; 24];
    for wall in [6, 12, 18] {
        for along in 0..24 {
            if source.between(0.0, 1.0) < 0.8 {
                let (row, column) = if wall == 12 { (wall, along) } else { (along, wall) };
                cells[row][column] = '#';
            }
        }
    }
    let map = Map { rows: cells.iter().map(|row| row.iter().collect()).collect(), layers: None };
    let solids = [Solid::Disc(0.1), Solid::Box(Vec2::new(0.15, 0.05))];
    let placed: Vec<_> = solids.iter().map(|solid| (solid, place(source))).collect();
    FreeSpace::new(1.0, radius, &placed, Some(&Blocks::new(&map, 1.0, 1)))
}

#[test]
fn corners_and_cells_find_ways_that_are_about_as_long() {
    let mut source = chance(41);
    let (mut reached, mut closed, mut missed) = (0, 0, 0);
    for case in 0..150 {
        let space = space(&mut source, [0.02, 0.03, 0.05][case % 3]);
        let corners = Corners::new(&space).expect("not too many corners");
        let goal = place(&mut source);
        let by_corners = CornerWays::new(&space, &corners, goal, 0.0);
        let mut by_cells = DistanceField::new(goal, 0.0);
        for _ in 0..30 {
            let from = place(&mut source);
            if !space.is_free(space.cell(from))
                || !space.is_free(space.cell(goal))
                || space.is_clear(from, goal, 0.0)
            {
                continue;
            }
            match (by_corners.way(&space, &corners, from), by_cells.way(&space, from)) {
                (Some(one), Some(other)) => {
                    assert!(
                        one.length <= 1.1 * other.length + 0.02,
                        "{case}: {from} to {goal}: {one:?} {other:?}"
                    );
                    assert!(
                        other.length <= 1.1 * one.length + 0.05,
                        "{case}: {from} to {goal}: {one:?} {other:?}"
                    );
                    assert!(one.length >= (goal - from).norm() - 1e-5);
                    reached += 1;
                }
                (None, None) => closed += 1,
                (None, Some(_)) => missed += 1,
                (Some(way), None) => panic!("{case}: {from} to {goal}: no cells lead along {way:?}"),
            }
        }
    }
    println!("{reached} reached, {closed} closed off, {missed} missed by corners");
    assert!(reached > 1000 && closed > 100, "{reached} {closed}");
    assert!(missed * 100 <= reached, "{missed} of {reached} missed");
}

#[test]
fn who_drives_from_turn_to_turn_arrives_as_soon_as_was_said() {
    let mut source = chance(42);
    let mut arrived = 0;
    for case in 0..100 {
        let space = space(&mut source, 0.03);
        let corners = Corners::new(&space).expect("not too many corners");
        let (goal, mut at) = (place(&mut source), place(&mut source));
        let ways = CornerWays::new(&space, &corners, goal, 0.0);
        if !space.is_free(space.cell(at)) {
            continue;
        }
        let Some(first) = ways.way(&space, &corners, at) else { continue };
        let mut driven = 0.0;
        for _ in 0..60 {
            let way = ways.way(&space, &corners, at).expect("a way goes on");
            driven += (way.next - at).norm();
            at = way.next;
            if at == goal {
                break;
            }
        }
        assert_eq!(at, goal, "{case}");
        assert!((driven - first.length).abs() <= 0.02 * first.length + 0.01, "{case}: {driven} {first:?}");
        arrived += 1;
    }
    assert!(arrived > 40, "{arrived}");
}

#[test]
fn too_many_corners_are_none() {
    let rows: Vec<String> = (0..120)
        .map(|row| (0..120).map(|column| if row % 3 == 1 && column % 3 == 1 { '#' } else { '.' }).collect())
        .collect();
    let blocks = Blocks::new(&Map { rows, layers: None }, 1.0, 1);
    let space = FreeSpace::new(1.0, 0.005, &[], Some(&blocks));
    assert!(space.corners().count() > MOST_CORNERS);
    assert!(Corners::new(&space).is_none());
}
