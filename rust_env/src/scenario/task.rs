//! Tasks: the kinds of victims, what they need, and how long they take and wait.

use serde::{Deserialize, Serialize};

use super::Abilities;

/// A kind of victim: the abilities that must meet at it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Unique name, such as `task_1`.
    pub name: String,
    /// Needed abilities: a list, with repeats if several robots of one ability are needed, or sums.
    pub needs: Abilities,
    /// How long all needs of a victim must be met before it is rescued, s.
    #[serde(default)]
    pub service_s: f64,
    /// What happens to its service when they are not met any more.
    #[serde(default)]
    pub service: Interrupted,
    /// How long after it appeared a victim is lost, s; never if absent.
    #[serde(default)]
    pub deadline_s: Option<Deadline>,
    /// Names of the tasks that come before it: its victims wait for theirs.
    #[serde(default)]
    pub after: Vec<String>,
    /// How many of its victims arrive in a second in the poisson situation, on average.
    #[serde(default)]
    pub arrival_rate_hz: f64,
    /// Least x and y, then largest x and y, of the places at which its victims appear, m; as
    /// `victim_area_m` says if absent.
    #[serde(default)]
    pub area_m: Option<[f64; 4]>,
}

impl Task {
    /// A task whose victims are rescued at touch and wait for ever, and for nobody.
    #[must_use]
    pub fn new(name: &str, needs: impl Into<Abilities>) -> Self {
        Self {
            name: name.into(),
            needs: needs.into(),
            service_s: 0.0,
            service: Interrupted::Keep,
            deadline_s: None,
            after: vec![],
            arrival_rate_hz: 0.0,
            area_m: None,
        }
    }

    /// Whether a place is in its own area, whose border belongs to it; any place is if it has none.
    #[must_use]
    pub fn holds(&self, place: &[f64; 2]) -> bool {
        self.area_m.is_none_or(|[left, bottom, right, top]| {
            (left..=right).contains(&place[0]) && (bottom..=top).contains(&place[1])
        })
    }
}

/// What happens to the service of a victim when its needs are not met any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interrupted {
    /// It goes on later where it stopped.
    #[default]
    Keep,
    /// It starts anew.
    Restart,
}

/// How long a victim waits before it is lost, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "deadline_s must be a number or a pair [low, high]")]
pub enum Deadline {
    /// As long as every other of its task.
    Same(f64),
    /// Drawn for each victim between a least and a largest time.
    Between([f64; 2]),
}

impl Deadline {
    /// The least and the largest, s.
    #[must_use]
    pub fn range(self) -> [f64; 2] {
        match self {
            Self::Same(seconds) => [seconds, seconds],
            Self::Between(range) => range,
        }
    }
}

/// Control steps until `seconds` have passed: the first whole number of periods that reaches them.
pub(crate) fn steps_of(seconds: f64, dt_s: f64) -> u32 {
    (seconds / dt_s * (1.0 - 1e-12)).ceil() as u32 // 0.3 / 0.1 is a little more than 3
}
