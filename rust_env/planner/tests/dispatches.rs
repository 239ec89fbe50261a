//! Plans for worlds, beside plain ones that try every order and every set of robots.

use innerattn_planner::coalition::Candidates;
use innerattn_planner::dispatch::{Aim, Goal, dispatch};
use innerattn_planner::moment::{Moment, Needs, Sums, Team, Victim};
use innerattn_planner::ways::{Battery, Depot, Mover, Stand, Station, Ways};
use proptest::prelude::*;

/// A case as it is written down: needs are amounts by ability, and `is_list` says what they are.
#[derive(Debug, Clone)]
struct Case {
    amounts: Vec<Vec<f64>>,
    wanted: Vec<(bool, Vec<f64>)>,
    ways: Ways,
    moment: Moment,
    aim: Aim,
}

impl Case {
    fn team(&self) -> Team {
        let has = |(ability, amount): (usize, &f64)| u32::from(*amount > 0.0) << ability;
        let skills: Vec<u32> = self.amounts.iter().map(|row| row.iter().enumerate().map(has).sum()).collect();
        let needs = self.wanted.iter().map(|(is_list, amounts)| {
            let list: Vec<u8> = (0..3).flat_map(|need| vec![need as u8; amounts[need] as usize]).collect();
            let sums = || Needs::Sums(Sums::new(amounts, &self.amounts));
            if *is_list { Needs::List(Candidates::new(&list, &skills)) } else { sums() }
        });
        Team { ways: self.ways.clone(), needs: needs.collect() }
    }

    /// Whether robots can fill a list of needs, each one of them: tried in all ways.
    fn can_fill(&self, robots: &[usize], left: &[f64]) -> bool {
        let Some((robot, rest)) = robots.split_first() else { return left.iter().all(|count| *count < 0.5) };
        (0..3).any(|need| {
            let mut fewer = left.to_vec();
            fewer[need] -= 1.0;
            left[need] > 0.5 && self.amounts[*robot][need] > 0.0 && self.can_fill(rest, &fewer)
        })
    }

    fn reach(&self, robots: &[usize], wanted: &[f64]) -> bool {
        let sum = |need: usize| robots.iter().map(|robot| self.amounts[*robot][need]).sum::<f64>();
        (0..3).all(|need| sum(need) >= wanted[need] * (1.0 - 1e-9))
    }

    /// Who goes to a victim of a kind, from the robots' arrivals; and when they are there.
    fn coalition(&self, kind: usize, arrivals: &[f64], ready: f64, near: bool) -> (f64, Vec<usize>) {
        let (is_list, wanted) = &self.wanted[kind];
        if !is_list {
            let gives =
                |robot: &usize| (0..3).any(|need| wanted[need] > 0.0 && self.amounts[*robot][need] > 0.0);
            let mut order: Vec<usize> =
                (0..arrivals.len()).filter(gives).filter(|r| arrivals[*r] < 1e9).collect();
            order.sort_by(|a, b| arrivals[*a].max(ready).total_cmp(&arrivals[*b].max(ready)));
            let Some(count) = (0..=order.len()).find(|count| self.reach(&order[..*count], wanted)) else {
                return (f64::INFINITY, vec![]);
            };
            order.truncate(count);
            for index in (0..count).rev() {
                let without: Vec<usize> =
                    (0..order.len()).filter(|place| *place != index).map(|place| order[place]).collect();
                if self.reach(&without, wanted) {
                    order = without;
                }
            }
            return (order.iter().fold(0.0, |last, robot| arrivals[*robot].max(ready).max(last)), order);
        }
        let robots =
            |mask: u32| (0..arrivals.len()).filter(move |robot| mask >> robot & 1 == 1).collect::<Vec<_>>();
        let key = |chosen: &[usize]| {
            let start = chosen.iter().fold(0.0, |last, robot| arrivals[*robot].max(ready).max(last));
            let rank = |robot: &usize| if near { arrivals[*robot] } else { -arrivals[*robot] };
            let mut ranks: Vec<(f64, usize)> = chosen.iter().map(|robot| (rank(robot), *robot)).collect();
            ranks.sort_by(|a, b| a.partial_cmp(b).unwrap());
            (start, ranks)
        };
        (0_u32..1 << arrivals.len())
            .map(robots)
            .filter(|chosen| self.can_fill(chosen, wanted))
            .map(|chosen| (key(&chosen), chosen))
            .min_by(|a, b| a.0.partial_cmp(&b.0).unwrap())
            .map_or((f64::INFINITY, vec![]), |((start, _), chosen)| (start, chosen))
    }

    fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    fn length(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        if self.ways.along_axes { (a[0] - b[0]).abs() + (a[1] - b[1]).abs() } else { Self::distance(a, b) }
    }

    fn nearest<'a, T>(
        &self,
        among: &'a [T],
        from: [f64; 2],
        place: impl Fn(&T) -> [f64; 2],
    ) -> Option<&'a T> {
        let order =
            |a: &&T, b: &&T| self.length(from, place(a)).partial_cmp(&self.length(from, place(b))).unwrap();
        among.iter().min_by(order)
    }

    fn station(&self, from: [f64; 2]) -> Option<&Station> {
        self.nearest(&self.ways.stations, from, |station| station.place)
    }

    fn drive(&self, robot: usize, gap: f64) -> f64 {
        let mover = &self.ways.movers[robot];
        if gap > 0.0 { gap / mover.speed + mover.lag } else { 0.0 }
    }

    /// Arrival, what is left of charge and load, and whether a station or depot comes first.
    fn leg(&self, robot: usize, stand: &Stand, victim: usize, moved: bool) -> (f64, f64, u32, bool) {
        let to = self.moment.victims[victim].place;
        let radius = self.ways.radius;
        let gap = Self::distance(stand.place, to) - radius;
        let direct = if moved { self.drive(robot, gap) } else { self.moment.arrivals[victim][robot] };
        let Some(most) = self.ways.movers[robot].load else {
            let (arrival, charge, stops) = self.way(robot, stand, to, direct);
            return (arrival, charge, stand.load, stops);
        };
        if stand.load > 0 {
            let (arrival, charge, stops) = self.way(robot, stand, to, direct);
            return (arrival, charge, stand.load, stops);
        }
        let Some(depot) = self.nearest(&self.ways.depots, stand.place, |depot| depot.place) else {
            return (f64::INFINITY, 0.0, 0, true);
        };
        let there = self.drive(robot, Self::distance(stand.place, depot.place) - depot.radius);
        let (free, charge, _) = self.way(robot, stand, depot.place, there);
        let full = Stand { place: depot.place, free, charge, load: most };
        let onward = self.drive(robot, Self::distance(depot.place, to) - radius);
        let (arrival, charge, _) = self.way(robot, &full, to, onward);
        (arrival, charge, most, true)
    }

    /// Arrival, charge left, and whether a station comes first.
    fn way(&self, robot: usize, stand: &Stand, to: [f64; 2], direct: f64) -> (f64, f64, bool) {
        let Some(battery) = &self.ways.movers[robot].battery else {
            return (stand.free + direct, stand.charge, false);
        };
        let used = |a, b| battery.start + battery.per_m * self.length(a, b);
        let back = self.station(to).map_or(0.0, |station| used(to, station.place));
        let lasts = stand.charge > 0.0 && stand.charge >= used(stand.place, to) + back;
        let at = self.station(stand.place);
        let here = at.is_some_and(|station| Self::distance(stand.place, station.place) <= station.radius);
        let net = at.map_or(0.0, |station| station.power - battery.idle);
        if lasts && !(here && net > 0.0 && stand.charge < 0.95 * battery.capacity) {
            return (stand.free + direct, stand.charge - used(stand.place, to), false);
        }
        let never = (f64::INFINITY, 0.0, true);
        let Some(station) = at else { return never };
        let held = stand.charge - if here { 0.0 } else { used(stand.place, station.place) };
        if held < 0.0 || net <= 0.0 || used(station.place, to) + back > battery.capacity {
            return never;
        }
        let there = self.drive(robot, Self::distance(stand.place, station.place) - station.radius);
        let onward = self.drive(robot, Self::distance(station.place, to) - self.ways.radius);
        let arrival = stand.free + there + (battery.capacity - held) / net + onward;
        (arrival, battery.capacity - used(station.place, to), true)
    }

    /// Cost and first goals of one order.
    fn plan(&self, order: &[usize], near: bool) -> (f64, Vec<Goal>) {
        let (robots, victims) = (self.moment.stands.len(), &self.moment.victims);
        let mut stands = self.moment.stands.clone();
        let mut goals = vec![Goal::Free; robots];
        let mut gone: Vec<Option<f64>> = vec![None; victims.len()];
        let (mut sum, mut last, mut missed, mut driven) = (0.0, 0.0_f64, 0.0, 0.0);
        let mut queue: Vec<usize> = order.iter().rev().copied().collect();
        while let Some(victim) = queue.pop() {
            if gone[victim].is_some() {
                continue;
            }
            let before: Vec<usize> =
                (0..victims.len()).filter(|o| victims[victim].after >> o & 1 == 1).collect();
            if let Some(open) = before.iter().find(|other| gone[**other].is_none()) {
                queue.extend([victim, *open]);
                continue;
            }
            let ready = before.iter().map(|other| gone[*other].unwrap()).fold(0.0, f64::max);
            let legs: Vec<(f64, f64, u32, bool)> = (0..robots)
                .map(|robot| self.leg(robot, &stands[robot], victim, goals[robot] != Goal::Free))
                .collect();
            let arrivals: Vec<f64> = legs.iter().map(|leg| leg.0).collect();
            let (start, chosen) = self.coalition(victims[victim].kind, &arrivals, ready, near);
            let done = start + victims[victim].work;
            if done.is_infinite() || done > victims[victim].left + 1e-6 {
                gone[victim] = Some(victims[victim].left.min(1e6));
                missed += 1e6;
                continue;
            }
            gone[victim] = Some(done);
            sum += done;
            last = last.max(done);
            for robot in chosen {
                let (arrival, charge, load, stops) = legs[robot];
                driven += arrival - stands[robot].free;
                if goals[robot] == Goal::Free {
                    goals[robot] = if stops { Goal::Stop } else { Goal::Victim(victim) };
                }
                stands[robot] =
                    Stand { place: victims[victim].place, free: done, charge, load: load.max(1) - 1 };
            }
        }
        (missed + self.aim.sum * sum + self.aim.last * last + 0.01 * driven, goals)
    }

    /// The least cost of all orders.
    fn least(&self) -> f64 {
        let all: Vec<usize> = (0..self.moment.victims.len()).collect();
        let plans =
            orders(&all).into_iter().flat_map(|order| [false, true].map(|near| self.plan(&order, near).0));
        plans.fold(f64::INFINITY, f64::min)
    }

    /// Whether some order, of all, has these goals at this cost.
    fn is_plan(&self, goals: &[Goal], cost: f64) -> bool {
        let all: Vec<usize> = (0..self.moment.victims.len()).collect();
        orders(&all)
            .iter()
            .flat_map(|order| [false, true].map(|near| self.plan(order, near)))
            .any(|(found, its)| (found - cost).abs() <= 1e-9 * cost.abs().max(1.0) && its == goals)
    }
}

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

fn place() -> impl Strategy<Value = [f64; 2]> {
    [-1.0..1.0, -1.0..1.0]
}

fn needs() -> impl Strategy<Value = (bool, Vec<f64>)> {
    let list = prop::collection::vec(0_u8..3, 3)
        .prop_map(|counts| (true, counts.into_iter().map(f64::from).collect()));
    let sums = prop::collection::vec(0.0..2.5, 3).prop_map(|amounts| (false, amounts));
    prop_oneof![list, sums].prop_filter("something is needed", |(_, wanted)| wanted.iter().sum::<f64>() > 0.0)
}

fn case(victims: std::ops::Range<usize>) -> impl Strategy<Value = Case> {
    let battery = (5.0..40.0, 0.0..10.0, 0.0..1.0, 0.0..2.0);
    let battery = battery.prop_map(|(capacity, per_m, start, idle)| Battery { capacity, per_m, start, idle });
    let drive = (0.3..2.0, 0.0..0.3, place());
    let left = (0.0..1.0, prop::option::of(1_u32..3), 0_u32..3);
    let robot = (drive, prop::option::of(battery), left).prop_map(
        |((speed, lag, place), battery, (share, most, load))| {
            let charge = share * battery.as_ref().map_or(0.0, |one| one.capacity);
            let stand = Stand { place, free: 0.0, charge, load: load.min(most.unwrap_or(0)) };
            (Mover { speed, lag, battery, load: most }, stand)
        },
    );
    let amounts = prop::collection::vec(prop_oneof![Just(0.0), 0.3..2.0], 3);
    let robots = prop::collection::vec((robot, amounts), 2..5);
    let station = (place(), 0.05..0.4, 1.0..20.0);
    let station = station.prop_map(|(place, radius, power)| Station { place, radius, power });
    let left = prop_oneof![Just(f64::INFINITY), 0.5..6.0];
    let times = (prop_oneof![Just(0.0), 0.0..1.0], left);
    let victim = (0_usize..2, place(), times, 0_u32..8).prop_map(|(kind, place, (work, left), after)| {
        let after = if after < 4 { after } else { 0 };
        Victim { kind, place, work, left, after }
    });
    let victim = (victim, prop::collection::vec(0.0..3.0, 4));
    let depot = (place(), 0.05..0.4).prop_map(|(place, radius)| Depot { place, radius });
    let stops = (prop::collection::vec(station, 0..3), prop::collection::vec(depot, 0..3));
    let world = (prop::collection::vec(victim, victims), stops);
    (robots, prop::collection::vec(needs(), 2), world, any::<bool>(), 0.0..1.0).prop_map(
        |(robots, wanted, (found, (stations, depots)), along_axes, last)| {
            let count = robots.len();
            let (moved, amounts): (Vec<(Mover, Stand)>, Vec<Vec<f64>>) = robots.into_iter().unzip();
            let (movers, stands) = moved.into_iter().unzip();
            let (mut victims, arrivals): (Vec<Victim>, Vec<Vec<f64>>) = found.into_iter().unzip();
            for (index, victim) in victims.iter_mut().enumerate() {
                victim.after &= (1 << index) - 1; // only earlier ones
            }
            let moment = Moment {
                stands,
                victims,
                arrivals: arrivals.into_iter().map(|times| times[..count].to_vec()).collect(),
            };
            let ways = Ways { movers, stations, depots, radius: 0.15, along_axes };
            Case { amounts, wanted, ways, moment, aim: Aim { sum: 1.0, last } }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn few_victims_get_the_best_plan_of_all_orders(case in case(1..5)) {
        prop_assert!(case.moment.is_ordered());
        let found = dispatch(&case.team(), &case.moment, case.aim, 1000);
        prop_assert!((found.cost - case.least()).abs() <= 1e-9 * found.cost.max(1.0));
        prop_assert!(case.is_plan(&found.goals, found.cost));
    }

    #[test]
    fn many_get_a_plan_that_no_more_orders_make_worse(case in case(5..7)) {
        let costs = [1, 10, 1000].map(|orders| {
            let found = dispatch(&case.team(), &case.moment, case.aim, orders);
            prop_assert!(case.is_plan(&found.goals, found.cost));
            Ok(found.cost)
        });
        let [one, ten, many] = costs;
        let (one, ten, many) = (one?, ten?, many?);
        prop_assert!(case.least() <= many + 1e-9 * many && many <= ten && ten <= one);
    }
}

#[test]
fn nobody_is_needed_where_no_victim_is() {
    let mover = Mover { speed: 1.0, lag: 0.0, battery: None, load: None };
    let ways = Ways { movers: vec![mover], stations: vec![], depots: vec![], radius: 0.1, along_axes: false };
    let team = Team { ways, needs: vec![] };
    let stands = vec![Stand { place: [0.0; 2], free: 0.0, charge: 0.0, load: 0 }];
    let moment = Moment { stands, ..Moment::default() };
    let found = dispatch(&team, &moment, Aim { sum: 1.0, last: 0.0 }, 1);
    assert_eq!((found.goals, found.cost.to_bits()), (vec![Goal::Free], 0));
}

#[test]
fn victims_in_a_circle_are_not_ordered() {
    let victim = |after| Victim { kind: 0, place: [0.0; 2], work: 0.0, left: f64::INFINITY, after };
    let is_ordered =
        |after: [u32; 3]| Moment { victims: after.map(victim).to_vec(), ..Moment::default() }.is_ordered();
    assert!(is_ordered([0b110, 0b100, 0]));
    assert!(!is_ordered([0b010, 0b100, 0b001]));
    assert!(!is_ordered([0, 0b010, 0]), "one that waits for itself");
}
