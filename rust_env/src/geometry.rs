//! Plane geometry: distances to solids, and when things that move straight on would first touch.
//! Knows nothing of robots, rules or the contact solver.

use nalgebra::Vector2;

use crate::scenario::{Obstacle, Shape};

/// A point or direction in the plane, m or m/s.
pub type Vec2 = Vector2<f32>;

/// The unit vector at an angle from the x axis, counterclockwise, rad.
#[must_use]
pub fn direction(angle: f32) -> Vec2 {
    let (sin, cos) = libm::sincosf(angle);
    Vec2::new(cos, sin)
}

/// The way from a place to the nearest of others, m; ties by their order.
#[must_use]
pub fn way_to_nearest(from: Vec2, places: impl Iterator<Item = Vec2>) -> Option<Vec2> {
    let ways = places.map(|place| place - from);
    ways.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
}

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
    pub(crate) fn of(obstacle: &Obstacle) -> Self {
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
        self.nearest(point).0.max(0.0)
    }

    /// Distance from `point`, relative to the solid's centre, to its surface (negative inside), m, and
    /// the direction in which it grows fastest.
    #[must_use]
    pub fn nearest(&self, point: Vec2) -> (f32, Vec2) {
        match self {
            Self::Disc(radius) => (point.norm() - radius, point.try_normalize(0.0).unwrap_or_else(Vec2::x)),
            Self::Box(half) => {
                let outside = point - point.zip_map(half, |p, h| p.clamp(-h, h));
                if let Some(outward) = outside.try_normalize(0.0) {
                    return (outside.norm(), outward);
                }
                let depth = half - point.abs();
                let axis = usize::from(depth.y < depth.x);
                let mut outward = Vec2::zeros();
                outward[axis] = 1.0_f32.copysign(point[axis]);
                (-depth[axis], outward)
            }
        }
    }

    /// Whether the straight `way` on from a place, relative to the solid's centre, leads through its inside. It
    /// says the same of mirrored ways, to the bit.
    #[must_use]
    pub fn is_crossed(&self, from: Vec2, way: Vec2) -> bool {
        let length = way.norm_squared();
        if length == 0.0 {
            return false;
        }
        match self {
            Self::Disc(radius) => {
                let nearest = from + way * (-from.dot(&way) / length).clamp(0.0, 1.0);
                nearest.norm_squared() < radius * radius
            }
            Self::Box(half) => {
                // No axis parts the two: neither one of the box, nor the one across the way.
                let (middle, reach) = (from + way * 0.5, way.abs() * 0.5);
                let across = middle.x * way.y - middle.y * way.x;
                middle.x.abs() < half.x + reach.x
                    && middle.y.abs() < half.y + reach.y
                    && across.abs() < half.x * way.y.abs() + half.y * way.x.abs()
            }
        }
    }

    /// How far a ray goes until it meets the solid, whose centre is `way` on from where the ray begins, m:
    /// 0 if it begins inside, infinite if it never does. `direction` is a unit vector.
    #[must_use]
    pub fn met_after(&self, way: Vec2, direction: Vec2) -> f32 {
        match self {
            Self::Disc(radius) => {
                let (along, across) = (way.dot(&direction), way.perp(&direction));
                let square = radius * radius;
                let depth = square - across * across;
                if way.norm_squared() <= square {
                    0.0
                } else if along <= 0.0 || depth < 0.0 {
                    f32::INFINITY
                } else {
                    (along - depth.sqrt()).max(0.0)
                }
            }
            Self::Box(half) => {
                let (mut enters, mut leaves) = (0.0_f32, f32::INFINITY);
                for axis in 0..2 {
                    let speed = direction[axis];
                    if speed == 0.0 {
                        if way[axis].abs() > half[axis] {
                            return f32::INFINITY;
                        }
                        continue;
                    }
                    let (one, other) = ((way[axis] - half[axis]) / speed, (way[axis] + half[axis]) / speed);
                    enters = enters.max(one.min(other));
                    leaves = leaves.min(one.max(other));
                }
                if enters <= leaves { enters } else { f32::INFINITY }
            }
        }
    }

    /// Half width and half height of the smallest upright box that holds it, m.
    #[must_use]
    pub fn half_extents(&self) -> Vec2 {
        match self {
            Self::Disc(radius) => Vec2::repeat(*radius),
            Self::Box(half) => *half,
        }
    }

    /// Half its shortest diameter, m.
    #[must_use]
    pub fn half_breadth(&self) -> f32 {
        match self {
            Self::Disc(radius) => *radius,
            Self::Box(half) => half.min(),
        }
    }

    /// Whether a disc at a place relative to the solid's centre overlaps it by more than `most` of the smaller of
    /// the two.
    #[must_use]
    pub fn is_sunk_in(&self, at: Vec2, radius: f32, most: f32) -> bool {
        self.nearest(at).0 < radius - most * radius.min(self.half_breadth())
    }

    /// Radius of the smallest disc around the centre that holds the solid, m.
    #[must_use]
    pub fn reach(&self) -> f32 {
        match self {
            Self::Disc(radius) => *radius,
            Self::Box(half) => half.norm(),
        }
    }
}

/// What counts as a touch of things that move straight on.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// Overlap that is not yet a touch, m.
    pub slop: f32,
    /// What overlaps touches at once, unless it parts at this speed or faster, m/s; if negative,
    /// nothing that approaches more slowly than its amount touches at all.
    pub parting: f32,
}

impl Touch {
    /// When two discs with centres `apart` and relative velocity `closing`, whose radii add up to
    /// `radii`, first touch, s; infinite if never.
    #[must_use]
    pub fn discs(self, apart: Vec2, closing: Vec2, radii: f32) -> f32 {
        let reach = radii - self.slop;
        let approach = apart.dot(&closing);
        let gap = apart.norm_squared() - reach * reach;
        if approach >= self.parting_at(gap) * reach {
            return f32::INFINITY;
        }
        if gap <= 0.0 {
            return 0.0;
        }
        let discriminant = approach * approach - closing.norm_squared() * gap;
        if discriminant < 0.0 { f32::INFINITY } else { gap / (discriminant.sqrt() - approach) }
    }

    /// When a disc's centre at `place` on one axis first leaves ±`half`, the walls, s; infinite if never.
    #[must_use]
    pub fn walls(self, place: f32, speed: f32, half: f32) -> f32 {
        let limit = half + self.slop;
        let side = if place.abs() > limit { place } else { speed };
        let (place, speed) = (place * side.signum(), speed * side.signum());
        let gap = limit - place;
        if -speed >= self.parting_at(gap) {
            // Off this wall: what overlapped it may meet the opposite one.
            return if speed < 0.0 { (limit + place) / -speed } else { f32::INFINITY };
        }
        if gap <= 0.0 { 0.0 } else { gap / speed }
    }

    /// When a disc at `place`, relative to the solid, first touches it, s; infinite if never.
    #[must_use]
    pub fn solid(self, solid: &Solid, place: Vec2, velocity: Vec2, radius: f32) -> f32 {
        let half = match solid {
            Solid::Disc(other) => return self.discs(-place, -velocity, radius + other),
            Solid::Box(half) => half,
        };
        let reach = radius - self.slop;
        let (distance, outward) = solid.nearest(place);
        let parts = velocity.dot(&outward) >= self.parting_at(distance - reach);
        if distance <= reach {
            return if parts { f32::INFINITY } else { 0.0 };
        }
        // The disc's centre meets the box grown by the reach: at a face, or at a corner's quarter circle.
        let (mut enters, mut leaves, mut face) = (f32::NEG_INFINITY, f32::INFINITY, 0);
        for axis in 0..2 {
            let limit = half[axis] + reach;
            if velocity[axis] == 0.0 {
                if place[axis].abs() >= limit {
                    return f32::INFINITY;
                }
                continue;
            }
            let to = |side: f32| (side * limit - place[axis]) / velocity[axis];
            let near = to(-velocity[axis].signum());
            if near > enters {
                (enters, face) = (near, axis);
            }
            leaves = leaves.min(to(velocity[axis].signum()));
        }
        if enters > leaves || leaves < 0.0 {
            return f32::INFINITY;
        }
        let here = place + velocity * enters.max(0.0);
        if here.x.abs() > half.x && here.y.abs() > half.y {
            let corner = half.zip_map(&here, f32::copysign);
            return self.discs(corner - place, -velocity, radius);
        }
        if enters < 0.0 {
            return if parts { f32::INFINITY } else { 0.0 }; // beside a face, but for rounding
        }
        if -velocity[face].abs() >= self.parting_at(1.0) { f32::INFINITY } else { enters }
    }

    /// The rate of change of a gap from which on there is no touch.
    fn parting_at(self, gap: f32) -> f32 {
        if gap <= 0.0 { self.parting } else { self.parting.min(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Overlaps are mended; nothing else is lenient.
    const MENDING: Touch = Touch { slop: 5e-5, parting: 1e-2 };
    /// The very surface, and only what approaches.
    const EXACT: Touch = Touch { slop: 0.0, parting: -1e-5 };

    #[test]
    fn a_way_crosses_what_one_of_its_places_is_inside_of() {
        let mut crossed = [0; 2];
        for index in 0..3000_u32 {
            let number = |salt: u32| (index * 7919 + salt * 104_729) % 1009;
            let unit = |salt| number(salt) as f32 / 1009.0 - 0.5;
            let solid = if index % 2 == 0 { Solid::Disc(0.2) } else { Solid::Box(Vec2::new(0.3, 0.1)) };
            let (from, way) = (Vec2::new(unit(1), unit(2)) * 2.0, Vec2::new(unit(3), unit(4)) * 3.0);
            let depths = (0..=1000).map(|part| solid.nearest(from + way * (part as f32 / 1000.0)).0);
            let deepest = depths.fold(f32::INFINITY, f32::min);
            if deepest.abs() > 1e-4 {
                assert_eq!(solid.is_crossed(from, way), deepest < 0.0, "{solid:?} {from} {way}");
                crossed[usize::from(deepest < 0.0)] += 1;
            }
            for mirror in [Vec2::new(-1.0, 1.0), Vec2::new(1.0, -1.0)] {
                let mirrored = solid.is_crossed(from.component_mul(&mirror), way.component_mul(&mirror));
                assert_eq!(mirrored, solid.is_crossed(from, way));
            }
        }
        assert!(crossed.iter().all(|count| *count > 200), "{crossed:?}");
        assert!(!Solid::Disc(0.2).is_crossed(Vec2::zeros(), Vec2::zeros()));
    }

    #[test]
    fn discs_meet_when_the_gap_is_used_up() {
        let meet = |x: f32, y: f32, speed: f32| EXACT.discs(Vec2::new(x, y), Vec2::new(speed, 0.0), 0.2);
        assert!((meet(1.0, 0.0, -2.0) - 0.4).abs() < 1e-6);
        assert!((meet(1.0, 0.12, -2.0) - 0.42).abs() < 1e-6, "at 0.16 along, 0.12 across");
        assert!(meet(1.0, 0.0, 2.0).is_infinite());
        assert!(meet(1.0, 0.3, -2.0).is_infinite());
        assert!(meet(0.2001, 0.0, -1e-6).is_infinite(), "all but still");
    }

    #[test]
    fn overlapping_discs_touch_now_unless_they_part() {
        let overlapping = |touch: Touch, speed| touch.discs(Vec2::new(0.1, 0.0), Vec2::new(speed, 0.0), 0.2);
        assert!(overlapping(MENDING, 0.0) <= 0.0);
        assert!(overlapping(MENDING, 1.0).is_infinite());
        assert!(overlapping(EXACT, -0.1) <= 0.0);
        assert!(overlapping(EXACT, 0.0).is_infinite());
    }

    #[test]
    fn a_wall_is_met_on_the_side_moved_to() {
        assert!((EXACT.walls(0.5, 1.0, 0.95) - 0.45).abs() < 1e-6);
        assert!((EXACT.walls(0.5, -1.0, 0.95) - 1.45).abs() < 1e-6);
        assert!(EXACT.walls(0.5, 0.0, 0.95).is_infinite());
        assert!(EXACT.walls(-0.96, -0.1, 0.95) <= 0.0);
        assert!((EXACT.walls(-0.96, 0.1, 0.95) - 19.1).abs() < 1e-4, "the opposite wall");
        assert!(MENDING.walls(-0.96, 0.0, 0.95) <= 0.0);
        let across = MENDING.walls(-0.96, 10.0, 0.95);
        assert!((across - 0.191).abs() < 1e-4, "the opposite wall: {across}");
    }

    #[test]
    fn a_box_is_met_at_its_face_and_at_its_corner() {
        let solid = Solid::Box(Vec2::new(0.2, 0.1));
        let meet = |x, y, speed: [f32; 2]| EXACT.solid(&solid, Vec2::new(x, y), speed.into(), 0.05);
        assert!((meet(1.0, 0.0, [-1.0, 0.0]) - 0.75).abs() < 1e-6);
        assert!((meet(0.1, -1.0, [0.0, 0.5]) - 1.7).abs() < 1e-6);
        assert!((meet(1.0, 0.13, [-1.0, 0.0]) - 0.76).abs() < 1e-6, "0.04 before, 0.03 above the corner");
        assert!(meet(1.0, 0.3, [-1.0, 0.0]).is_infinite());
        assert!(meet(1.0, 0.1501, [-1.0, 0.0]).is_infinite());
        assert!(meet(1.0, 0.0, [1.0, 0.0]).is_infinite());
    }

    #[test]
    fn the_first_touch_is_where_the_distance_is_used_up() {
        // Against small steps along the course, for both forms.
        for index in 0..2000_u32 {
            let number = |salt: u32| (index * 7919 + salt * 104_729) % 1009;
            let unit = |salt| number(salt) as f32 / 1009.0 - 0.5;
            let solid = if index % 2 == 0 { Solid::Disc(0.2) } else { Solid::Box(Vec2::new(0.3, 0.1)) };
            let (place, velocity) = (Vec2::new(unit(1), unit(2)) * 2.0, Vec2::new(unit(3), unit(4)));
            if solid.distance(place) <= 0.05 {
                continue;
            }
            let touch = EXACT.solid(&solid, place, velocity, 0.05);
            let room = |time: f32| solid.distance(place + velocity * time) - 0.05;
            let until = touch.min(4.0);
            for part in 0..200 {
                assert!(room(until * part as f32 / 200.0) > -1e-5, "{solid:?} {place} {velocity} {touch}");
            }
            assert!(touch.is_infinite() || room(touch).abs() < 1e-5, "{solid:?} {place} {velocity} {touch}");
        }
    }
}
