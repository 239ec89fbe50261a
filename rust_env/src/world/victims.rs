//! Victims of a world: who appears, who is rescued, and who is lost.

use super::World;
use crate::geometry::Vec2;
use crate::rng::{Purpose, Stream};
use crate::rules::Rules;
use crate::tasks::{Loss, Rescue};

impl World {
    /// Lets the victims appear that the situation wants now, or that arrive, away from all robots but those
    /// `absent`. Returns how many of these found all slots of their task taken.
    pub(super) fn fill_slots(&mut self, rules: &Rules, absent: u64) -> usize {
        if rules.arrivals.is_none() && !rules.spawn.wants_victims(&self.victims) {
            return 0;
        }
        let Self { seed, stream, episode, step, positions, obstacles, victims, .. } = self;
        let arrivals = rules.arrivals.iter();
        let mut due = arrivals.flat_map(|one| one.due(*step, *seed, *stream, *episode)).peekable();
        if !rules.spawn.wants_victims(victims) && due.peek().is_none() {
            return 0;
        }
        let there = positions.iter().enumerate().filter(|(robot, _)| absent >> robot & 1 == 0);
        let robots: Vec<Vec2> = there.map(|(_, at)| *at).collect();
        let mut words = Stream::new(*seed, *stream, *episode, Purpose::Victims).resume(self.victim_words);
        let (appeared, mut turned_away) = (&mut self.appeared, 0);
        if rules.arrivals.is_some() {
            turned_away =
                rules.spawn.place_arrivals(&mut words, due, *step, appeared, &robots, obstacles, victims);
        } else {
            rules.spawn.place_victims(&mut words, *step, appeared, &robots, obstacles, victims);
        }
        self.victim_words = words.words();
        self.set_deadlines(rules);
        turned_away
    }

    /// Says of every victim when it is lost.
    pub fn set_deadlines(&mut self, rules: &Rules) {
        let Some(deadlines) = &rules.deadlines else { return };
        for victim in self.victims.iter_mut().flatten() {
            victim.deadline_step = deadlines.step_of(victim, self.seed, self.stream, self.episode);
        }
    }

    /// Serves and rescues victims by the rescue rule, slot by slot; no robot helps twice in one step. Who has
    /// to wait is decided before anybody is rescued.
    pub(super) fn settle(&mut self, rules: &Rules, env: usize, rescues: &mut Vec<Rescue>) {
        let radius = rules.scenario.rescue_radius_m as f32;
        let mut busy = self.unable(rules);
        let blocked = rules.order.as_ref().map_or(0, |order| order.blocked(&self.victims));
        for (slot, place) in self.victims.iter_mut().enumerate() {
            let Some(victim) = place else { continue };
            let service = rules.services[victim.task as usize];
            let needs = &rules.tasks[victim.task as usize];
            let waits = blocked >> slot & 1 == 1;
            let helpers = || needs.helpers(victim.position, &rules.team, &self.positions, radius, busy);
            let Some(helpers) = (!waits).then(helpers).flatten() else {
                service.interrupt(victim);
                continue;
            };
            helpers.iter().flatten().for_each(|robot| busy |= 1 << robot);
            if !service.serve(victim) {
                continue;
            }
            self.rescued += 1;
            if let Some(supplies) = &rules.supplies {
                supplies.take(&helpers, &mut self.loads);
            }
            rescues.push(Rescue {
                env: env as u32,
                episode: self.episode,
                step: self.step,
                slot: slot as u32,
                victim: victim.id,
                task: victim.task,
                helpers,
            });
            *place = None;
        }
    }

    /// Takes away the victims whose deadline comes with the end of this step.
    pub(super) fn lose(&mut self, env: usize, losses: &mut Vec<Loss>) {
        for (slot, place) in self.victims.iter_mut().enumerate() {
            let Some(victim) = place.filter(|victim| victim.deadline_step <= self.step + 1) else { continue };
            *place = None;
            self.lost += 1;
            losses.push(Loss {
                env: env as u32,
                episode: self.episode,
                step: self.step,
                slot: slot as u32,
                victim: victim.id,
                task: victim.task,
            });
        }
    }

    /// Whether the scenario's goal is reached: enough rescues, or nothing left of its list.
    #[must_use]
    pub fn goal_is_reached(&self, rules: &Rules) -> bool {
        let enough = rules.scenario.end_when_rescued.is_some_and(|goal| self.rescued >= goal);
        enough || self.may_be_done(rules) && self.victims.iter().all(Option::is_none)
    }

    /// Whether an episode may end with this step since all of its list have arrived.
    #[must_use]
    pub fn may_be_done(&self, rules: &Rules) -> bool {
        let came = || rules.arrivals.as_ref().is_some_and(|arrivals| arrivals.all_came(self.step));
        rules.scenario.end_when_done && self.step > 0 && came()
    }
}
