//! What plans promise, on random instances, beside all schedules that there are.

use innerattn_planner::coalition::fills;
use innerattn_planner::error::Error;
use innerattn_planner::instance::{Instance, Robot, Task};
use innerattn_planner::order::{add, schedule_of};
use innerattn_planner::schedule::{Schedule, simulate};
use innerattn_planner::search::{Limits, Plan, plan};
use innerattn_planner::simple::{greedy_order, random_schedule};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

fn makespan(instance: &Instance, schedule: &Schedule) -> f64 {
    simulate(instance, schedule).unwrap().makespan
}

fn planned(instance: &Instance, seed: u64, evaluations: u64) -> Plan {
    plan(
        instance,
        greedy_order(instance),
        seed,
        Limits { evaluations: Some(evaluations), seconds: None },
        &|| false,
    )
    .unwrap()
}

fn place() -> impl Strategy<Value = [f64; 2]> {
    [-1.0..1.0, -1.0..1.0]
}

/// Instances of up to so many robots and tasks, of three skills; some robots have several.
fn instances(robots: usize, tasks: usize) -> impl Strategy<Value = Instance> {
    let robot = (place(), 0_u32..8).prop_map(|(depot, skills)| Robot { depot, skills });
    let needs = prop::collection::vec(0_u8..3, 1..4);
    let task =
        (place(), needs, 0.0..2.0).prop_map(|(position, needs, duration)| Task { position, needs, duration });
    let team = prop::collection::vec(robot, 1..=robots);
    (0.1..2.0, team, prop::collection::vec(task, 1..=tasks))
        .prop_filter_map("a team that can", |(speed, team, tasks)| Instance::new(speed, team, tasks).ok())
}

/// All orders of some tasks.
fn orders(tasks: &[usize]) -> Vec<Vec<usize>> {
    if tasks.is_empty() {
        return vec![vec![]];
    }
    let first = |index: usize| {
        let mut rest = tasks.to_vec();
        let task = rest.remove(index);
        orders(&rest).into_iter().map(move |order| [vec![task], order].concat())
    };
    (0..tasks.len()).flat_map(first).collect()
}

/// The least makespan of all schedules: every order, and in it every coalition of every task.
fn least(instance: &Instance) -> f64 {
    let tasks: Vec<usize> = (0..instance.tasks.len()).collect();
    let none = vec![vec![]; instance.robots.len()];
    orders(&tasks).iter().map(|order| least_after(instance, order, &none)).fold(f64::INFINITY, f64::min)
}

fn least_after(instance: &Instance, order: &[usize], schedule: &Schedule) -> f64 {
    let Some((task, rest)) = order.split_first() else { return makespan(instance, schedule) };
    let skills: Vec<u32> = instance.robots.iter().map(|robot| robot.skills).collect();
    let mut best = f64::INFINITY;
    for mask in 0_u64..1 << instance.robots.len() {
        let chosen: Vec<usize> = (0..64).filter(|robot| mask >> robot & 1 == 1).collect();
        let wanted = &instance.tasks[*task];
        if chosen.len() == wanted.needs.len() && fills(&wanted.needs, &skills, &chosen) {
            let mut more = schedule.clone();
            add(&mut more, mask, *task);
            best = best.min(least_after(instance, rest, &more));
        }
    }
    best
}

proptest! {
    #[test]
    fn no_plan_is_shorter_than_the_shortest(instance in instances(5, 3)) {
        prop_assert!(makespan(&instance, &planned(&instance, 1, 200).schedule) >= least(&instance) - 1e-12);
    }

    #[test]
    fn a_search_is_no_longer_than_the_order_that_it_begins_with(instance in instances(5, 5), seed in 0_u64..9) {
        let mut order: Vec<usize> = (0..instance.tasks.len()).collect();
        order.rotate_left(seed as usize % instance.tasks.len());
        let limits = Limits { evaluations: Some(30), seconds: None };
        let found = plan(&instance, order.clone(), seed, limits, &|| false).unwrap();
        let begun = makespan(&instance, &schedule_of(&instance, &order));
        prop_assert!(makespan(&instance, &found.schedule) <= begun);
    }

    #[test]
    fn a_task_alone_is_done_as_soon_as_it_can_be_begun(instance in instances(6, 1)) {
        let begun = |schedule: &Schedule| simulate(&instance, schedule).unwrap().starts[0];
        let found = begun(&planned(&instance, 0, 10).schedule);
        for seed in 0..20 {
            prop_assert!(found <= begun(&random_schedule(&instance, seed)));
        }
    }

    #[test]
    fn a_search_never_loses_what_it_had(instance in instances(8, 12), seed in 0_u64..9) {
        let greedy = makespan(&instance, &schedule_of(&instance, &greedy_order(&instance)));
        let begun = makespan(&instance, &planned(&instance, seed, 0).schedule);
        prop_assert_eq!(begun.to_bits(), greedy.to_bits());
        let found = planned(&instance, seed, 300);
        prop_assert!(makespan(&instance, &found.schedule) <= greedy);
        prop_assert_eq!(found.evaluations, 300);
        prop_assert_eq!(&found, &planned(&instance, seed, 300));
    }

    #[test]
    fn random_schedules_can_be_played(instance in instances(8, 12), seed in 0_u64..99) {
        prop_assert!(simulate(&instance, &random_schedule(&instance, seed)).is_ok());
    }
}

/// A plan is an order of the tasks; each has the robots that can begin soonest. So robots may be missing elsewhere, and
/// a single plan may take longer than this.
#[test]
fn plans_are_nearly_the_shortest_on_average() {
    let mut runner = TestRunner::deterministic();
    let beside_the_least = |_| {
        let instance = instances(5, 3).new_tree(&mut runner).unwrap().current();
        makespan(&instance, &planned(&instance, 1, 200).schedule) / least(&instance)
    };
    let ratios: Vec<f64> = (0..300).map(beside_the_least).collect();
    let mean = ratios.iter().sum::<f64>() / 300.0;
    assert!(mean < 1.02, "{mean}");
    assert!(ratios.iter().filter(|ratio| **ratio < 1.001).count() > 270);
}

/// Two robots of one skill each, and two tasks that need both.
fn meeting() -> Instance {
    let robot = |x: f64, skills: u32| Robot { depot: [x, 0.0], skills };
    let task = |x: f64| Task { position: [x, 0.0], needs: vec![0, 1], duration: 1.0 };
    Instance::new(1.0, vec![robot(0.0, 1), robot(3.0, 2)], vec![task(1.0), task(2.0)]).unwrap()
}

#[test]
fn a_schedule_is_played_by_hand() {
    let outcome = simulate(&meeting(), &vec![vec![0, 1], vec![0, 1]]).unwrap();
    assert_eq!(outcome.starts, [2.0, 4.0]);
    assert_eq!(outcome.returns, [7.0, 6.0]);
    assert_eq!(outcome.makespan.to_bits(), 7.0_f64.to_bits());
}

#[test]
fn what_no_team_could_do_is_refused() {
    let refused = |schedule: Schedule| simulate(&meeting(), &schedule).unwrap_err().to_string();
    assert_eq!(
        refused(vec![vec![0, 1], vec![1, 0]]),
        "schedule: deadlock: robot 0 waits at task 0, robot 1 waits at task 1"
    );
    assert_eq!(
        refused(vec![vec![0, 1], vec![0]]),
        "schedule: robots [0] go to task 1: must fill its needs [0, 1]"
    );
    assert_eq!(refused(vec![vec![0, 2], vec![]]), "schedule: robot 0 goes to task 2: must be 0 to 1");
    assert_eq!(refused(vec![vec![0, 1, 0], vec![0, 1]]), "schedule: robot 0 goes to task 0 twice");
    assert_eq!(refused(vec![vec![0, 1]]), "schedule: has 1 robots: must have 2");
}

#[test]
fn a_search_ends_when_it_is_told() {
    let limits = |evaluations, seconds| Limits { evaluations, seconds };
    let ended = |limits, stop: bool| plan(&meeting(), vec![0, 1], 0, limits, &|| stop);
    assert_eq!(ended(limits(None, Some(60.0)), true), Err(Error::Interrupted));
    assert_eq!(ended(limits(None, Some(0.0)), false).unwrap().evaluations, 0);
    assert!(ended(limits(None, Some(0.02)), false).unwrap().evaluations > 100);
    assert!(ended(limits(Some(u64::MAX), Some(0.02)), false).is_ok());
    let told = |limits| ended(limits, false).unwrap_err().to_string();
    assert_eq!(told(limits(None, None)), "seconds = none: must be given where no number of evaluations is");
    assert_eq!(told(limits(None, Some(f64::NAN))), "seconds = NaN: must be 0.0 to 1e6");
    assert_eq!(told(limits(Some(9), Some(-1.0))), "seconds = -1.0: must be 0.0 to 1e6");
}

#[test]
fn what_takes_no_time_is_planned_for() {
    let robots = vec![Robot { depot: [0.0; 2], skills: 1 }; 2];
    let tasks = vec![Task { position: [0.0; 2], needs: vec![0], duration: 0.0 }; 3];
    let found = planned(&Instance::new(1.0, robots, tasks.clone()).unwrap(), 0, 50);
    assert_eq!(found.evaluations, 50);
    let alone = Instance::new(1.0, vec![Robot { depot: [3.0, 4.0], skills: 1 }], tasks).unwrap();
    let outcome = simulate(&alone, &planned(&alone, 0, 50).schedule).unwrap();
    assert_eq!((outcome.starts, outcome.returns), (vec![5.0; 3], vec![10.0]));
}

#[test]
fn instances_that_are_none_are_refused() {
    let robot = |skills: u32| Robot { depot: [0.0; 2], skills };
    let task = |needs: &[u8]| Task { position: [0.0; 2], needs: needs.to_vec(), duration: 1.0 };
    let refused = |speed: f64, robots: Vec<Robot>, tasks: Vec<Task>| {
        Instance::new(speed, robots, tasks).unwrap_err().to_string()
    };
    let two = || vec![robot(1), robot(3)];
    let cases = [
        (refused(0.0, two(), vec![task(&[0])]), "speed = 0.0: must be 1e-6 to 1000000.0"),
        (refused(f64::NAN, two(), vec![task(&[0])]), "speed = NaN: must be"),
        (refused(1.0, vec![], vec![task(&[0])]), "number of robots = 0: must be 1 to 64"),
        (refused(1.0, two(), vec![]), "number of tasks = 0: must be 1 to 500"),
        (refused(1.0, two(), vec![task(&[])]), "tasks[0].skills = []: must be 1 to 2 skills"),
        (refused(1.0, two(), vec![task(&[0]), task(&[2])]), "tasks[1].skills = [2]: no robot has skill 2"),
        (refused(1.0, two(), vec![task(&[1, 1])]), "tasks[0].skills = [1, 1]: the team has not enough"),
        (refused(1.0, two(), vec![task(&[40])]), "tasks[0].skills = [40]: skill 40 must be 0 to 31"),
    ];
    for (found, told) in cases {
        assert!(found.starts_with(told), "{found}");
    }
}
