//! What robots can do and what victims need: names alone, or an amount of each.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Abilities of a robot, or needs of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "abilities and needs must be a list of names or a table of amounts")]
pub enum Abilities {
    /// Names. A robot can do each of them with an amount of 1; a task needs a robot of its own for each.
    Names(Vec<String>),
    /// How much a robot gives of each, or what those of the helpers must add up to.
    Amounts(BTreeMap<String, f64>),
}

impl Abilities {
    /// The names, with repeats where a list has some.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let (listed, amounts) = match self {
            Self::Names(names) => (Some(names), None),
            Self::Amounts(amounts) => (None, Some(amounts)),
        };
        let names = listed.into_iter().flatten().chain(amounts.into_iter().flat_map(BTreeMap::keys));
        names.map(String::as_str)
    }

    /// The amounts, where there are some.
    #[must_use]
    pub fn amounts(&self) -> Option<&BTreeMap<String, f64>> {
        match self {
            Self::Names(_) => None,
            Self::Amounts(amounts) => Some(amounts),
        }
    }

    /// How much a robot with these gives of an ability; 0 without it.
    #[must_use]
    pub fn amount(&self, ability: &str) -> f64 {
        match self {
            Self::Names(names) => f64::from(u8::from(names.iter().any(|name| name == ability))),
            Self::Amounts(amounts) => amounts.get(ability).copied().unwrap_or(0.0),
        }
    }
}

/// Whether a sum of amounts reaches what is needed. It does from a billionth below it: 0.7 + 0.2 + 0.1 is 1.
#[must_use]
pub fn reaches(sum: f64, needed: f64) -> bool {
    sum >= needed * (1.0 - 1e-9)
}

impl From<Vec<String>> for Abilities {
    fn from(names: Vec<String>) -> Self {
        Self::Names(names)
    }
}

impl<const N: usize> From<[(&str, f64); N]> for Abilities {
    fn from(amounts: [(&str, f64); N]) -> Self {
        Self::Amounts(amounts.into_iter().map(|(name, amount)| (name.to_string(), amount)).collect())
    }
}
