//! Which robots work on a task together: a distinct one for each need.

use crate::instance::{Group, Instance, MAX_ROBOTS, Robot, Task};

/// Robots and the needs that they fill. Sets of robots that can fill needs at the same time form a matroid
/// (Edmonds & Fulkerson 1965), so taking robots one by one, the best first, gives the best coalition.
struct Matching<'a> {
    task: &'a Task,
    robots: &'a [Robot],
    /// For each need, the robot that fills it.
    by: Vec<Option<usize>>,
}

impl<'a> Matching<'a> {
    fn new(task: &'a Task, robots: &'a [Robot]) -> Self {
        Self { task, robots, by: vec![None; task.needs.len()] }
    }

    /// Takes a robot, if all that were taken can still fill needs. Returns whether it did.
    fn take(&mut self, robot: usize) -> bool {
        self.place(robot, &mut 0)
    }

    /// Finds a need for a robot along an augmenting path (Kuhn).
    fn place(&mut self, robot: usize, tried: &mut u64) -> bool {
        for need in 0..self.by.len() {
            if self.robots[robot].skills >> self.task.needs[need] & 1 == 0 || *tried >> need & 1 == 1 {
                continue;
            }
            *tried |= 1 << need;
            if self.by[need].is_none_or(|other| self.place(other, tried)) {
                self.by[need] = Some(robot);
                return true;
            }
        }
        false
    }

    fn is_full(&self) -> bool {
        self.by.iter().all(Option::is_some)
    }

    fn mask(&self) -> u64 {
        self.by.iter().flatten().fold(0, |mask, robot| mask | 1 << robot)
    }
}

/// Whether these distinct robots can fill all needs of a task.
#[must_use]
pub fn fills(task: &Task, robots: &[Robot], chosen: &[usize]) -> bool {
    let mut matching = Matching::new(task, robots);
    for robot in chosen {
        matching.take(*robot);
    }
    matching.is_full()
}

/// The coalition of the first robots in a list that can fill all needs of a task, as a mask.
#[must_use]
pub fn first_of(task: &Task, robots: &[Robot], list: &[usize]) -> u64 {
    let mut matching = Matching::new(task, robots);
    for robot in list {
        matching.take(*robot);
    }
    matching.mask()
}

/// What the robots that can fill needs of a task offer, in the order of `Instance::able`.
#[derive(Debug)]
pub struct Offers {
    /// When they could be there.
    pub arrivals: [f64; MAX_ROBOTS],
    /// The larger, the rather a robot goes that comes in time; equals by their order.
    pub ranks: [f64; MAX_ROBOTS],
}

/// The coalition that can begin soonest, and of those the one whose ranks are best, as a mask.
///
/// Returns the time of the beginning with it.
#[must_use]
pub fn soonest(instance: &Instance, task: usize, offers: &Offers) -> (f64, u64) {
    let (able, groups) = (&instance.able[task], &instance.groups[task]);
    if groups.is_empty() {
        return soonest_of_any(&instance.tasks[task], &instance.robots, able, offers);
    }
    soonest_apart(groups, able, offers)
}

/// As [`soonest`], where each robot can fill needs of one skill at most.
fn soonest_apart(groups: &[Group], able: &[u8], offers: &Offers) -> (f64, u64) {
    let mut start = 0.0_f64;
    for group in groups {
        let mut taken = 0_u64;
        for _ in 0..group.count {
            let (place, arrival) = least(group, taken, |place| offers.arrivals[place]);
            taken |= 1 << place;
            start = start.max(arrival);
        }
    }
    let in_time = |place: usize| offers.arrivals[place] <= start;
    let cost = |place: usize| if in_time(place) { -offers.ranks[place] } else { f64::INFINITY };
    let (mut taken, mut mask) = (0_u64, 0_u64);
    for group in groups {
        for _ in 0..group.count {
            let (place, _) = least(group, taken, cost);
            taken |= 1 << place;
            mask |= 1 << able[place];
        }
    }
    (start, mask)
}

/// The place in a group, not among `taken`, with the least value, and this value; the first of equals.
fn least(group: &Group, taken: u64, value: impl Fn(usize) -> f64) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for place in group.places.clone() {
        let found = if taken >> place & 1 == 1 { f64::INFINITY } else { value(place) };
        best = if found < best.1 { (place, found) } else { best };
    }
    best
}

/// As [`soonest`], whatever robots can do.
fn soonest_of_any(task: &Task, robots: &[Robot], able: &[u8], offers: &Offers) -> (f64, u64) {
    let mut places: Vec<usize> = (0..able.len()).collect();
    places.sort_by(|a, b| offers.arrivals[*a].total_cmp(&offers.arrivals[*b]));
    let mut matching = Matching::new(task, robots);
    let mut start = 0.0;
    for place in &places {
        if matching.take(usize::from(able[*place])) {
            start = offers.arrivals[*place];
        }
    }
    places.retain(|place| offers.arrivals[*place] <= start);
    places.sort_unstable();
    places.sort_by(|a, b| offers.ranks[*b].total_cmp(&offers.ranks[*a]));
    let list: Vec<usize> = places.into_iter().map(|place| usize::from(able[place])).collect();
    (start, first_of(task, robots, &list))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Offers, soonest_apart, soonest_of_any};
    use crate::instance::{Instance, MAX_ROBOTS, Robot, Task};

    /// What a robot offers: when it could be there, and its rank.
    fn offer(instance: &Instance, offers: &Offers, robot: usize) -> (f64, f64) {
        let place = instance.able[0].iter().position(|able| usize::from(*able) == robot).unwrap();
        (offers.arrivals[place], offers.ranks[place])
    }

    fn any(instance: &Instance, offers: &Offers) -> (f64, u64) {
        soonest_of_any(&instance.tasks[0], &instance.robots, &instance.able[0], offers)
    }

    /// The best coalition, by trying all: begins soonest, then has the best ranks, the best first.
    fn tried(instance: &Instance, offers: &Offers) -> (f64, u64) {
        let count = instance.tasks[0].needs.len();
        let masks = (0_u64..1 << instance.robots.len()).filter(|mask| mask.count_ones() as usize == count);
        let robots = |mask: u64| (0..64).filter(move |robot| mask >> robot & 1 == 1).collect::<Vec<usize>>();
        let key = |mask: &u64| {
            let chosen = robots(*mask);
            let start = chosen.iter().map(|robot| offer(instance, offers, *robot).0).fold(0.0, f64::max);
            let mut ranks: Vec<(f64, usize)> =
                chosen.iter().map(|r| (-offer(instance, offers, *r).1, *r)).collect();
            ranks.sort_by(|a, b| a.partial_cmp(b).unwrap());
            (start, ranks)
        };
        masks
            .filter(|mask| super::fills(&instance.tasks[0], &instance.robots, &robots(*mask)))
            .map(|mask| (key(&mask), mask))
            .min_by(|a, b| a.0.partial_cmp(&b.0).unwrap())
            .map(|((start, _), mask)| (start, mask))
            .unwrap()
    }

    fn case(skills: impl Strategy<Value = u32>) -> impl Strategy<Value = (Instance, Offers)> {
        let robots = prop::collection::vec(skills, 3..8);
        let numbers = || prop::collection::vec((0_u8..6).prop_map(f64::from), 8);
        let needs = prop::collection::vec(0_u8..3, 1..4);
        (robots, needs, numbers(), numbers()).prop_filter_map(
            "a team that can",
            |(skills, needs, at, rank)| {
                let robots = skills.into_iter().map(|skills| Robot { depot: [0.0; 2], skills }).collect();
                let task = Task { position: [1.0, 0.0], needs, duration: 1.0 };
                let mut offers = Offers { arrivals: [0.0; MAX_ROBOTS], ranks: [0.0; MAX_ROBOTS] };
                offers.arrivals[..8].copy_from_slice(&at);
                offers.ranks[..8].copy_from_slice(&rank);
                Instance::new(1.0, robots, vec![task]).ok().map(|instance| (instance, offers))
            },
        )
    }

    proptest! {
        #[test]
        fn robots_of_several_skills_form_the_best_coalition((instance, offers) in case(0_u32..8)) {
            prop_assert_eq!(any(&instance, &offers), tried(&instance, &offers));
        }

        #[test]
        fn robots_of_one_skill_do_so_on_the_short_way(
            (instance, offers) in case((0_u32..3).prop_map(|skill| 1 << skill))
        ) {
            let found = soonest_apart(&instance.groups[0], &instance.able[0], &offers);
            prop_assert_eq!(found, tried(&instance, &offers));
        }
    }
}
