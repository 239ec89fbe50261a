use innerattn_env::reward::{Component, Happened};
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{MAX_HELPERS, Scenario};
use innerattn_env::tasks::Rescue;

const TEAMWORK: Component = Component {
    name: "teamwork",
    meaning: "0.1 for each other helper, for each rescue that the robot helped with",
    value: |_weights, happened, robot| {
        let mut others = 0;
        for rescue in happened.rescues {
            let helpers: Vec<u8> = rescue.helpers.iter().flatten().copied().collect();
            if helpers.contains(&(robot as u8)) {
                others += helpers.len() - 1;
            }
        }
        0.1 * others as f32
    },
};

#[test]
fn helpers_are_paid_for_each_other() {
    let rules = Rules::new(Scenario::default()).expect("a valid scenario");
    let mut helpers = [None; MAX_HELPERS];
    (helpers[0], helpers[1]) = (Some(1), Some(3));
    let rescue = Rescue { env: 0, episode: 0, step: 7, slot: 0, victim: 2, task: 0, helpers };
    let happened = Happened {
        rescues: &[rescue],
        losses: &[],
        distance_before: 2.0,
        distance_after: 1.5,
        touched: 0b0000,
        effort: &[1.0, 0.0, 1.0, 1.0],
    };
    let paid = [0, 1, 2, 3].map(|robot| (TEAMWORK.value)(&rules.weights, &happened, robot));
    assert_eq!(paid.map(f32::to_bits), [0.0, 0.1, 0.0, 0.1].map(f32::to_bits));
}
