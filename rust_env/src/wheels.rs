//! Robots on wheels: how fast each drives along its heading and turns, and the arc on which that takes it.
//!
//! A contact engine is given velocities, as of every robot. That of a robot on wheels is the chord of its arc,
//! divided by the control period, so that one that touches nothing ends where the arc does.

use std::f32::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use crate::fault::Drive;
use crate::geometry::{Vec2, direction};
use crate::rng::Stream;
use crate::robot::Commands;
use crate::scenario::{DriveMode, Robot, Scenario};

/// Where a robot on wheels points, and how fast it turns; zeros for another one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Heading {
    /// Angle from the x axis, counterclockwise, −π to π, rad.
    pub angle: f32,
    /// How fast it turned in the last control period, counterclockwise, rad/s.
    pub turn_rate: f32,
}

impl Heading {
    /// The unit vector along it.
    #[must_use]
    pub fn ahead(self) -> Vec2 {
        direction(self.angle)
    }
}

/// What moves a robot on wheels.
#[derive(Debug, Clone, Copy)]
enum Base {
    /// A speed and a turn rate are set; the gain is the most that a period adds to the turn rate, rad/s.
    Unicycle { turn_gain: f32 },
    /// The speeds of two wheels are set, each so far from the middle, m.
    Differential { arm: f32 },
}

/// One robot's constants.
#[derive(Debug, Clone, Copy)]
struct Axle {
    base: Base,
    /// Highest speed, or that of a wheel, m/s.
    max_speed: f32,
    /// Highest turn rate, rad/s.
    max_turn: f32,
    /// Most that a period adds to a speed, m/s.
    gain: f32,
}

/// The wheels of a scenario's team.
#[derive(Debug, Clone)]
pub struct Wheels {
    /// By robot; none for one without wheels.
    axles: Vec<Option<Axle>>,
    /// Control period, s.
    dt: f32,
}

impl Wheels {
    /// The wheels of a valid scenario; `None` where no robot has any.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let dt = scenario.dt_s;
        let axle = |robot: &Robot| {
            let base = match robot.drive {
                DriveMode::Force | DriveMode::Velocity => return None,
                DriveMode::Unicycle => {
                    Base::Unicycle { turn_gain: (robot.turn_acceleration_rad_s2 * dt) as f32 }
                }
                DriveMode::Differential => Base::Differential { arm: (0.5 * robot.track_m()) as f32 },
            };
            Some(Axle {
                base,
                max_speed: robot.max_speed_mps as f32,
                max_turn: robot.max_turn_rad_s as f32,
                gain: (robot.acceleration_m_s2 * dt) as f32,
            })
        };
        let axles = scenario.robots.iter().map(axle).collect();
        scenario.has_wheels().then_some(Self { axles, dt: dt as f32 })
    }

    /// The robots that have wheels.
    pub fn robots(&self) -> impl Iterator<Item = usize> {
        self.axles.iter().enumerate().filter(|(_, axle)| axle.is_some()).map(|(robot, _)| robot)
    }

    /// The headings when an episode starts: uniform, one word for each robot, and at rest.
    pub fn point(&self, stream: &mut Stream, headings: &mut Vec<Heading>) {
        headings.clear();
        headings.extend(self.axles.iter().map(|axle| {
            let angle = stream.between(-PI, PI);
            if axle.is_some() { Heading { angle, turn_rate: 0.0 } } else { Heading::default() }
        }));
    }

    /// What is asked of a robot: the shares of its speed ahead and to the left, of which a wheel adds one to the
    /// other. Number `index` of the commands is its own.
    #[must_use]
    pub fn shares(&self, robot: usize, commands: Commands, index: usize) -> Vec2 {
        let base = self.axles[robot].map(|axle| axle.base);
        match (commands, base) {
            (Commands::Continuous(shares), Some(Base::Differential { .. })) => {
                let [left, right] = [shares[2 * index], shares[2 * index + 1]];
                Vec2::new(0.5 * (left + right), 0.5 * (right - left))
            }
            (Commands::Continuous(shares), _) => Vec2::new(shares[2 * index], shares[2 * index + 1]),
            (Commands::Discrete(_), _) => commands.drive(index),
        }
    }

    /// The velocity of a robot in the control period that begins now, and its heading when it ends. `velocity`
    /// is that of the period before, as contacts have left it: the wheels roll with its part along their way.
    #[must_use]
    pub fn driven(
        &self,
        robot: usize,
        heading: Heading,
        velocity: Vec2,
        shares: Vec2,
        left: Drive,
    ) -> (Vec2, Heading) {
        let Some(axle) = self.axles[robot] else { return (velocity, heading) };
        let before = 0.5 * self.dt * heading.turn_rate;
        let speed = velocity.dot(&direction(heading.angle - before + left.turn)) / sinc(before);
        let cap = axle.max_speed * left.speed;
        let (asked, sideways) = (shares.x * left.force, shares.y * left.force);
        let toward =
            |from: f32, share: f32| approached(from, share * axle.max_speed, axle.gain).clamp(-cap, cap);
        let (speed, turn_rate) = match axle.base {
            Base::Unicycle { turn_gain } => {
                (toward(speed, asked), approached(heading.turn_rate, sideways * axle.max_turn, turn_gain))
            }
            Base::Differential { arm } => {
                let spread = heading.turn_rate * arm;
                let [inner, outer] =
                    [toward(speed - spread, asked - sideways), toward(speed + spread, asked + sideways)];
                (0.5 * (inner + outer), 0.5 * (outer - inner) / arm)
            }
        };
        let turn_rate = turn_rate.clamp(-axle.max_turn, axle.max_turn);
        let half = 0.5 * self.dt * turn_rate;
        let chord = direction(heading.angle + half + left.turn) * (speed * sinc(half));
        (chord, Heading { angle: wrapped(heading.angle + 2.0 * half), turn_rate })
    }

    /// The unit vector along a robot's heading; zeros for one without wheels.
    #[must_use]
    pub fn ahead(&self, robot: usize, headings: &[Heading]) -> Vec2 {
        self.axles[robot].map_or_else(Vec2::zeros, |_| headings[robot].ahead())
    }

    /// Whether robots may have these headings.
    #[must_use]
    pub fn may_be(&self, headings: &[Heading]) -> bool {
        let fits = |(axle, heading): (&Option<Axle>, &Heading)| match axle {
            Some(axle) => (-PI..=PI).contains(&heading.angle) && heading.turn_rate.abs() <= axle.max_turn,
            None => *heading == Heading::default(),
        };
        headings.len() == self.axles.len() && self.axles.iter().zip(headings).all(fits)
    }
}

/// A number nearer to another one, by so much at most.
fn approached(from: f32, to: f32, most: f32) -> f32 {
    from + (to - from).clamp(-most, most)
}

/// sin x / x: the chord of an arc of 2 x, divided by the arc.
fn sinc(x: f32) -> f32 {
    if x.abs() < 1e-2 { 1.0 - x * x / 6.0 } else { libm::sinf(x) / x }
}

/// An angle of less than a circle and a half, −π to π.
fn wrapped(angle: f32) -> f32 {
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}
