//! What a row says where some robots are on wheels.

use super::{Layout, Scene};
use crate::geometry::Vec2;
use crate::wheels::Wheels;

impl Layout {
    /// Writes where robots point, how fast the robot itself turns, and how far ahead of it and to its left each
    /// victim is that it sees.
    #[inline(never)]
    pub(super) fn write_headings(&self, wheels: &Wheels, scene: Scene, own: usize, row: &mut [f32]) {
        let others = (0..self.robots).filter(|other| *other != own);
        let from = self.widths.robot - self.widths.heading;
        for (block, robot) in self.blocks(row).zip(std::iter::once(own).chain(others)) {
            let ahead = wheels.ahead(robot, scene.headings);
            block[from..from + 2].copy_from_slice(&[ahead.x, ahead.y]);
        }
        let ahead = Vec2::new(row[from], row[from + 1]);
        row[self.widths.robot + self.widths.ways - self.widths.rays - 1] = scene.headings[own].turn_rate;
        let (width, place) = (self.widths.victim, 1 + self.abilities.len());
        for victim in row[self.widths.victims_from..].chunks_exact_mut(width) {
            let way = Vec2::new(victim[place], victim[place + 1]);
            (victim[width - 2], victim[width - 1]) = (ahead.dot(&way), ahead.perp(&way));
        }
    }
}
