//! What is left of a row where sight is limited, and for how long the rest has not been seen.

use super::{Layout, Scene};
use crate::geometry::Vec2;
use crate::scenario::{MAX_VICTIMS, VictimOrder};
use crate::sight::Sight;

impl Layout {
    /// Leaves nothing of teammates that the robot does not see, and says for how long it has not seen each of
    /// them.
    #[inline(never)]
    pub(super) fn hide_mates(&self, sight: &Sight, scene: Scene, own: usize, row: &mut [f32]) {
        let seen = sight.mates(own, scene.sightings);
        for (block, last) in self.blocks(row).skip(1).zip(seen) {
            if last != scene.step {
                block.fill(0.0);
            }
            let flags = self.widths.robot;
            block[flags] = f32::from(u8::from(last == scene.step));
            block[flags + 1] = sight.since(last, scene.step);
        }
    }

    /// Writes the victims that the robot sees, and for how long it has not seen each.
    #[inline(never)] // worlds in which all is seen are faster without it
    pub(super) fn write_seen(
        &self,
        sight: &Sight,
        scene: Scene,
        own: usize,
        position: Vec2,
        rows: &mut [f32],
    ) {
        let seen = sight.seen(own, scene.sightings, scene.step, scene.victims);
        let in_sight = Scene { victims: &seen[..scene.victims.len()], ..scene };
        self.write_victims(in_sight, &scene.team[own], position, rows);
        self.write_since(sight, scene, own, rows);
    }

    /// Writes for how long the robot has not seen each victim. In the order of relevance those that it sees come
    /// first, then those that it saw later than others, so that nothing tells of what it does not see.
    fn write_since(&self, sight: &Sight, scene: Scene, own: usize, rows: &mut [f32]) {
        let mut since = [1.0; MAX_VICTIMS];
        let last = sight.victims(own, scene.sightings);
        for (since, last) in since.iter_mut().zip(last) {
            *since = sight.since(*last, scene.step);
        }
        if self.sorted == VictimOrder::Relevant {
            since[..last.len()].sort_unstable_by(f32::total_cmp);
        }
        let width = self.widths.victim;
        let at = width - 1 - self.widths.heading;
        rows.chunks_exact_mut(width).zip(since).for_each(|(row, since)| row[at] = since);
    }
}
