//! Which teammates a robot hears, as columns.

use super::{Layout, Scene};

impl Layout {
    /// Says of each teammate whether the robot hears it.
    #[inline(never)]
    pub(super) fn write_heard(&self, scene: Scene, own: usize, row: &mut [f32]) {
        let others = (0..self.robots).filter(|other| *other != own);
        for (block, other) in self.blocks(row).skip(1).zip(others) {
            block[self.widths.mate - 1] = (scene.heard[own] >> other & 1) as f32;
        }
    }
}
