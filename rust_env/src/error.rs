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
    /// A victim that a caller puts somewhere cannot be that victim.
    #[error("victims[{field}, env {env}, slot {slot}] = {value}: {rule}")]
    Victim {
        /// Field of the victim.
        field: &'static str,
        /// Index of the env in the batch.
        env: usize,
        /// Slot of the victim.
        slot: usize,
        /// The value given.
        value: String,
        /// What is allowed.
        rule: String,
    },
    /// A step was asked of a world whose episode is over, while autoreset is disabled.
    #[error("env {env}: its episode is over; reset it before the next step (autoreset is disabled)")]
    EpisodeOver {
        /// Index of the env in the batch.
        env: usize,
    },
    /// Worlds panicked during a step. All others have done it; these stand at the start of their episodes
    /// and wait for a reset.
    #[error("env {}: it failed in this step ({}); all others have done the step", listed(.envs), .message)]
    Panicked {
        /// Indices of the envs in the batch, in order.
        envs: Vec<usize>,
        /// What the first of them said, in one line.
        message: String,
    },
    /// A step was asked of a world that panicked in an earlier one.
    #[error("env {env}: it failed in an earlier step; reset it, or restore a snapshot, before the next")]
    Broken {
        /// Index of the env in the batch.
        env: usize,
    },
    /// The caller's poll ended a step; the worlds are as they were before it.
    #[error("the step was interrupted; nothing has moved")]
    Interrupted,
    /// A snapshot cannot be restored here.
    #[error("snapshot: {0}")]
    Snapshot(String),
}

/// Most numbers that a message lists.
const MOST_LISTED: usize = 20;

/// Numbers with commas between them, the first of them if there are many.
fn listed(numbers: &[usize]) -> String {
    let shown: Vec<String> = numbers.iter().take(MOST_LISTED).map(usize::to_string).collect();
    match numbers.len().saturating_sub(MOST_LISTED) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Result with this crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
