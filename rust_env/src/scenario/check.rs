//! Checks of single values of a scenario; each names the key, the value and what is allowed.

use std::fmt::Display;

use crate::error::{Error, Result};

/// The error that says what rule `value` of `scenario.{key}` breaks.
///
/// # Errors
/// Always, [`Error::Scenario`].
pub fn broken(key: &str, value: &dyn Display, rule: &str) -> Result<()> {
    Err(Error::Scenario { key: format!("scenario.{key}"), value: value.to_string(), rule: rule.into() })
}

/// Refuses a number that is not in `low..=high`.
///
/// # Errors
/// [`Error::Scenario`] that names key, value and range.
pub fn within(key: &str, value: f64, low: f64, high: f64, unit: &str) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    broken(key, &value, format!("must be in {low}..={high} {unit}").trim_end())
}

/// Refuses a count that is not in `low..=high`.
///
/// # Errors
/// [`Error::Scenario`] that names key, value and range.
pub fn counts(key: &str, value: usize, low: usize, high: usize) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    broken(key, &value, &format!("must be in {low}..={high}"))
}

/// Refuses a name that is empty, long, or of other than plain letters.
///
/// # Errors
/// [`Error::Scenario`] that names key, value and what is allowed.
pub fn named(key: &str, value: &str) -> Result<()> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !value.is_empty() && value.len() <= 64 && value.chars().all(allowed) {
        return Ok(());
    }
    broken(key, &format!("{value:?}"), "must be 1 to 64 letters, digits, '_' or '-'")
}
