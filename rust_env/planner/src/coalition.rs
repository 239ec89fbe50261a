//! Which robots work on a task together: a distinct one for each need.

use std::ops::Range;

use crate::instance::{MAX_ROBOTS, MAX_SKILLS};

/// Robots and the needs that they fill. Sets of robots that can fill needs at the same time form a matroid
/// (Edmonds & Fulkerson 1965), so taking robots one by one, the best first, gives the best coalition.
struct Matching<'a> {
    /// A skill for each robot that is needed.
    needs: &'a [u8],
    /// For each robot, the mask of its skills.
    skills: &'a [u32],
    /// For each need, the robot that fills it.
    by: Vec<Option<usize>>,
}

impl<'a> Matching<'a> {
    fn new(needs: &'a [u8], skills: &'a [u32]) -> Self {
        Self { needs, skills, by: vec![None; needs.len()] }
    }

    /// Takes a robot, if all that were taken can still fill needs. Returns whether it did.
    fn take(&mut self, robot: usize) -> bool {
        self.place(robot, &mut 0)
    }

    /// Finds a need for a robot along an augmenting path (Kuhn).
    fn place(&mut self, robot: usize, tried: &mut u64) -> bool {
        for need in 0..self.by.len() {
            if self.skills[robot] >> self.needs[need] & 1 == 0 || *tried >> need & 1 == 1 {
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

    /// The robots that were taken.
    fn taken(&self) -> impl Iterator<Item = usize> {
        self.by.iter().flatten().copied()
    }
}

/// Whether these distinct robots, of a team with such skills, can fill all needs of a task.
#[must_use]
pub fn fills(needs: &[u8], skills: &[u32], chosen: &[usize]) -> bool {
    let mut matching = Matching::new(needs, skills);
    for robot in chosen {
        matching.take(*robot);
    }
    matching.is_full()
}

/// The coalition of the first robots in a list that can fill all needs of a task, as a mask.
#[must_use]
pub fn first_of(needs: &[u8], skills: &[u32], list: &[usize]) -> u64 {
    let mut matching = Matching::new(needs, skills);
    for robot in list {
        matching.take(*robot);
    }
    matching.taken().fold(0, |mask, robot| mask | 1 << robot)
}

/// Robots that can fill the needs of one skill of a task, and how many of them it needs.
#[derive(Debug, Clone, PartialEq)]
struct Group {
    /// Their places among the candidates.
    places: Range<usize>,
    count: usize,
}

/// What a task needs, and the robots of a team that can fill any of its needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// A skill for each robot that is needed.
    needs: Vec<u8>,
    /// The robots, by number, or group by group.
    robots: Vec<u8>,
    /// For each of them, the mask of its skills.
    skills: Vec<u32>,
    /// The needs by skill; none where a robot can fill needs of two skills.
    groups: Vec<Group>,
}

impl Candidates {
    /// Those of a team with such skills.
    #[must_use]
    pub fn new(needs: &[u8], skills: &[u32]) -> Self {
        let with =
            |mask: u32| (0..skills.len() as u8).filter(move |robot| skills[usize::from(*robot)] & mask != 0);
        let needed = needs.iter().fold(0, |mask, skill| mask | 1 << skill);
        let (mut robots, mut groups) = (vec![], vec![]);
        if with(needed).any(|robot| (skills[usize::from(robot)] & needed).count_ones() > 1) {
            robots.extend(with(needed));
        } else {
            for skill in (0..MAX_SKILLS as u8).filter(|skill| needed >> skill & 1 == 1) {
                let first = robots.len();
                robots.extend(with(1 << skill));
                let count = needs.iter().map(|need| usize::from(*need == skill)).sum();
                groups.push(Group { places: first..robots.len(), count });
            }
        }
        let skills = robots.iter().map(|robot| skills[usize::from(*robot)]).collect();
        Self { needs: needs.to_vec(), robots, skills, groups }
    }

    /// The robots that can fill any need, in the order of [`Offers`].
    #[must_use]
    pub fn robots(&self) -> &[u8] {
        &self.robots
    }

    /// The coalition that can begin soonest, and of those the one whose ranks are best, as a mask.
    ///
    /// Returns the time of the beginning with it; it is infinite where not enough robots ever come.
    #[must_use]
    pub fn soonest(&self, offers: &Offers) -> (f64, u64) {
        if self.groups.is_empty() { self.soonest_of_any(offers) } else { self.soonest_apart(offers) }
    }

    /// As [`Self::soonest`], where each robot can fill needs of one skill at most.
    fn soonest_apart(&self, offers: &Offers) -> (f64, u64) {
        let mut start = 0.0_f64;
        for group in &self.groups {
            let mut taken = 0_u64;
            for _ in 0..group.count {
                let (place, arrival) = least(group, taken, |place| offers.arrivals[place]);
                taken |= 1 << place;
                start = start.max(arrival);
            }
        }
        if start.is_infinite() {
            return (start, 0);
        }
        let in_time = |place: usize| offers.arrivals[place] <= start;
        let cost = |place: usize| if in_time(place) { -offers.ranks[place] } else { f64::INFINITY };
        let (mut taken, mut mask) = (0_u64, 0_u64);
        for group in &self.groups {
            for _ in 0..group.count {
                let (place, _) = least(group, taken, cost);
                taken |= 1 << place;
                mask |= 1 << self.robots[place];
            }
        }
        (start, mask)
    }

    /// As [`Self::soonest`], whatever robots can do.
    fn soonest_of_any(&self, offers: &Offers) -> (f64, u64) {
        let mut places: Vec<usize> = (0..self.robots.len()).collect();
        places.sort_by(|a, b| offers.arrivals[*a].total_cmp(&offers.arrivals[*b]));
        let mut matching = Matching::new(&self.needs, &self.skills);
        let mut start = 0.0;
        for place in &places {
            if matching.take(*place) {
                start = offers.arrivals[*place];
            }
        }
        if !matching.is_full() {
            return (f64::INFINITY, 0);
        }
        places.retain(|place| offers.arrivals[*place] <= start);
        places.sort_unstable();
        places.sort_by(|a, b| offers.ranks[*b].total_cmp(&offers.ranks[*a]));
        let mut matching = Matching::new(&self.needs, &self.skills);
        for place in places {
            matching.take(place);
        }
        (start, matching.taken().fold(0, |mask, place| mask | 1 << self.robots[place]))
    }
}

/// What the robots that can fill needs of a task offer, in the order of [`Candidates::robots`].
#[derive(Debug)]
pub struct Offers {
    /// When they could be there.
    pub arrivals: [f64; MAX_ROBOTS],
    /// The larger, the rather a robot goes that comes in time; equals by their order.
    pub ranks: [f64; MAX_ROBOTS],
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Offers;
    use crate::instance::{Instance, MAX_ROBOTS, Robot, Task};

    /// What a robot offers: when it could be there, and its rank.
    fn offer(instance: &Instance, offers: &Offers, robot: usize) -> (f64, f64) {
        let place =
            instance.candidates[0].robots().iter().position(|able| usize::from(*able) == robot).unwrap();
        (offers.arrivals[place], offers.ranks[place])
    }

    /// The best coalition, by trying all: begins soonest, then has the best ranks, the best first.
    fn tried(instance: &Instance, offers: &Offers) -> (f64, u64) {
        let count = instance.tasks[0].needs.len();
        let skills: Vec<u32> = instance.robots.iter().map(|robot| robot.skills).collect();
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
            .filter(|mask| super::fills(&instance.tasks[0].needs, &skills, &robots(*mask)))
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
            prop_assert_eq!(instance.candidates[0].soonest_of_any(&offers), tried(&instance, &offers));
        }

        #[test]
        fn robots_of_one_skill_do_so_on_the_short_way(
            (instance, offers) in case((0_u32..3).prop_map(|skill| 1 << skill))
        ) {
            let found = instance.candidates[0].soonest_apart(&offers);
            prop_assert_eq!(found, tried(&instance, &offers));
        }
    }
}
