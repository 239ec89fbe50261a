//! Whether a fault state read from somewhere could be of a world of these rules at this moment. All that
//! follows from the rest is computed again and compared.

use super::{FaultState, Moment, NUM_STRIKES, freezing, strikes_sometimes};
use crate::fault::{HEALTHY, SPECS};
use crate::rules::Rules;

/// Largest number that a robot may see, in any unit: far above any place, speed and error.
const MOST_SEEN: f32 = 1e6;

impl FaultState {
    /// Whether every number of it is one that a world of these rules may have at this moment.
    #[must_use]
    pub fn fits(&self, rules: &Rules, now: Moment) -> bool {
        self.levels_are_in_range(rules)
            && self.spans_fit(rules, now.step)
            && self.effects_fit(rules, now)
            && self.frozen_rows_fit(rules)
    }

    fn levels_are_in_range(&self, rules: &Rules) -> bool {
        let in_range = |(spec, level): (&crate::fault::Spec, &f32)| {
            let (low, high) = spec.range;
            (low as f32..=high as f32).contains(level)
        };
        (self.levels.is_empty() || self.levels.len() == rules.team.len())
            && self.levels.iter().all(|levels| SPECS.iter().zip(levels).all(in_range))
    }

    fn spans_fit(&self, rules: &Rules, step: u32) -> bool {
        // Each fault is drawn at the start, and at most once in every step.
        let most_words = (u64::from(step) + 1) * rules.faults.len() as u64;
        self.spans.len() == rules.faults.len()
            && self.words <= most_words
            && rules.faults.iter().zip(&self.spans).all(|(fault, span)| {
                let begins = match fault.rate {
                    None => span.from == fault.onset,
                    Some(_) => span.from >= fault.onset,
                };
                begins && span.until == span.from.saturating_add(fault.duration)
            })
    }

    /// Whether what is in effect follows from the spans, unless the caller has set it, and whether what
    /// follows from that is right.
    fn effects_fit(&self, rules: &Rules, now: Moment) -> bool {
        let healthy = self.levels.iter().all(|levels| *levels == HEALTHY);
        let follows = self.set || {
            let (levels, next_change) = self.present(rules, now.step);
            let all_healthy = levels.iter().all(|levels| *levels == HEALTHY);
            next_change == self.next_change && if all_healthy { healthy } else { levels == self.levels }
        };
        let mut again = self.clone();
        again.sample(now);
        let struck = if self.levels.is_empty() { [0; NUM_STRIKES] } else { again.struck };
        follows
            && healthy == self.levels.is_empty()
            && self.intermittent == self.levels.iter().any(strikes_sometimes)
            && self.struck == struck
    }

    /// Whether there is one row for each robot whose sensors are frozen, and no other.
    fn frozen_rows_fit(&self, rules: &Rules) -> bool {
        let wanted = self.levels.iter().filter(|levels| freezing(levels)).count();
        self.frozen.len() == wanted
            && self.frozen.iter().enumerate().all(|(index, (robot, row))| {
                self.levels.get(usize::from(*robot)).is_some_and(freezing)
                    && self.frozen[..index].iter().all(|(other, _)| other != robot)
                    && row.len() == rules.layout.width()
                    && row.iter().all(|number| (-MOST_SEEN..=MOST_SEEN).contains(number))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::{Fault, Kind};
    use crate::scenario::Scenario;

    fn rules(kind: Kind, value: f64) -> Rules {
        let fault = Fault {
            robot: "food_1".into(),
            kind,
            value,
            onset_step: 0,
            onset_rate_hz: None,
            duration_steps: Some(9),
        };
        Rules::new(Scenario { faults: vec![fault], ..Scenario::default() }).expect("a scenario")
    }

    const START: Moment = Moment { seed: 1, stream: 0, episode: 0, step: 0 };

    #[test]
    fn whatever_no_world_of_these_rules_has_does_not_fit() {
        let rules = rules(Kind::FrozenSensor, 0.5);
        let mut good = FaultState::default();
        good.begin(&rules, START);
        good.freeze(&vec![0.5; rules.team.len() * rules.layout.width()]);
        assert!(good.fits(&rules, START));
        assert_eq!(good.frozen.len(), 1);
        let frozen = Kind::FrozenSensor as usize;
        let spoilt: [fn(&mut FaultState); 21] = [
            |faults| faults.levels.truncate(3),
            |faults| faults.levels.clear(),
            |faults| faults.levels[2][0] = f32::NAN,
            |faults| faults.levels[1][Kind::SpeedLimit as usize] = -1.0,
            |faults| faults.levels[1][Kind::SpeedLimit as usize] = 0.5,
            |faults| faults.levels[1][Kind::FrozenSensor as usize] = 0.25,
            |faults| faults.spans.clear(),
            |faults| faults.spans.push(faults.spans[0]),
            |faults| faults.spans[0].from = 1,
            |faults| faults.spans[0].until = 10,
            |faults| faults.next_change = 3,
            |faults| faults.words = 2,
            |faults| faults.intermittent = false,
            |faults| faults.struck[0] ^= 0b10,
            |faults| faults.struck[1] = 1 << 63,
            |faults| faults.frozen.clear(),
            |faults| faults.frozen[0].0 = 4,
            |faults| faults.frozen[0].0 = 2,
            |faults| faults.frozen[0].1.truncate(5),
            |faults| faults.frozen[0].1[3] = f32::INFINITY,
            |faults| faults.frozen.push(faults.frozen[0].clone()),
        ];
        assert!(good.levels[1][frozen] > 0.0);
        for (number, spoil) in spoilt.into_iter().enumerate() {
            let mut faults = good.clone();
            spoil(&mut faults);
            assert!(!faults.fits(&rules, START), "{number}");
        }
    }

    #[test]
    fn what_was_set_need_not_be_the_scenario_s_but_must_be_in_range() {
        let rules = rules(Kind::MotorGain, 0.5);
        let mut faults = FaultState::default();
        faults.begin(&rules, START);
        let mut levels = [HEALTHY; 4];
        levels[3][Kind::SpeedLimit as usize] = 0.25;
        faults.set(&levels, START);
        assert!(faults.fits(&rules, START));
        faults.set(&[HEALTHY; 4], START);
        assert!(faults.fits(&rules, START));
        levels[3][Kind::SpeedLimit as usize] = -1.0;
        faults.set(&levels, START);
        assert!(!faults.fits(&rules, START));
    }
}
