//! Plane geometry: distances to solids, and when things that move straight on would first touch.
//! Knows nothing of robots, rules or the contact solver.

use nalgebra::Vector2;

use crate::scenario::{Obstacle, Shape};

/// A point or direction in the plane, m or m/s.
pub type Vec2 = Vector2<f32>;

/// The form of a solid that does not move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solid {
    /// A disc of this radius, m.
    Disc(f32),
    /// An upright box of this half width and half height, m.
    Box(Vec2),
}

impl Solid {
    /// The form of a validated obstacle.
    #[must_use]
    pub fn of(obstacle: &Obstacle) -> Self {
        match obstacle.shape {
            Shape::Disc => Self::Disc(obstacle.radius_m.unwrap_or_default() as f32),
            Shape::Box => {
                let [x, y] = obstacle.half_extents_m.unwrap_or_default();
                Self::Box(Vec2::new(x as f32, y as f32))
            }
        }
    }

    /// Distance from `point`, relative to the solid's centre, to its surface (0 inside), m.
    #[must_use]
    pub fn distance(&self, point: Vec2) -> f32 {
        match self {
            Self::Disc(radius) => (point.norm() - radius).max(0.0),
            Self::Box(half) => outside_box(point, *half).norm(),
        }
    }

    /// Radius of the smallest disc around the centre that holds the solid, m.
    #[must_use]
    pub fn reach(&self) -> f32 {
        match self {
            Self::Disc(radius) => *radius,
            Self::Box(half) => half.norm(),
        }
    }

    /// Direction in which the distance from the solid grows fastest at `point` (zero deep inside).
    fn outward(&self, point: Vec2) -> Vec2 {
        match self {
            Self::Disc(_) => point,
            Self::Box(half) => outside_box(point, *half),
        }
        .try_normalize(0.0)
        .unwrap_or_default()
    }
}

fn outside_box(point: Vec2, half: Vec2) -> Vec2 {
    point - point.zip_map(&half, |p, h| p.clamp(-h, h))
}

/// Depth below which an overlap is left alone: small beside any radius, large beside rounding, m.
const SLOP_M: f32 = 5e-5;
/// Overlapping things that part at this speed or faster need no help, m/s.
const PARTING_MPS: f32 = 1e-2;

/// When two discs with centres `apart` and relative velocity `closing` first touch, s; infinite if never.
#[must_use]
pub fn discs_touch(apart: Vec2, closing: Vec2, radii: f32) -> f32 {
    let reach = radii - SLOP_M;
    let approach = apart.dot(&closing);
    let gap = apart.norm_squared() - reach * reach;
    if gap <= 0.0 {
        let parting = approach > PARTING_MPS * radii;
        return if parting { f32::INFINITY } else { 0.0 };
    }
    if approach >= 0.0 {
        return f32::INFINITY;
    }
    let speed = closing.norm_squared();
    let discriminant = approach * approach - speed * gap;
    if discriminant < 0.0 { f32::INFINITY } else { gap / (discriminant.sqrt() - approach) }
}

/// When a disc's centre at `place` on one axis first leaves ±`half`, the walls, s; infinite if never.
#[must_use]
pub fn walls_touch(place: f32, speed: f32, half: f32) -> f32 {
    let limit = half + SLOP_M;
    let gap = if speed >= 0.0 { limit - place } else { limit + place };
    if gap > 0.0 {
        return if speed == 0.0 { f32::INFINITY } else { gap / speed.abs() };
    }
    0.0
}

/// A time before which a disc at `place` (relative to the solid) does not touch it, s, at most
/// `horizon`; infinite if it surely does not touch within `horizon`. By conservative advancement, which
/// gives up early beside a surface passed closely.
#[must_use]
pub fn solid_touch(solid: &Solid, place: Vec2, velocity: Vec2, radius: f32, horizon: f32) -> f32 {
    const NEAR_M: f32 = 1e-5;
    let reach = radius - SLOP_M;
    let speed = velocity.norm();
    let mut time = 0.0;
    for _ in 0..16 {
        let here = place + velocity * time;
        let gap = solid.distance(here) - reach;
        if gap <= NEAR_M {
            let parting = velocity.dot(&solid.outward(here)) > PARTING_MPS;
            return if parting { f32::INFINITY } else { time };
        }
        if gap >= speed * (horizon - time) {
            return f32::INFINITY;
        }
        time += gap / speed;
    }
    time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_meet_when_the_gap_is_used_up() {
        let time = discs_touch(Vec2::new(1.0, 0.0), Vec2::new(-2.0, 0.0), 0.2);
        assert!((time - 0.4).abs() < 1e-4, "{time}");
        assert!(discs_touch(Vec2::new(1.0, 0.0), Vec2::new(2.0, 0.0), 0.2).is_infinite());
        assert!(discs_touch(Vec2::new(1.0, 0.3), Vec2::new(-2.0, 0.0), 0.2).is_infinite());
    }

    #[test]
    fn overlapping_discs_touch_now_unless_they_part() {
        assert!(discs_touch(Vec2::new(0.1, 0.0), Vec2::zeros(), 0.2) <= 0.0);
        assert!(discs_touch(Vec2::new(0.1, 0.0), Vec2::new(1.0, 0.0), 0.2).is_infinite());
    }

    #[test]
    fn a_wall_is_met_on_the_side_moved_to() {
        assert!((walls_touch(0.5, 1.0, 0.95) - 0.45).abs() < 1e-3);
        assert!((walls_touch(0.5, -1.0, 0.95) - 1.45).abs() < 1e-3);
        assert!(walls_touch(0.5, 0.0, 0.95).is_infinite());
        assert!(walls_touch(0.96, 0.0, 0.95) <= 0.0);
    }

    #[test]
    fn a_box_is_met_at_its_face_and_missed_past_its_corner() {
        let solid = Solid::Box(Vec2::new(0.2, 0.1));
        let time = solid_touch(&solid, Vec2::new(1.0, 0.0), Vec2::new(-1.0, 0.0), 0.05, 2.0);
        assert!((time - 0.75).abs() < 1e-3, "{time}");
        let past = solid_touch(&solid, Vec2::new(1.0, 0.3), Vec2::new(-1.0, 0.0), 0.05, 5.0);
        assert!(past.is_infinite());
        let late = solid_touch(&solid, Vec2::new(1.0, 0.0), Vec2::new(-1.0, 0.0), 0.05, 0.5);
        assert!(late.is_infinite());
    }
}
