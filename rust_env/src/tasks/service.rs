//! Service: how long the needs of a victim must be met before it is rescued.

use super::{Victim, steps_of};
use crate::scenario::{Interrupted, Scenario, Task};

/// How long the victims of a task are served, in control steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Service {
    /// Steps at whose end the needs are met until it is rescued; 0 and 1 are both rescue at touch.
    pub steps: u32,
    /// Whether a step at whose end they are not met undoes all service.
    pub restarts: bool,
}

impl Service {
    /// The services of every task of a valid scenario.
    #[must_use]
    pub(crate) fn of_tasks(scenario: &Scenario) -> Vec<Self> {
        let of = |task: &Task| Self {
            steps: steps_of(task.service_s, scenario.dt_s),
            restarts: task.service == Interrupted::Restart,
        };
        scenario.tasks.iter().map(of).collect()
    }

    /// Counts a step at whose end the victim's needs are met; returns whether it is rescued with it.
    pub fn serve(self, victim: &mut Victim) -> bool {
        victim.served_steps += 1;
        victim.served_steps >= self.steps
    }

    /// Ends a step in which the victim's needs are not met.
    pub fn interrupt(self, victim: &mut Victim) {
        if self.restarts {
            victim.served_steps = 0;
        }
    }

    /// Whether a victim that is there can have been served for so long.
    #[must_use]
    pub fn may_be(self, victim: &Victim) -> bool {
        victim.served_steps == 0 || victim.served_steps < self.steps
    }

    /// Share of the service that the victim has had, 0 to 1.
    #[must_use]
    pub fn share(self, victim: &Victim) -> f32 {
        victim.served_steps as f32 / self.steps.max(1) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec2;

    fn service(seconds: f64, dt_s: f64, service: Interrupted) -> Service {
        let mut scenario = Scenario { dt_s, ..Scenario::default() };
        (scenario.tasks[1].service_s, scenario.tasks[1].service) = (seconds, service);
        Service::of_tasks(&scenario)[1]
    }

    #[test]
    fn seconds_become_the_steps_in_which_they_are_reached() {
        let steps = |seconds, dt_s| service(seconds, dt_s, Interrupted::Keep).steps;
        for (seconds, dt_s, wanted) in
            [(0.0, 0.1, 0), (0.05, 0.1, 1), (0.1, 0.1, 1), (0.3, 0.1, 3), (0.31, 0.1, 4), (0.7, 0.1, 7)]
        {
            assert_eq!(steps(seconds, dt_s), wanted, "{seconds} s in steps of {dt_s} s");
        }
        assert_eq!(steps(0.1 + 0.2, 0.1), 3, "a sum that rounding makes a little larger");
        assert_eq!(steps(1e6, 0.001), 1_000_000_000);
    }

    #[test]
    fn an_interruption_keeps_or_undoes_what_was_done() {
        for (kind, after) in [(Interrupted::Keep, 2), (Interrupted::Restart, 0)] {
            let service = service(0.3, 0.1, kind);
            let mut victim = Victim::new(0, 1, 0, Vec2::zeros());
            assert!(!service.serve(&mut victim) && !service.serve(&mut victim));
            assert!((service.share(&victim) - 2.0 / 3.0).abs() < 1e-6);
            service.interrupt(&mut victim);
            assert_eq!(victim.served_steps, after);
            let left = (0..5).find(|_| service.serve(&mut victim));
            assert_eq!(left, Some(2 - after));
        }
    }
}
