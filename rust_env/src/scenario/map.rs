//! Maps: which cells of a grid over the arena are solid.

use serde::{Deserialize, Serialize};

use super::check::{broken, counts};
use super::{Engine, Scenario};
use crate::error::Result;

/// Most cells along one side of a map.
pub const MAX_CELLS: usize = 200;
/// A cell that is solid, and one that is not.
pub const SOLID: u8 = b'#';
const FREE: u8 = b'.';

/// A square grid over the whole arena.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Map {
    /// The rows from the largest y to the least, each from the least x to the largest: `#` is solid, `.` free.
    pub rows: Vec<String>,
    /// The layers of the robots that solid cells block; all if absent.
    #[serde(default)]
    pub layers: Option<Vec<String>>,
}

impl Map {
    /// Whether a cell is solid.
    #[must_use]
    pub fn is_solid(&self, row: usize, column: usize) -> bool {
        self.rows[row].as_bytes()[column] == SOLID
    }

    /// Whether robots of a layer touch solid cells.
    #[must_use]
    pub fn blocks(&self, layer: &str) -> bool {
        self.layers.as_ref().is_none_or(|layers| layers.iter().any(|name| name == layer))
    }

    /// Whether a place in an arena of this half width is in a solid cell.
    #[must_use]
    pub fn holds(&self, at: [f64; 2], half: f64) -> bool {
        let side = self.rows.len();
        let index = |value: f64| (((value + half) / (2.0 * half) * side as f64) as usize).min(side - 1);
        self.is_solid(index(-at[1]), index(at[0]))
    }
}

impl Scenario {
    /// Refuses maps that are no square grid, and such as block no robot.
    pub(super) fn validate_map(&self) -> Result<()> {
        let Some(map) = &self.map else { return Ok(()) };
        let side = map.rows.len();
        counts("map.rows (their number)", side, 2, MAX_CELLS)?;
        for (index, row) in map.rows.iter().enumerate() {
            let key = format!("map.rows[{index}]");
            if row.len() != side {
                let rule = format!("must have {side} cells, as many as there are rows");
                return broken(&key, &format!("{row:?}"), &rule);
            }
            if let Some(wrong) = row.chars().find(|cell| ![SOLID, FREE].contains(&(*cell as u32 as u8))) {
                return broken(&key, &format!("{wrong:?}"), "cells must be '#', which is solid, or '.'");
            }
        }
        if map.rows.iter().all(|row| row.bytes().all(|cell| cell == SOLID)) {
            return broken("map.rows", &"all '#'", "some cells must be free");
        }
        if self.engine == Engine::None {
            return broken("map", &"a map", "must be left out with engine = \"none\", without contacts");
        }
        map.layers.as_ref().map_or(Ok(()), |layers| self.validate_blocked("map.layers", layers))
    }
}
