//! Robots as numbers: abilities as bits, and the drive that turns a command into a velocity.

use crate::geometry::Vec2;
use crate::scenario::{Actions, DriveMode, Scenario};

/// Number of discrete actions: stay, +x, −x, +y, −y.
pub const NUM_ACTIONS: usize = 5;

/// Fastest that anyone may be put into motion, on each axis, m/s: no contact makes one of the fastest and
/// heaviest team of a scenario faster.
pub const MAX_SET_SPEED_MPS: f32 = 1e4;

/// One robot's constants, read off a valid scenario.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Radius, m.
    pub radius: f32,
    /// Mass, kg.
    pub mass: f32,
    /// Speed cap, m/s.
    pub max_speed: f32,
    /// Speed gained by full drive in one control period, m/s: F/m · dt, or the speed cap where actions set
    /// the velocity; 0 of a robot on [`crate::wheels::Wheels`].
    pub gain: f32,
    /// Share of the velocity that a control period begins with: none where actions set it.
    pub kept: f32,
    /// Its layer, one bit, in the order of [`Scenario::layers`].
    pub layer: u64,
    /// Abilities as bits, in the order of [`Scenario::abilities`].
    pub abilities: u32,
}

/// The bodies of a scenario's team, in team order.
#[must_use]
pub(crate) fn bodies(scenario: &Scenario) -> Vec<Body> {
    let abilities = scenario.abilities();
    let layers = scenario.layers();
    let layer = |name: &str| layers.iter().position(|layer| *layer == name).map_or(0, |bit| 1 << bit);
    let bit = |name: &str| abilities.iter().position(|ability| *ability == name).map_or(0, |bit| 1 << bit);
    scenario
        .robots
        .iter()
        .map(|robot| Body {
            radius: robot.radius_m as f32,
            mass: robot.mass_kg as f32,
            max_speed: robot.max_speed_mps as f32,
            gain: match robot.drive {
                DriveMode::Force => (robot.drive_force_n / robot.mass_kg * scenario.dt_s) as f32,
                DriveMode::Velocity => robot.max_speed_mps as f32,
                DriveMode::Unicycle | DriveMode::Differential => 0.0,
            },
            kept: match robot.drive {
                DriveMode::Force => 1.0 - scenario.damping as f32,
                DriveMode::Velocity | DriveMode::Unicycle | DriveMode::Differential => 0.0,
            },
            layer: layer(&robot.layer),
            abilities: robot.abilities.names().map(bit).fold(0, |mask, bit| mask | bit),
        })
        .collect()
}

/// The actions of some worlds, one for each robot; [`crate::batch::Batch::step`] checks them.
#[derive(Debug, Clone, Copy)]
pub enum Commands<'a> {
    /// Discrete actions, one integer for each robot.
    Discrete(&'a [i64]),
    /// Continuous actions, two numbers for each robot.
    Continuous(&'a [f32]),
}

impl Commands<'_> {
    /// The kind of actions that these are.
    #[must_use]
    pub fn kind(&self) -> Actions {
        match self {
            Self::Discrete(_) => Actions::Discrete,
            Self::Continuous(_) => Actions::Continuous,
        }
    }

    /// Numbers held.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Discrete(actions) => actions.len(),
            Self::Continuous(actions) => actions.len(),
        }
    }

    /// Whether none are held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The drive asked of robot `index`: a direction whose length, at most 1, is the share of full force.
    #[must_use]
    pub fn drive(&self, index: usize) -> Vec2 {
        match self {
            Self::Discrete(actions) => match actions[index] {
                1 => Vec2::new(1.0, 0.0),
                2 => Vec2::new(-1.0, 0.0),
                3 => Vec2::new(0.0, 1.0),
                4 => Vec2::new(0.0, -1.0),
                _ => Vec2::zeros(),
            },
            Self::Continuous(actions) => {
                let drive = Vec2::new(actions[2 * index], actions[2 * index + 1]);
                drive / drive.norm().max(1.0)
            }
        }
    }
}

impl Body {
    /// The velocity a control period starts with: damped, driven, and clipped to `cap` of the speed cap.
    #[must_use]
    pub fn driven(&self, velocity: Vec2, drive: Vec2, cap: f32) -> Vec2 {
        let wanted = velocity * self.kept + drive * self.gain;
        let (speed, most) = (wanted.norm(), self.max_speed * cap);
        if speed > most { wanted * (most / speed) } else { wanted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_reaches_its_cap_and_keeps_it() {
        let scenario = Scenario::default();
        for (body, robot) in bodies(&scenario).iter().zip(&scenario.robots) {
            let mut velocity = Vec2::zeros();
            for _ in 0..20 {
                velocity = body.driven(velocity, Vec2::new(0.0, 1.0), 1.0);
                assert!(velocity.norm() <= body.max_speed * (1.0 + 1e-6), "{}", robot.name);
            }
            assert!((velocity.norm() - body.max_speed).abs() < 1e-5, "{}", robot.name);
        }
    }

    #[test]
    fn a_velocity_is_set_at_once_and_kept_by_nothing() {
        let mut scenario = Scenario::default();
        scenario.robots[1].drive = DriveMode::Velocity;
        let body = bodies(&scenario)[1];
        let fast = Vec2::new(-7.0, 3.0);
        assert_eq!(body.driven(fast, Vec2::new(0.0, 1.0), 1.0), Vec2::new(0.0, 1.0));
        assert_eq!(body.driven(fast, Vec2::new(0.3, -0.4), 1.0), Vec2::new(0.3, -0.4));
        assert_eq!(body.driven(fast, Vec2::new(1.0, 0.0), 0.25), Vec2::new(0.25, 0.0));
        assert_eq!(body.driven(fast, Vec2::zeros(), 1.0), Vec2::zeros());
    }

    #[test]
    fn a_continuous_action_is_clipped_to_unit_length() {
        let actions = [1.0, 1.0, 0.3, 0.4];
        let commands = Commands::Continuous(&actions);
        assert!((commands.drive(0).norm() - 1.0).abs() < 1e-6);
        assert!((commands.drive(1).norm() - 0.5).abs() < 1e-6);
    }
}
