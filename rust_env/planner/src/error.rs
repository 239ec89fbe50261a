//! Every way this crate can fail. Each message is one line that names the value, its place and what is
//! allowed.

/// What can go wrong in this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// An instance is not valid.
    #[error("{place} = {value}: {rule}")]
    Instance {
        /// Where the value stands, such as `tasks[3].duration`.
        place: String,
        /// The value found there.
        value: String,
        /// What is allowed.
        rule: String,
    },
    /// A schedule does not serve every task with exactly the robots that it needs.
    #[error("schedule: {0}")]
    Schedule(String),
    /// Robots wait for each other for ever.
    #[error("schedule: deadlock: {0}")]
    Deadlock(String),
    /// A search was given no end.
    #[error("{name} = {value}: {rule}")]
    Limit {
        /// Name of the limit.
        name: &'static str,
        /// The value given.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// The caller's poll ended a search.
    #[error("the search was interrupted")]
    Interrupted,
}

/// Result with this crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
