//! Every way this crate can fail, in one enum. Each message is one line that names the value, its
//! place and what is allowed.

/// What can go wrong in this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A scenario is not valid; the text names the key.
    #[error("{key} = {value}: {rule}")]
    Scenario {
        /// Path of the key, such as `scenario.robots[2].mass_kg`.
        key: String,
        /// The value found there.
        value: String,
        /// What is allowed.
        rule: String,
    },
    /// A scenario's text is not JSON of the right form (unknown key, wrong type, syntax).
    #[error("scenario: {0}")]
    ScenarioText(String),
    /// An argument of a batch is out of range.
    #[error("{name} = {value}: {rule}")]
    Argument {
        /// Name of the argument.
        name: &'static str,
        /// The value given.
        value: String,
        /// What is allowed.
        rule: String,
    },
    /// An action is out of range or not a number.
    #[error("actions[env {env}, robot {robot}] = {value}: {rule}")]
    Action {
        /// Index of the env in the batch.
        env: usize,
        /// Index of the robot in the team.
        robot: usize,
        /// The action given.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// The level of a fault is out of range or not a number.
    #[error("faults[{kind}, env {env}, robot {robot}] = {value}: {rule}")]
    Fault {
        /// Kind of the fault.
        kind: &'static str,
        /// Index of the env in the batch.
        env: usize,
        /// Index of the robot in the team.
        robot: usize,
        /// The level given.
        value: f32,
        /// What is allowed.
        rule: String,
    },
    /// A step was asked of a world whose episode is over, while autoreset is disabled.
    #[error("env {env}: its episode is over; reset it before the next step (autoreset is disabled)")]
    EpisodeOver {
        /// Index of the env in the batch.
        env: usize,
    },
    /// A snapshot cannot be restored here.
    #[error("snapshot: {0}")]
    Snapshot(String),
}

/// Result with this crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
