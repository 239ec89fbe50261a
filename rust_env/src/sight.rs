//! Sight: which teammates and victims a robot sees, and how long ago it last saw the others.
//!
//! What is seen is decided by true places, from centre to centre: within the robot's `sight_m` and its field of view,
//! and where the scenario has occlusion, with no obstacle between that blocks the robot's own layer. It looks over the others.

use std::iter::zip;

use crate::blocks::Blocks;
use crate::geometry::{Solid, Vec2};
use crate::robot::Body;
use crate::scenario::{MAX_VICTIMS, Robot, Scenario};
use crate::tasks::Victim;
use crate::wheels::Heading;

/// The step of what was never seen in an episode.
pub const NEVER: u32 = u32::MAX;

/// Below every cosine.
const AROUND: f32 = -2.0;

/// The time since something was seen whose share is one half, s.
const HALF_S: f32 = 1.0;

/// The sights of a scenario's team.
#[derive(Debug, Clone)]
pub struct Sight {
    /// Squares of how far each robot sees, m²; infinite for one that sees everything.
    reach: Vec<f32>,
    /// Cosines of half the angle within which each robot sees; [`AROUND`] for one that looks all around.
    edges: Vec<f32>,
    /// The layer of each robot, one bit.
    layers: Vec<u64>,
    /// Obstacles that hide what is behind them, and the layers they block; none without occlusion.
    hiding: Vec<(Solid, u64)>,
    /// Solid cells of the map, which do so, too.
    blocks: Option<Blocks>,
    /// Slots for victims.
    slots: usize,
    /// Control period, s.
    dt: f32,
}

/// What there is to see at a moment, and whose senses fail.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Places of the robots, m.
    pub positions: &'a [Vec2],
    /// Where robots on wheels point; none where no robot has any.
    pub headings: &'a [Heading],
    /// Places of the obstacles, m.
    pub obstacles: &'a [Vec2],
    /// Victims by slot.
    pub victims: &'a [Option<Victim>],
    /// Steps done in the episode.
    pub step: u32,
    /// Robots that have left the arena, as bits: nobody sees them, and they see nothing.
    pub absent: u64,
    /// Robots that see nothing, as bits.
    pub blind: u64,
    /// Robots that see no teammates, as bits.
    pub deaf: u64,
    /// Robots whose sensors repeat an older reading, as bits: what they saw last stays as it was.
    pub held: u64,
}

impl Sight {
    /// The sights of a valid scenario; `None` where every robot sees everything.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario, team: &[Body], solids: &[Solid]) -> Option<Self> {
        let square = |metres: f64| (metres as f32) * (metres as f32);
        let hiding = zip(solids.iter().copied(), scenario.blocked());
        scenario.has_limited_sight().then(|| Self {
            reach: scenario.robots.iter().map(|one| one.sight_m.map_or(f32::INFINITY, square)).collect(),
            edges: scenario.robots.iter().map(edge).collect(),
            layers: team.iter().map(|body| body.layer).collect(),
            hiding: hiding.filter(|_| scenario.occlusion).collect(),
            blocks: Blocks::of(scenario).filter(|_| scenario.occlusion),
            slots: scenario.num_victims(),
            dt: scenario.dt_s as f32,
        })
    }

    /// Numbers kept for each robot: one for each robot of the team, its own among them, and for each slot.
    fn width(&self) -> usize {
        self.reach.len() + self.slots
    }

    /// Numbers kept for a world.
    #[must_use]
    pub fn numbers(&self) -> usize {
        self.reach.len() * self.width()
    }

    /// What the episode starts with: nobody has seen anything.
    pub fn forget(&self, last: &mut Vec<u32>) {
        last.clear();
        last.resize(self.numbers(), NEVER);
    }

    /// Notes the present step for all that is seen in `last`, the step at which each robot last saw each other
    /// robot and the victim of each slot. A victim that has just appeared was never seen before.
    ///
    /// A second look in the same step, after somebody was moved, may take back what the first one noted.
    pub fn look(&self, view: &View, last: &mut [u32]) {
        for (own, row) in last.chunks_exact_mut(self.width()).enumerate() {
            let (mates, slots) = row.split_at_mut(self.reach.len());
            let is = |robots: u64| robots >> own & 1 == 1;
            let (held, looks) = (is(view.held), !is(view.blind | view.absent));
            let front = self.front(own, view);
            for (other, last) in mates.iter_mut().enumerate().filter(|_| !held) {
                let there = other != own && view.absent >> other & 1 == 0;
                let seen =
                    looks && !is(view.deaf) && there && self.sees(own, front, view, view.positions[other]);
                note(seen, view.step, last);
            }
            for (last, victim) in zip(slots, view.victims) {
                let seen = |victim: &Victim| looks && self.sees(own, front, view, victim.position);
                if !held {
                    note(victim.as_ref().is_some_and(seen), view.step, last);
                }
                // What was seen before this victim appeared was another one.
                if victim.is_none_or(|victim| *last < victim.appeared_step) {
                    *last = NEVER;
                }
            }
        }
    }

    /// Whether a robot whose senses work sees what is at a place; `front` as of [`Self::front`].
    fn sees(&self, own: usize, front: Option<Vec2>, view: &View, at: Vec2) -> bool {
        let from = view.positions[own];
        let way = at - from;
        let hides = |((solid, layers), centre): (&(Solid, u64), &Vec2)| {
            layers & self.layers[own] != 0 && solid.is_crossed(from - centre, way)
        };
        let blocks = self.blocks.iter().filter(|blocks| blocks.block(self.layers[own]));
        way.norm_squared() <= self.reach[own]
            && front.is_none_or(|ahead| ahead.dot(&way) >= self.edges[own] * way.norm())
            && !zip(&self.hiding, view.obstacles).any(hides)
            && !blocks.into_iter().any(|blocks| blocks.is_crossed(from, way))
    }

    /// Where a robot points whose field of view is limited; none of one that looks all around.
    fn front(&self, own: usize, view: &View) -> Option<Vec2> {
        (self.edges[own] > AROUND).then(|| view.headings[own].ahead())
    }

    /// The time since something was last seen as a share, t / (t + 1 s): 0 now, 1 if never in the episode.
    #[must_use]
    pub fn since(&self, last: u32, step: u32) -> f32 {
        if last == NEVER {
            return 1.0;
        }
        let time = (step - last) as f32 * self.dt;
        time / (time + HALF_S)
    }

    /// When robot `own` last saw each other robot, in team order and without itself.
    pub fn mates<'a>(&self, own: usize, last: &'a [u32]) -> impl Iterator<Item = u32> + use<'a> {
        let row = &last[own * self.width()..][..self.reach.len()];
        row.iter().enumerate().filter(move |(other, _)| *other != own).map(|(_, last)| *last)
    }

    /// When robot `own` last saw the victim of each slot.
    #[must_use]
    pub fn victims<'a>(&self, own: usize, last: &'a [u32]) -> &'a [u32] {
        &last[own * self.width()..][self.reach.len()..self.width()]
    }

    /// The same, to be changed.
    pub fn victims_mut<'a>(&self, own: usize, last: &'a mut [u32]) -> &'a mut [u32] {
        let robots = self.reach.len();
        &mut last[own * self.width()..][robots..self.width()]
    }

    /// Those of the victims that robot `own` sees at a step.
    #[must_use]
    pub fn seen(
        &self,
        own: usize,
        last: &[u32],
        step: u32,
        victims: &[Option<Victim>],
    ) -> [Option<Victim>; MAX_VICTIMS] {
        let mut seen = [None; MAX_VICTIMS];
        for ((seen, victim), last) in zip(zip(&mut seen, victims), self.victims(own, last)) {
            *seen = victim.filter(|_| *last == step);
        }
        seen
    }

    /// Whether robots may have seen these things last at these steps, as far as a world tells without a look.
    #[must_use]
    pub fn may_be(&self, last: &[u32], step: u32, victims: &[Option<Victim>]) -> bool {
        let robots = self.reach.len();
        let in_time = |from: u32, last: u32| last == NEVER || (from..=step).contains(&last);
        let appeared = |victim: &Option<Victim>| victim.map_or(NEVER, |victim| victim.appeared_step);
        last.len() == self.numbers()
            && last.chunks_exact(self.width()).enumerate().all(|(own, row)| {
                let (mates, slots) = row.split_at(robots);
                mates[own] == NEVER
                    && mates.iter().all(|last| in_time(0, *last))
                    && zip(slots, victims).all(|(last, victim)| in_time(appeared(victim), *last))
            })
    }
}

fn edge(robot: &Robot) -> f32 {
    if robot.field_of_view_deg >= 360.0 {
        return AROUND;
    }
    (0.5 * robot.field_of_view_deg).to_radians().cos() as f32
}

/// The later of two steps at which something was seen.
#[must_use]
pub(crate) fn later(one: u32, other: u32) -> u32 {
    [one, other].into_iter().filter(|last| *last != NEVER).max().unwrap_or(NEVER)
}

/// Notes that something is seen at a step, or takes back that it was.
pub(crate) fn note(seen: bool, step: u32, last: &mut u32) {
    if seen {
        *last = step;
    } else if *last == step {
        *last = step.checked_sub(1).unwrap_or(NEVER);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::bodies;

    fn sight(change: impl Fn(&mut Scenario)) -> Sight {
        let mut scenario = Scenario::default();
        change(&mut scenario);
        let solids: Vec<Solid> = scenario.obstacles.iter().map(Solid::of).collect();
        Sight::new(&scenario, &bodies(&scenario), &solids).expect("limited")
    }

    const START: [Vec2; 4] =
        [Vec2::new(0.0, 0.0), Vec2::new(0.5, 0.0), Vec2::new(0.0, 0.6), Vec2::new(-0.3, 0.4)];

    fn view(step: u32, victims: &[Option<Victim>]) -> View<'_> {
        let positions = &START;
        View {
            positions,
            headings: &[],
            obstacles: &[],
            victims,
            step,
            absent: 0,
            blind: 0,
            deaf: 0,
            held: 0,
        }
    }

    #[test]
    fn a_robot_sees_up_to_its_sight_and_remembers_when() {
        let sight = sight(|scenario| scenario.robots[0].sight_m = Some(0.5));
        let victim = |x| [Some(Victim::new(0, 0, 0, Vec2::new(x, 0.0))), None];
        let mut last = vec![];
        sight.forget(&mut last);
        sight.look(&view(0, &victim(0.51)), &mut last);
        assert_eq!(sight.mates(0, &last).collect::<Vec<_>>(), [0, NEVER, 0], "0.5, 0.6 and 0.5 m away");
        assert_eq!(sight.mates(2, &last).collect::<Vec<_>>(), [0, 0, 0], "it sees everything");
        assert_eq!(sight.victims(0, &last), [NEVER, NEVER]);
        assert_eq!(sight.victims(1, &last), [0, NEVER]);
        sight.look(&view(3, &victim(0.49)), &mut last);
        assert_eq!(sight.victims(0, &last), [3, NEVER]);
        assert_eq!(sight.seen(0, &last, 3, &victim(0.49))[..2], victim(0.49));
        sight.look(&view(4, &victim(0.51)), &mut last);
        assert_eq!(sight.victims(0, &last), [3, NEVER]);
        assert_eq!(sight.seen(0, &last, 4, &victim(0.51))[0], None);
        let another = [Some(Victim::new(1, 0, 5, Vec2::new(0.9, 0.0))), None];
        sight.look(&view(5, &another), &mut last);
        assert_eq!(sight.victims(0, &last), [NEVER, NEVER], "another one in its slot");
        assert_eq!(sight.victims(1, &last), [5, NEVER]);
        sight.look(&view(6, &[None, None]), &mut last);
        assert_eq!(sight.victims(1, &last), [NEVER, NEVER], "all hear that it is gone");
    }

    #[test]
    fn a_reading_that_is_kept_of_a_victim_that_just_appeared_is_kept() {
        let sight = sight(|scenario| scenario.robots[0].sight_m = Some(0.5));
        let victims = [Some(Victim::new(0, 0, 4, Vec2::new(0.2, 0.0))), None];
        let mut last = vec![];
        sight.forget(&mut last);
        sight.look(&view(4, &victims), &mut last);
        assert_eq!(sight.victims(0, &last), [4, NEVER]);
        sight.look(&View { held: 0b1111, ..view(4, &victims) }, &mut last);
        assert_eq!(sight.victims(0, &last), [4, NEVER]);
        let away = [Some(Victim::new(0, 0, 4, Vec2::new(0.9, 0.0))), None];
        sight.look(&view(4, &away), &mut last);
        assert_eq!(sight.victims(0, &last), [NEVER, NEVER], "taken back, to before it appeared");
    }

    #[test]
    fn a_second_look_takes_back_what_is_moved_out_of_sight() {
        let sight = sight(|scenario| scenario.robots[0].sight_m = Some(0.5));
        let mut last = vec![];
        sight.forget(&mut last);
        for (step, wanted) in [(0, NEVER), (7, 6)] {
            sight.look(&view(step, &[]), &mut last);
            let once = last.clone();
            sight.look(&view(step, &[]), &mut last);
            assert_eq!(last, once);
            let moved = [START[0], Vec2::new(0.9, 0.9), START[2], START[3]];
            sight.look(&View { positions: &moved, ..view(step, &[]) }, &mut last);
            assert_eq!(sight.mates(0, &last).next(), Some(wanted));
        }
    }

    #[test]
    fn failing_senses_see_nothing_new() {
        let sight = sight(|scenario| scenario.robots[3].sight_m = Some(0.1));
        let victims = [Some(Victim::new(0, 0, 0, Vec2::new(0.2, 0.0))), None];
        let look = |change: fn(&mut View)| {
            let (mut last, mut view) = (vec![], view(2, &victims));
            sight.forget(&mut last);
            change(&mut view);
            sight.look(&view, &mut last);
            let mates: Vec<bool> = sight.mates(1, &last).map(|last| last == 2).collect();
            (mates, sight.victims(1, &last)[0] == 2)
        };
        assert_eq!(look(|_| ()), (vec![true; 3], true));
        assert_eq!(look(|view| view.blind = 0b0010), (vec![false; 3], false));
        assert_eq!(look(|view| view.held = 0b0010), (vec![false; 3], false));
        assert_eq!(look(|view| view.deaf = 0b0010), (vec![false; 3], true));
        assert_eq!(look(|view| view.absent = 0b0010), (vec![false; 3], false));
        assert_eq!(look(|view| view.absent = 0b0101), (vec![false, false, true], true));
    }

    #[test]
    fn the_time_since_is_a_share_that_grows() {
        let sight = sight(|scenario| scenario.robots[3].sight_m = Some(0.1));
        assert_eq!(sight.since(7, 7).to_bits(), 0.0_f32.to_bits());
        assert!((sight.since(7, 17) - 0.5).abs() < 1e-6, "one second");
        assert!((sight.since(0, 90) - 0.9).abs() < 1e-6, "nine seconds");
        assert_eq!(sight.since(NEVER, 90).to_bits(), 1.0_f32.to_bits());
    }
}
