//! Layers: robots of different ones do not touch each other, and obstacles block those that they name.

use super::check::{broken, counts, named};
use super::{MAX_ROBOTS, Obstacle, Scenario};
use crate::error::Result;

/// The layer of a robot unless a scenario says so.
pub fn default_layer() -> String {
    "ground".into()
}

impl Obstacle {
    /// Whether robots of a layer touch it.
    #[must_use]
    pub fn blocks(&self, layer: &str) -> bool {
        self.layers.as_ref().is_none_or(|layers| layers.iter().any(|name| name == layer))
    }
}

impl Scenario {
    /// The layers of the robots, by the first robot of each.
    #[must_use]
    pub fn layers(&self) -> Vec<&str> {
        let mut layers: Vec<&str> = vec![];
        for robot in &self.robots {
            if !layers.contains(&robot.layer.as_str()) {
                layers.push(&robot.layer);
            }
        }
        layers
    }

    /// For each obstacle the layers that it blocks, as bits in the order of [`Scenario::layers`].
    #[must_use]
    pub fn blocked(&self) -> Vec<u64> {
        let layers = self.layers();
        let of = |obstacle: &Obstacle| {
            let blocked = layers.iter().enumerate().filter(|(_, layer)| obstacle.blocks(layer));
            blocked.fold(0, |bits, (index, _)| bits | 1 << index)
        };
        self.obstacles.iter().map(of).collect()
    }

    /// The same with the robots of one layer and what blocks them alone.
    #[must_use]
    pub(crate) fn layer_alone(&self, layer: &str) -> Self {
        let mut alone = self.clone();
        alone.robots.retain(|robot| robot.layer == layer);
        alone.obstacles.retain(|obstacle| obstacle.blocks(layer));
        alone.map = alone.map.filter(|map| map.blocks(layer));
        alone
    }

    /// Refuses names that are none, and obstacles that block no robot.
    pub(super) fn validate_layers(&self) -> Result<()> {
        for (index, robot) in self.robots.iter().enumerate() {
            named(&format!("robots[{index}].layer"), &robot.layer)?;
        }
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let Some(layers) = &obstacle.layers else { continue };
            self.validate_blocked(&format!("obstacles[{index}].layers"), layers)?;
        }
        Ok(())
    }

    /// Refuses layers (of this key) of which one has no robot or is named twice.
    pub(super) fn validate_blocked(&self, key: &str, layers: &[String]) -> Result<()> {
        let known = self.layers();
        counts(&format!("{key} (their number)"), layers.len(), 1, MAX_ROBOTS)?;
        for (place, layer) in layers.iter().enumerate() {
            if !known.contains(&layer.as_str()) {
                let rule = format!("no robot is in this layer; the layers are {}", known.join(", "));
                return broken(key, &format!("{layer:?}"), &rule);
            }
            if layers[..place].contains(layer) {
                return broken(key, &format!("{layer:?}"), "is named twice");
            }
        }
        Ok(())
    }
}
