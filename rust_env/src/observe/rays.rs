//! What range sensors measure, as columns behind a robot's own block.

use super::{Layout, Scene};
use crate::geometry::Vec2;
use crate::rays::{Around, Rays};

impl Layout {
    /// Writes what the rays of a robot measure, of which those that are `absent` (as bits) are no part.
    #[inline(never)]
    pub(super) fn write_rays(&self, rays: &Rays, scene: Scene, own: usize, absent: u64, row: &mut [f32]) {
        let Scene { team, positions, obstacles, .. } = scene;
        let headings = self.wheels.as_ref().map(|wheels| wheels.ahead(own, scene.headings));
        let ahead = headings.filter(|ahead| *ahead != Vec2::zeros()).unwrap_or_else(Vec2::x);
        let end = self.widths.robot + self.widths.ways;
        let columns = &mut row[end - self.widths.rays..end];
        rays.read(own, ahead, &Around { team, positions, obstacles, absent }, columns);
    }
}
