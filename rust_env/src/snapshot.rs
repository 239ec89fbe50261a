//! Snapshots: a versioned image of worlds as bytes, with a checksum. Restoring is bit-exact or refused.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fault::NUM_KINDS;
use crate::rules::Rules;
use crate::world::World;

const MAGIC: &[u8; 8] = b"innerATT";
const VERSION: u32 = 2;
/// Kinds of faults in an image of this version.
const KINDS: usize = 9;
const _: () = assert!(NUM_KINDS == KINDS, "images hold a value for each kind: raise VERSION, then KINDS");
const CHECKSUM_BYTES: usize = 4;

#[derive(Serialize, Deserialize)]
struct Image<W> {
    version: u32,
    scenario: String,
    worlds: W,
}

/// The image of `worlds`, which were made by `rules`.
///
/// # Panics
/// Never: plain data always serialises.
#[must_use]
pub fn save<'a>(rules: &Rules, worlds: impl Iterator<Item = &'a World>) -> Vec<u8> {
    let worlds: Vec<&World> = worlds.collect();
    let image = Image { version: VERSION, scenario: rules.scenario.to_json(), worlds };
    let mut bytes = postcard::to_extend(&image, MAGIC.to_vec()).expect("plain data serialises");
    let checksum = crc32fast::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

/// The worlds in `bytes`, if it is a whole image of `num_envs` worlds of the same scenario.
///
/// # Errors
/// [`Error::Snapshot`] that says what is wrong.
pub fn load(rules: &Rules, num_envs: usize, bytes: &[u8]) -> Result<Vec<World>> {
    let refuse = |why: String| Err(Error::Snapshot(why));
    let Some((body, checksum)) = bytes.split_last_chunk::<CHECKSUM_BYTES>() else {
        return refuse(format!("{} bytes are too few", bytes.len()));
    };
    let Some(image) = body.strip_prefix(MAGIC) else {
        return refuse("these bytes are not a snapshot of rescue worlds".into());
    };
    if crc32fast::hash(body).to_le_bytes() != *checksum {
        return refuse("the checksum does not match: bytes are missing or altered".into());
    }
    let Ok(image) = postcard::from_bytes::<Image<Vec<World>>>(image) else {
        return refuse(format!("the image cannot be read; this version reads version {VERSION}"));
    };
    if image.version != VERSION {
        return refuse(format!("version {} was found; this version reads {VERSION}", image.version));
    }
    if image.scenario != rules.scenario.to_json() {
        return refuse("it was made with another scenario".into());
    }
    if image.worlds.len() != num_envs {
        return refuse(format!("it holds {} envs; this batch has {num_envs}", image.worlds.len()));
    }
    match image.worlds.iter().position(|world| !fits(rules, world)) {
        Some(env) => refuse(format!("env {env} does not fit the scenario")),
        None => Ok(image.worlds),
    }
}

/// Whether a world's numbers are of the scenario's sizes and finite.
fn fits(rules: &Rules, world: &World) -> bool {
    let places = world.positions.iter().chain(&world.velocities).chain(&world.obstacles);
    let victims = || world.victims.iter().flatten();
    world.positions.len() == rules.team.len()
        && world.velocities.len() == rules.team.len()
        && world.obstacles.len() == rules.solids.len()
        && world.victims.len() == rules.scenario.num_victims()
        && world.faults.fits(rules)
        && victims().all(|victim| (victim.task as usize) < rules.tasks.len())
        && places
            .copied()
            .chain(victims().map(|victim| victim.position))
            .all(|at| at.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec2;
    use crate::scenario::Scenario;

    fn rules() -> Rules {
        Rules::new(Scenario::default()).expect("a valid scenario")
    }

    /// Why worlds are refused that are no worlds of these rules, though the checksum is right.
    fn refusal(change: impl Fn(&mut World)) -> String {
        let rules = rules();
        let mut worlds = [World::new(&rules, 0, 0), World::new(&rules, 0, 1)];
        assert_eq!(load(&rules, 2, &save(&rules, worlds.iter())), Ok(worlds.to_vec()));
        change(&mut worlds[1]);
        load(&rules, 2, &save(&rules, worlds.iter())).expect_err("a forged image").to_string()
    }

    #[test]
    fn worlds_that_do_not_fit_are_refused() {
        let wanted = "snapshot: env 1 does not fit the scenario";
        assert_eq!(refusal(|world| world.positions[2].x = f32::NAN), wanted);
        assert_eq!(refusal(|world| world.velocities[0].y = f32::INFINITY), wanted);
        assert_eq!(refusal(|world| world.positions.push(Vec2::zeros())), wanted);
        assert_eq!(refusal(|world| world.velocities.clear()), wanted);
        assert_eq!(refusal(|world| world.obstacles.push(Vec2::zeros())), wanted);
        assert_eq!(refusal(|world| world.victims.clear()), wanted);
        assert_eq!(refusal(|world| world.victims[0].as_mut().expect("one is present").task = 2), wanted);
    }

    #[test]
    fn another_version_is_refused() {
        let rules = rules();
        let worlds: Vec<World> = vec![];
        let image = Image { version: VERSION + 1, scenario: rules.scenario.to_json(), worlds };
        let mut bytes = postcard::to_extend(&image, MAGIC.to_vec()).expect("plain data serialises");
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        let error = load(&rules, 0, &bytes).expect_err("another version").to_string();
        assert_eq!(error, "snapshot: version 3 was found; this version reads 2");
    }
}
