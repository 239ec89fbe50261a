//! What worlds promise, tested through the crate's public face. All in one program, so that the crate is
//! linked once; `cargo test --test worlds contacts` runs the tests of one file.

mod common;

mod areas;
mod arrivals;
mod batteries;
mod contacts;
mod containment;
mod determinism;
mod digests;
mod engines;
mod extending;
mod extremes;
mod faults;
mod fuzz;
mod layers;
mod leaving;
mod loads;
mod map;
mod order;
mod radio;
mod rays;
mod routes;
mod sight;
mod snapshot;
mod speed;
mod structure;
mod tasks;
mod victims;
mod wheels;
