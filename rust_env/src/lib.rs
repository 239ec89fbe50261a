//! Batches of 2D rescue worlds for teams of unlike robots, stepped with rigid-body contacts.
//!
//! Data flows one way: a [`scenario::Scenario`] becomes [`rules::Rules`], a [`batch::Batch`] holds
//! [`world::World`]s that play by them, and each step writes flat arrays. Each file uses only those
//! named above it here, and a test says so. The threads of a batch are [`innerattn_pool::Pool`]'s.

pub mod error;

pub mod matching;

pub mod fault;
pub mod scenario;

pub mod geometry;
pub mod rng;

pub mod robot;

pub mod wheels;

pub mod blocks;
pub mod energy;

pub mod place;
pub mod tasks;

pub mod meeting;
pub mod sight;

pub mod radio;
pub mod rays;
pub mod supply;

pub mod spawn;

pub mod physics;

pub mod observe;
pub mod reward;

pub mod rules;

pub mod free_space;

pub mod corners;
pub mod distance_field;
pub mod routes;

pub mod fault_state;

pub mod world;

pub mod snapshot;

pub mod batch;
