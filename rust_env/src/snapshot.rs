//! Snapshots: a versioned image of worlds as bytes, with a checksum. Restoring is bit-exact or refused.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fault::NUM_KINDS;
use crate::geometry::Vec2;
use crate::radio::Radio;
use crate::robot::MAX_SET_SPEED_MPS;
use crate::rules::Rules;
use crate::scenario::Scenario;
use crate::tasks::Victim;
use crate::world::World;

const MAGIC: &[u8; 8] = b"innerATT";
const VERSION: u32 = 2;
/// Kinds of faults in an image of this version.
const KINDS: usize = 9;
const _: () = assert!(NUM_KINDS == KINDS, "images hold a value for each kind: raise VERSION, then KINDS");
const CHECKSUM_BYTES: usize = 4;

/// Most episodes of a world: far more than anyone plays, and the next still has a number.
const MOST_EPISODES: u64 = 1 << 53;

/// What comes before the worlds.
#[derive(Serialize, Deserialize)]
struct Head {
    version: u32,
    scenario: String,
    num_envs: usize,
}

/// What follows a world where victims take time, so that the images of other scenarios stay what they were.
/// When a victim is lost follows from the world.
#[derive(Serialize, Deserialize)]
struct Tail {
    lost: u32,
    /// Steps of service by slot, 0 where it is empty.
    served: Vec<u32>,
}

impl Tail {
    fn is_kept(scenario: &Scenario) -> bool {
        scenario.has_services() || scenario.has_deadlines()
    }

    fn of(world: &World) -> Self {
        let served = world.victims.iter().map(|victim| victim.map_or(0, |victim| victim.served_steps));
        Self { lost: world.lost, served: served.collect() }
    }

    /// Puts it back; returns whether each empty slot has none.
    fn restore(self, world: &mut World) -> bool {
        world.lost = self.lost;
        self.served.len() == world.victims.len()
            && world.victims.iter_mut().zip(self.served).all(|(victim, served)| match victim {
                Some(victim) => {
                    victim.served_steps = served;
                    true
                }
                None => served == 0,
            })
    }
}

/// Most bytes of an image of so many worlds of these rules.
#[must_use]
pub fn most_bytes(rules: &Rules, num_envs: usize) -> usize {
    // Numbers of 64 bits take at most 10 bytes, of 32 bits 5, floats 4; a list names its length, too.
    let (robots, slots, width) = (rules.team.len(), rules.scenario.num_victims(), rules.layout.width());
    let counts = 16 * 10;
    let places = 8 * (2 * robots + rules.solids.len()) + (1 + 3 * 5 + 8 + 5) * slots;
    let faults = 2 * 5 * rules.faults.len() + NUM_KINDS * (10 + 4 * robots) + robots * (11 + 4 * width);
    let headings = if rules.wheels.is_some() { 10 + 8 * robots } else { 0 };
    let charges = if rules.energy.is_some() { 10 + 8 * robots } else { 0 };
    let loads = if rules.supplies.is_some() { 10 + 5 * robots } else { 0 };
    let sightings = rules.sight.as_ref().map_or(0, |sight| 10 + 5 * sight.numbers());
    let (long, short) = rules.radio.as_ref().map_or((0, 0), Radio::numbers);
    let traffic = if rules.radio.is_some() { 4 * 10 + 10 * long + 5 * short } else { 0 };
    let head = MAGIC.len() + 2 * 10 + rules.scenario.to_json().len() + CHECKSUM_BYTES;
    head + num_envs * (counts + places + faults + headings + charges + loads + sightings + traffic)
}

/// The image of `worlds`, which were made by `rules`.
///
/// # Panics
/// Never: plain data always serialises.
#[must_use]
pub fn save<'a>(rules: &Rules, num_envs: usize, worlds: impl Iterator<Item = &'a World>) -> Vec<u8> {
    let head = Head { version: VERSION, scenario: rules.scenario.to_json(), num_envs };
    let bytes = postcard::to_extend(&head, MAGIC.to_vec()).expect("plain data serialises");
    let has_tail = Tail::is_kept(&rules.scenario);
    let add = |mut bytes, world: &World| {
        bytes = postcard::to_extend(world, bytes).expect("plain data serialises");
        if has_tail {
            bytes = postcard::to_extend(&Tail::of(world), bytes).expect("plain data serialises");
        }
        if rules.wheels.is_some() {
            bytes = postcard::to_extend(&world.headings, bytes).expect("plain data serialises");
        }
        if rules.energy.is_some() {
            bytes = postcard::to_extend(&world.charges, bytes).expect("plain data serialises");
        }
        if rules.supplies.is_some() {
            bytes = postcard::to_extend(&world.loads, bytes).expect("plain data serialises");
        }
        if rules.sight.is_some() {
            bytes = postcard::to_extend(&world.sightings, bytes).expect("plain data serialises");
        }
        if rules.radio.is_some() {
            bytes = postcard::to_extend(&world.traffic, bytes).expect("plain data serialises");
        }
        bytes
    };
    sealed(worlds.fold(bytes, add))
}

/// Bytes with their checksum.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32fast::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

/// The worlds in `bytes`, if it is a whole image of `num_envs` worlds of the same scenario.
///
/// The checksum finds damage. An image that was forged has a right one: every number is checked, too, so
/// that what is accepted is a state that a world of this scenario may have.
///
/// # Errors
/// [`Error::Snapshot`] that says what is wrong.
pub fn load(rules: &Rules, num_envs: usize, bytes: &[u8]) -> Result<Vec<World>> {
    let refuse = |why: String| Err(Error::Snapshot(why));
    let unread =
        || Error::Snapshot(format!("the image cannot be read; this version reads version {VERSION}"));
    let Some((body, checksum)) = bytes.split_last_chunk::<CHECKSUM_BYTES>() else {
        return refuse(format!("{} bytes are too few", bytes.len()));
    };
    let Some(image) = body.strip_prefix(MAGIC) else {
        return refuse("these bytes are not a snapshot of rescue worlds".into());
    };
    if crc32fast::hash(body).to_le_bytes() != *checksum {
        return refuse("the checksum does not match: bytes are missing or altered".into());
    }
    let (version, _) = postcard::take_from_bytes::<u32>(image).map_err(|_| unread())?;
    if version != VERSION {
        return refuse(format!("version {version} was found; this version reads {VERSION}"));
    }
    let (head, mut rest) = postcard::take_from_bytes::<Head>(image).map_err(|_| unread())?;
    if !is_of(&rules.scenario, &head.scenario) {
        return refuse("it was made with another scenario".into());
    }
    if head.num_envs != num_envs {
        return refuse(format!("it holds {} envs; this batch has {num_envs}", head.num_envs));
    }
    let mut worlds = Vec::with_capacity(num_envs);
    for env in 0..num_envs {
        let (mut world, mut later) = postcard::take_from_bytes::<World>(rest).map_err(|_| unread())?;
        if Tail::is_kept(&rules.scenario) {
            let (tail, rest) = postcard::take_from_bytes::<Tail>(later).map_err(|_| unread())?;
            if !tail.restore(&mut world) {
                return refuse(format!("env {env} does not fit the scenario: its services"));
            }
            later = rest;
        }
        if rules.wheels.is_some() {
            (world.headings, later) = postcard::take_from_bytes(later).map_err(|_| unread())?;
        }
        if rules.energy.is_some() {
            (world.charges, later) = postcard::take_from_bytes(later).map_err(|_| unread())?;
        }
        if rules.supplies.is_some() {
            (world.loads, later) = postcard::take_from_bytes(later).map_err(|_| unread())?;
        }
        if rules.sight.is_some() {
            (world.sightings, later) = postcard::take_from_bytes(later).map_err(|_| unread())?;
        }
        if rules.radio.is_some() {
            (world.traffic, later) = postcard::take_from_bytes(later).map_err(|_| unread())?;
        }
        if let Some(what) = misfit(rules, &world) {
            return refuse(format!("env {env} does not fit the scenario: its {what}"));
        }
        world.set_deadlines(rules);
        worlds.push(world);
        rest = later;
    }
    if !rest.is_empty() {
        return refuse(format!("{} bytes are left over after the last env", rest.len()));
    }
    Ok(worlds)
}

/// Whether a text describes this scenario; keys that it lacks, since they are newer, have their defaults.
fn is_of(scenario: &Scenario, text: &str) -> bool {
    let wanted = scenario.to_json();
    text == wanted || Scenario::from_json(text).is_ok_and(|found| found.to_json() == wanted)
}

/// The first field of a world that no world of these rules may have. Every seed and stream is possible.
fn misfit(rules: &Rules, world: &World) -> Option<&'static str> {
    let (scenario, slots) = (&rules.scenario, rules.scenario.num_victims() as u64);
    let turns = u64::from(world.step) + 1;
    let time_is_up = world.step >= scenario.episode_steps;
    let must_be_over = time_is_up || world.goal_is_reached(rules);
    // Callers may let victims appear in a world that is done; it stays over.
    let is_over = must_be_over || world.over && world.may_be_done(rules);
    let present = world.victims.iter().flatten().count() as u64;
    let (arena, robots) = (scenario.arena_half_width_m as f32, rules.team.len());
    let within = |vectors: &[Vec2], most: f32| {
        vectors.iter().flat_map(Vec2::iter).all(|number| (-most..=most).contains(number))
    };
    let served = |victim: &Victim| {
        rules.services.get(victim.task as usize).is_some_and(|service| service.may_be(victim))
    };
    let checks = [
        ("episode", world.episode < MOST_EPISODES),
        ("step", world.step <= scenario.episode_steps),
        ("over", world.over == is_over),
        ("fresh", !world.fresh || (world.episode == 0 && world.step == 0)),
        ("rescued", u64::from(world.rescued) <= slots * u64::from(world.step)),
        ("lost", u64::from(world.lost) <= slots * u64::from(world.step)),
        ("lost", world.lost == 0 || rules.deadlines.is_some()),
        ("appeared", u64::from(world.appeared) == u64::from(world.rescued) + u64::from(world.lost) + present),
        ("victim_words", world.victim_words <= turns * rules.spawn.most_words()),
        ("positions", world.positions.len() == robots && within(&world.positions, arena)),
        ("velocities", world.velocities.len() == robots && within(&world.velocities, MAX_SET_SPEED_MPS)),
        ("headings", rules.wheels.as_ref().is_none_or(|wheels| wheels.may_be(&world.headings))),
        ("obstacles", rules.spawn.may_be_obstacles(&world.obstacles)),
        ("victims", rules.spawn.may_be_victims(&world.victims, world.step, world.appeared)),
        ("services", world.victims.iter().flatten().all(served)),
        ("loads", rules.supplies.as_ref().is_none_or(|supplies| supplies.may_be(&world.loads))),
        ("charges", rules.energy.as_ref().is_none_or(|energy| energy.may_be(&world.charges))),
        ("faults", world.faults.fits(rules, world.now())),
    ];
    let broken = checks.into_iter().find(|(_, fits)| !fits).map(|(what, _)| what);
    // A look needs a world in which all else is right, and an exchange one that is right about what is seen.
    let broken = broken.or_else(|| (!world.sightings_fit(rules)).then_some("sightings"));
    broken.or_else(|| (!world.traffic_fits(rules)).then_some("traffic"))
}

#[cfg(test)]
mod tests;
