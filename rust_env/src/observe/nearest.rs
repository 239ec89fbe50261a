//! Rows with the nearest teammates alone, the nearest first.

use super::{Layout, Scene, Senses};
use crate::scenario::MAX_ROBOTS;

/// Takes the nearest teammates out of rows that have all.
#[derive(Debug, Clone)]
pub struct Nearest {
    /// The columns of rows with all teammates, in team order.
    all: Box<Layout>,
}

impl Nearest {
    /// Out of rows with these columns.
    pub(super) fn of(all: Layout) -> Self {
        Self { all: Box::new(all) }
    }

    /// See [`Layout::write`], whose columns are `layout`.
    #[inline(never)] // worlds whose rows have all teammates are faster without it
    pub(super) fn write(&self, layout: &Layout, scene: Scene, rows: &mut [f32]) {
        let width = self.all.width();
        let mut full = vec![0.0; layout.robots * width];
        self.all.write(scene, &mut full);
        for (full, row) in full.chunks_exact(width).zip(rows.chunks_exact_mut(layout.width())) {
            self.take(layout, full, row);
        }
    }

    /// See [`Layout::write_through`], whose columns are `layout`.
    #[inline(never)]
    pub(super) fn write_through(
        &self,
        layout: &Layout,
        scene: Scene,
        own: usize,
        senses: &Senses,
        row: &mut [f32],
    ) {
        let mut full = vec![0.0; self.all.width()];
        self.all.write_through(scene, own, senses, &mut full);
        self.take(layout, &full, row);
    }

    /// Copies what `row` has of `full`: the robot's own columns, the nearest teammates, and the victims. Teammates
    /// of which the robot knows nothing come last.
    fn take(&self, layout: &Layout, full: &[f32], row: &mut [f32]) {
        let (widths, all) = (&layout.widths, &self.all.widths);
        let (own, mate) = (widths.robot + widths.ways, widths.mate);
        let (bodies, victims) = full.split_at(all.victims_from);
        row[widths.victims_from..].copy_from_slice(victims);
        row[..own].copy_from_slice(&bodies[..own]);
        let blocks = bodies[own..].chunks_exact(mate);
        let mut sorted = [(false, 0.0_f32, 0_usize); MAX_ROBOTS];
        for (place, (key, block)) in sorted.iter_mut().zip(blocks.clone().enumerate()) {
            let unknown = match layout.sight {
                Some(_) => block[widths.robot] == 0.0,
                None => block.iter().all(|value| *value == 0.0),
            };
            *place = (unknown, block[0] * block[0] + block[1] * block[1], key);
        }
        let sorted = &mut sorted[..layout.robots - 1];
        sorted.sort_unstable_by(|(unknown, far, key), (other_unknown, other_far, other)| {
            unknown.cmp(other_unknown).then(far.total_cmp(other_far)).then(key.cmp(other))
        });
        let nearest = sorted.iter().map(|(_, _, key)| &bodies[own + key * mate..][..mate]);
        for (target, block) in row[own..widths.victims_from].chunks_exact_mut(mate).zip(nearest) {
            target.copy_from_slice(block);
        }
    }
}
