//! How the robots of a world get from place to place: how long it takes, and what it takes from batteries.

/// A place, m.
pub type Place = [f64; 2];

/// Share of its capacity at which a robot leaves a station.
const NEARLY_FULL: f64 = 0.95;

/// How a robot moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Mover {
    /// Its final speed, m/s.
    pub speed: f64,
    /// What a start from rest costs against that speed, s.
    pub lag: f64,
    /// None for a robot that needs no energy.
    pub battery: Option<Battery>,
    /// Rescues that it can help with before it goes to a depot; none for one that always can.
    pub load: Option<u32>,
}

/// What a robot lives on.
#[derive(Debug, Clone, PartialEq)]
pub struct Battery {
    /// Most energy that it holds, J.
    pub capacity: f64,
    /// Energy that each metre is reckoned with, J/m.
    pub per_m: f64,
    /// Energy that each start is reckoned with, J.
    pub start: f64,
    /// Power that is used all the time, W.
    pub idle: f64,
}

/// A place that charges robots.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Its centre, m.
    pub place: Place,
    /// How near to it a robot must be, m.
    pub radius: f64,
    /// Power that each robot there gets, W.
    pub power: f64,
}

/// A place that refills loads.
#[derive(Debug, Clone, PartialEq)]
pub struct Depot {
    /// Its centre, m.
    pub place: Place,
    /// How near to it a robot must be, m.
    pub radius: f64,
}

/// Where a robot is, from when on it is free, and what it has left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// m.
    pub place: Place,
    /// s from now.
    pub free: f64,
    /// J.
    pub charge: f64,
    /// Rescues that it can still help with, if it has a load.
    pub load: u32,
}

/// How a robot gets somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// When it is near enough, s from now; infinite if it cannot get there.
    pub arrival: f64,
    /// What its battery holds then, J.
    pub charge: f64,
    /// Rescues that it can help with then.
    pub load: u32,
    /// Whether it goes to a station or a depot first.
    pub by_stop: bool,
}

impl Leg {
    const NEVER: Self = Self { arrival: f64::INFINITY, charge: 0.0, load: 0, by_stop: true };
}

/// The robots of a world and the stations between which they move.
#[derive(Debug, Clone, PartialEq)]
pub struct Ways {
    /// The team.
    pub movers: Vec<Mover>,
    /// What charges batteries.
    pub stations: Vec<Station>,
    /// What refills loads.
    pub depots: Vec<Depot>,
    /// How near to a victim a robot must be, m.
    pub radius: f64,
    /// Whether robots drive along the axes, one after the other.
    pub along_axes: bool,
}

impl Ways {
    /// How a robot gets to a victim at `to`, by a depot if its load is used up. `direct` is how long the straight
    /// way takes, s.
    #[must_use]
    pub fn leg(&self, robot: usize, from: &Stand, to: Place, direct: f64) -> Leg {
        let Some(most) = self.movers[robot].load.filter(|_| from.load == 0) else {
            return self.reach(robot, from, to, direct);
        };
        let Some(depot) = self.nearest(&self.depots, from.place, |depot| depot.place) else {
            return Leg::NEVER;
        };
        let there = self.time(robot, from.place, depot.place, depot.radius);
        let first = self.reach(robot, from, depot.place, there);
        let full = Stand { place: depot.place, free: first.arrival, charge: first.charge, load: most };
        let onward = self.reach(robot, &full, to, self.travel(robot, depot.place, to));
        Leg { by_stop: true, ..onward }
    }

    /// How a robot gets to a place. A robot whose charge would not take it there and on to a station, or that is
    /// at a station and not nearly full, fills its battery at the nearest station before.
    fn reach(&self, robot: usize, from: &Stand, to: Place, direct: f64) -> Leg {
        let straight =
            |charge: f64| Leg { arrival: from.free + direct, charge, load: from.load, by_stop: false };
        let Some(battery) = &self.movers[robot].battery else { return straight(from.charge) };
        let used = |a: Place, b: Place| battery.per_m * self.length(a, b) + battery.start;
        let station = |from: Place| self.nearest(&self.stations, from, |station| station.place);
        let way_back = station(to).map_or(0.0, |station| used(to, station.place));
        let needed = used(from.place, to);
        let is_enough = from.charge > 0.0 && needed + way_back <= from.charge;
        let Some(station) = station(from.place) else {
            return if is_enough { straight(from.charge - needed) } else { Leg::NEVER };
        };
        let is_there = distance(from.place, station.place) <= station.radius;
        let gained = station.power - battery.idle;
        let charges = is_there && gained > 0.0 && from.charge < NEARLY_FULL * battery.capacity;
        if is_enough && !charges {
            return straight(from.charge - needed);
        }
        let left = from.charge - if is_there { 0.0 } else { used(from.place, station.place) };
        let onward = used(station.place, to);
        if left < 0.0 || gained <= 0.0 || onward + way_back > battery.capacity {
            return Leg::NEVER;
        }
        let there = self.time(robot, from.place, station.place, station.radius);
        let filled = (battery.capacity - left) / gained;
        let arrival = from.free + there + filled + self.travel(robot, station.place, to);
        Leg { arrival, charge: battery.capacity - onward, load: from.load, by_stop: true }
    }

    /// How long a robot at rest takes to a victim, s.
    #[must_use]
    pub fn travel(&self, robot: usize, from: Place, to: Place) -> f64 {
        self.time(robot, from, to, self.radius)
    }

    fn time(&self, robot: usize, from: Place, to: Place, radius: f64) -> f64 {
        let gap = (distance(from, to) - radius).max(0.0);
        let Mover { speed, lag, .. } = self.movers[robot];
        if gap > 0.0 { gap / speed + lag } else { 0.0 }
    }

    /// The length of a way as energy counts it, m.
    fn length(&self, a: Place, b: Place) -> f64 {
        let (x, y) = ((a[0] - b[0]).abs(), (a[1] - b[1]).abs());
        if self.along_axes { x + y } else { distance(a, b) }
    }

    /// The nearest of several places; the first of equals.
    fn nearest<'a, T>(&self, among: &'a [T], from: Place, place: impl Fn(&T) -> Place) -> Option<&'a T> {
        let length = |one: &&T| self.length(from, place(one));
        among.iter().min_by(|a, b| length(a).total_cmp(&length(b)))
    }
}

fn distance(a: Place, b: Place) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    (x * x + y * y).sqrt()
}
