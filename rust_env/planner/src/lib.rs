//! Plans for instances of multi-robot task allocation: points travel at constant speed, and a task needs
//! several robots at the same time.
//!
//! An [`instance::Instance`] says where robots and tasks are. A [`schedule::Schedule`] says to which tasks
//! each robot goes, and [`schedule::simulate`] what comes of it. [`order`] turns an order of the tasks into
//! a schedule, [`simple`] makes plain ones to compare with, and [`search`] looks for the shortest. The crate
//! knows no world: nothing here has a body, a sensor or a fault.

pub mod error;

pub mod instance;

pub mod coalition;
pub mod schedule;

pub mod order;

pub mod simple;

pub mod choice;

pub mod search;

pub mod ways;

pub mod moment;

pub mod dispatch;
