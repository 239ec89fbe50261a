//! What is left of a row where sight is limited, and for how long the rest has not been seen.

use super::{Layout, Scene};
use crate::geometry::Vec2;
use crate::scenario::{MAX_VICTIMS, VictimOrder};
use crate::sight::{Sight, later};
use crate::tasks::Victim;

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

    /// Writes the victims that the robot sees or is told of, and for how long it has not seen each.
    #[inline(never)] // worlds in which all is seen are faster without it
    pub(super) fn write_seen(
        &self,
        sight: &Sight,
        scene: Scene,
        own: usize,
        position: Vec2,
        rows: &mut [f32],
    ) {
        let (slots, seen) = (scene.victims.len(), sight.victims(own, scene.sightings));
        let mut known = sight.seen(own, scene.sightings, scene.step, scene.victims);
        let mut since = [1.0; MAX_VICTIMS];
        for (since, last) in since.iter_mut().zip(seen) {
            *since = sight.since(*last, scene.step);
        }
        if let Some(radio) = &self.radio {
            for (slot, told) in radio.told(own, scene.told).iter().enumerate() {
                since[slot] = sight.since(later(seen[slot], *told), scene.step);
                known[slot] =
                    known[slot].or(scene.victims[slot].filter(|_| radio.is_news(*told, scene.step)));
            }
        }
        let (known, since) = (&known[..slots], &mut since[..slots]);
        let in_sight = Scene { victims: known, ..scene };
        self.write_victims(in_sight, &scene.team[own], position, since, rows);
        self.write_since(known, since, rows);
    }

    /// Writes for how long the robot has not seen the victims that it does not know now. In the order of relevance
    /// they follow the others, by that time, so that nothing tells of what it does not know.
    fn write_since(&self, known: &[Option<Victim>], since: &mut [f32], rows: &mut [f32]) {
        let (width, at) = (self.widths.victim, self.since_seen());
        if self.sorted == VictimOrder::Slot {
            return rows.chunks_exact_mut(width).zip(since).for_each(|(row, since)| row[at] = *since);
        }
        let mut rest = 0;
        for (slot, victim) in known.iter().enumerate() {
            if victim.is_none() {
                since[rest] = since[slot];
                rest += 1;
            }
        }
        let hidden = &mut since[..rest];
        hidden.sort_unstable_by(f32::total_cmp);
        let rows = rows.chunks_exact_mut(width).skip(known.len() - rest);
        rows.zip(hidden).for_each(|(row, since)| row[at] = *since);
    }
}
