// Scripts that act in the page: chance, and those that drive straight to victims as
// innerattn.policies.scripted does.

const FORBIDDEN = 1e7; // cost of a pair that cannot be, s
const OWN_SHARE = 0.3;
const NEVER_S = 1e4;
const PUSHES = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];

/** The actions of all robots: some for a crew, and none for the others. */
function ofAll(positions, crew, actions, nothing) {
  const chosen = new Map(crew.map((robot, at) => [robot, actions[at]]));
  return Array.from({ length: positions.length / 2 }, (_, robot) => chosen.get(robot) ?? nothing);
}

/** Every robot draws every action, all with the same chance. */
class Chance {
  constructor(name, continuous) {
    Object.assign(this, { name, continuous });
    this.reset(0);
  }

  reset(seed) {
    this.draws = new Draws(seed);
  }

  act(obs, scene) {
    const { positions, crew } = scene(), share = () => 2 * this.draws.next() - 1;
    const drawn = crew.map(() => (this.continuous ? [share(), share()] : Math.floor(5 * this.draws.next())));
    return ofAll(positions, crew, drawn, this.continuous ? [0, 0] : 0);
  }

  attention() {
    return null;
  }
}

/** Targets first, anew in every step, and then actions. It takes all robots to be healthy. */
class Dispatcher {
  /** `motion` is of innerattn.report.page.scripts. */
  constructor(name, motion, continuous) {
    Object.assign(this, { name, continuous }, motion);
  }

  reset() {}

  /** The actions of all robots; `scene` gives positions, velocities, victims by slot, and who counts: the crew. */
  act(obs, scene) {
    const seen = scene(), { positions, velocities, victims, crew } = seen, chosen = this.choose(seen);
    const actions = crew.map((index, at) => {
      const robot = this.robots[index], victim = victims[chosen[at]], [x, y] = victim ? [victim.x, victim.y] : [0, 0];
      const way = [x - positions[2 * index], y - positions[2 * index + 1]];
      const speed = [velocities[2 * index], velocities[2 * index + 1]];
      return this.continuous ? this.pushed(robot, way, speed) : this.moved(robot, way, speed);
    });
    return ofAll(positions, crew, actions, this.continuous ? [0, 0] : 0);
  }

  /** The action after which the robot, coasting for a period more, is nearest to its target. */
  moved(robot, way, speed) {
    const reach = this.dt * (1 + robot.keep);
    const left = PUSHES.map((push) => {
      const after = speed.map((one, axis) => robot.keep * one + push[axis] * robot.push);
      const share = Math.min(1, robot.limit / Math.max(lengthOf(after), 1e-12));
      const [x, y] = way.map((one, axis) => one - reach * (after[axis] * share));
      return x * x + y * y;
    });
    return left.indexOf(Math.min(...left));
  }

  /** The push that brings it there if it is strong enough, else a full one that way. */
  pushed(robot, way, speed) {
    const reach = this.dt * (1 + robot.keep);
    const wish = way.map((one, axis) => (one / reach - robot.keep * speed[axis]) / Math.max(robot.push, 1e-12));
    const length = Math.max(lengthOf(wish), 1);
    return wish.map((one) => Math.fround(one / length));
  }

  /** Whether a robot gives a need of a victim; beyond a task's last need there is none. */
  gives(robot, victim, need) {
    const ability = this.needs[victim.task][need];
    return Boolean(victim.present) && ability >= 0 && robot.able[ability];
  }

  attention() {
    return null;
  }
}

/** Every robot goes to the nearest victim that it can help, whatever the others do. */
class Greedy extends Dispatcher {
  choose({ positions, victims, crew }) {
    return crew.map((index) => {
      const robot = this.robots[index], away = victims.map((victim) => {
        if (!this.needs[0].some((_, need) => this.gives(robot, victim, need))) return Infinity;
        const [x, y] = [victim.x - positions[2 * index], victim.y - positions[2 * index + 1]];
        return x * x + y * y;
      });
      const least = Math.min(...away);
      return least < Infinity ? away.indexOf(least) : -1;
    });
  }
}

/** Robots are assigned to needs at the least total cost in arrival times. */
class Hungarian extends Dispatcher {
  choose({ positions, velocities, victims, crew }) {
    const robots = crew.map((index) => this.robots[index]);
    const needs = this.needs[0].length, times = crew.map((index, at) => {
      const robot = robots[at], two = (values) => values.subarray(2 * index, 2 * index + 2);
      return victims.map((victim) => this.arrival(robot, two(positions), two(velocities), victim));
    });
    const costs = robots.map(() => Array(victims.length * needs).fill(FORBIDDEN));
    victims.forEach((victim, slot) => {
      const givers = Array.from({ length: needs }, (_, need) => (
        robots.flatMap((robot, at) => (this.gives(robot, victim, need) ? [at] : []))
      ));
      const soonest = givers.map((some) => (some.length ? Math.min(...some.map((one) => times[one][slot])) : 0));
      const last = Math.max(...soonest);
      givers.forEach((some, need) => some.forEach((one) => {
        costs[one][slot * needs + need] = Math.max(times[one][slot], last) + OWN_SHARE * times[one][slot];
      }));
    });
    const wanted = victims.map(({ present, task }) => (present ? this.needs[task].filter((one) => one >= 0).length : 0));
    return wholeTeams(costs, wanted, needs).map((slot) => (slot >= 0 ? Math.floor(slot / needs) : -1));
  }

  /** When a robot could be within the rescue radius of a victim, s. */
  arrival(robot, [x, y], [vx, vy], victim) {
    const way = [victim.x - x, victim.y - y], distance = lengthOf(way), gap = distance - this.radius;
    if (gap <= 0) return 0;
    const towards = (way[0] * vx + way[1] * vy) / Math.max(distance, 1e-9), speed = Math.max(robot.speed, 1e-9);
    return Math.min(gap / speed + Math.max(robot.lag * (1 - towards / speed), 0), NEVER_S);
  }
}

/** As `assigned`, but where no victim would get all its helpers, whole teams come first: the soonest, then the next. */
function wholeTeams(costs, wanted, needs) {
  const plain = assigned(costs), helpers = wanted.map(() => 0);
  plain.forEach((slot) => slot >= 0 && helpers[Math.floor(slot / needs)]++);
  if (!helpers.some(Boolean) || helpers.some((count, victim) => count && count === wanted[victim])) return plain;
  const left = costs.map((row) => [...row]), chosen = costs.map(() => -1);
  for (let round = 0; round < wanted.length; round++) {
    const teams = wanted.map((count, victim) => {
      const start = victim * needs, own = assigned(left.map((row) => row.slice(start, start + needs)));
      const latest = Math.max(...own.map((need, robot) => (need >= 0 ? left[robot][start + need] : -Infinity)));
      return { start, own, latest: count && count === own.filter((need) => need >= 0).length ? latest : Infinity };
    });
    const { start, own, latest } = teams.reduce((first, one) => (one.latest < first.latest ? one : first));
    if (latest === Infinity) break;
    own.forEach((need, robot) => {
      if (need >= 0) [chosen[robot], left[robot]] = [start + need, left[robot].fill(FORBIDDEN)];
    });
    left.forEach((row) => row.fill(FORBIDDEN, start, start + needs));
  }
  const rest = assigned(left);
  return chosen.map((slot, robot) => (slot >= 0 ? slot : rest[robot]));
}

/** Whether robots with such abilities can fill all needs at once, each one of them. */
function canFill(needs, abilities) {
  const costs = abilities.map((able) => needs.map((need) => (able.includes(need) ? 0 : FORBIDDEN)));
  return costs.length > 0 && assigned(costs).filter((need) => need >= 0).length === needs.length;
}

/** The cheapest column of each row, as `cheapest`; -1 where it is forbidden. */
const assigned = (costs) => cheapest(costs).map((column, row) => (
  column >= 0 && costs[row][column] < FORBIDDEN ? column : -1
));

/** The column of each row, -1 for none: as many pairs as there can be, at the least total cost. */
function cheapest(costs) {
  const rows = costs.length, columns = costs[0].length;
  if (rows > columns) {
    const rowOf = cheapest(costs[0].map((_, column) => costs.map((row) => row[column])));
    return costs.map((_, row) => rowOf.indexOf(row));
  }
  // Shortest augmenting paths with potentials; row 0 and column 0 stand for none.
  const high = Array(rows + 1).fill(0), low = Array(columns + 1).fill(0), rowOf = Array(columns + 1).fill(0);
  for (let row = 1; row <= rows; row++) {
    const least = Array(columns + 1).fill(Infinity), from = Array(columns + 1).fill(0);
    const done = Array(columns + 1).fill(false);
    let at = 0;
    rowOf[0] = row;
    while (rowOf[at]) {
      done[at] = true;
      let next = 0, step = Infinity;
      for (let column = 1; column <= columns; column++) {
        if (done[column]) continue;
        const left = costs[rowOf[at] - 1][column - 1] - high[rowOf[at]] - low[column];
        if (left < least[column]) [least[column], from[column]] = [left, at];
        if (least[column] < step) [step, next] = [least[column], column];
      }
      for (let column = 0; column <= columns; column++) {
        if (done[column]) {
          high[rowOf[column]] += step;
          low[column] -= step;
        } else {
          least[column] -= step;
        }
      }
      at = next;
    }
    while (at) {
      rowOf[at] = rowOf[from[at]];
      at = from[at];
    }
  }
  return costs.map((_, row) => rowOf.indexOf(row + 1, 1) - 1).map((column) => Math.max(column, -1));
}

const lengthOf = ([x, y]) => Math.sqrt(x * x + y * y);
