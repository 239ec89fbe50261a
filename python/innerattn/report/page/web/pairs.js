// What a robot for any team makes of its row: one list of numbers for each pair of a robot and a victim. See
// innerattn.policies.exported.table and innerattn.policies.exported.pairs; numbers are rounded as there.

const NEAREST = 6; // victims that a robot looks at, by its own arrival time; blocked ones come after all others
const BLOCKED_S = 100;
const ENDLESS_S = 1000; // time until a victim without a deadline is lost
const NOBODY_S = 1000; // arrival time of nobody
const LONGEST_S = 8; // beyond this, arrival times tell no more
const FARTHEST_M = 2;
const LEAST = single(1e-6);
const DIRECTIONS = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];
const MOVE_SHARPNESS = 20;

// The columns of a pair in their order: between which values they lie, and what they are divided by.
const COLUMNS = Object.entries({
  distance: {}, time: { unit: 2 }, towards: {}, inside: {}, needed: { unit: 3 }, met: { unit: 3 },
  fills: { unit: 2 }, spare: { least: -1, most: 4, unit: 3 }, spareMine: { least: -1, most: 4, unit: 3 },
  speed: {}, push: { most: 3 }, arena: {}, waiting: { unit: 4 }, mostWaiting: { unit: 4 }, rank: { unit: 2 },
  later: { least: 0, most: 4 }, choices: { unit: 3 }, without: { least: -3, most: 3 }, others: { most: 4 },
  last: { least: -3, most: 3 }, nearer: { most: 4, unit: 3 },
  rivals: { most: 6, unit: 3 }, partners: { most: 6, unit: 3 },
  wait: { most: 4, unit: 2 }, left: { most: LONGEST_S, unit: 4 }, blocked: {}, toSpare: { least: -3, most: 3 },
});

const cut = (value, least = -Infinity, most = Infinity) => Math.min(Math.max(value, least), most);
const columnsOf = (pair) => COLUMNS.map(([name, { least, most, unit = 1 }]) => (
  single(cut(single(pair[name]), least, most) * single(1 / unit))
));

/** Numbers from 0 in the order of some values; where these are the same, the smaller number is first. */
const orderOf = (values) => values.map((_, at) => at).sort((one, other) => values[one] - values[other]);
const ranksOf = (values) => orderOf(values).reduce((ranks, at, rank) => ((ranks[at] = rank), ranks), []);

/** The element that brings a vector to x >= y >= 0: bit 0 mirrors x, bit 1 y, bit 2 swaps both. */
const frameOf = ([x, y]) => Number(x < 0) + 2 * Number(y < 0) + 4 * Number(Math.abs(y) > Math.abs(x));

function turnedInto(frame, [x, y]) {
  const [across, along] = [frame & 1 ? -x : x, frame & 2 ? -y : y];
  return frame & 4 ? [along, across] : [across, along];
}

/** Makes the pairs of one robot of a team, which is the first in all lists here. */
class Relating {
  /** `known` is of innerattn.report.page.any_team; `robot` is its number in the team. */
  constructor(known, robot) {
    const first = ([...all]) => [all[robot], ...all.filter((_, index) => index !== robot)];
    const bodies = first(known.bodies).map(([speed, lag, push, kept, limit, reach]) => (
      { speed, lag, push, kept, limit, reach }
    ));
    Object.assign(this, { known, bodies, radius: single(known.radius) });
  }

  /** What it sees: its row as a table of robots, itself first, and of victims that wait. */
  table(row) {
    const { team, victims, leave } = this.known, rows = team.map((columns) => columns.map((one) => row[one]));
    const ready = rows.map((one) => one.at(-1) > 0.5), heard = rows.slice(1).map((one) => one.some(Boolean));
    const [x, y, vx, vy] = rows[0], isOwn = (index) => index === 0;
    const from = (index, start, value) => (isOwn(index) ? value : single(value + start));
    const found = victims.map((columns) => columns.map((one) => row[one]));
    const slots = found.flatMap(([present], slot) => (present > 0.5 ? [slot] : []));
    const waiting = slots.map((slot) => found[slot]);
    return {
      places: rows.map((one, index) => [from(index, x, one[0]), from(index, y, one[1])]),
      velocities: rows.map((one, index) => [from(index, vx, one[2]), from(index, vy, one[3])]),
      abilities: rows.map((one, index) => one.slice(4, -1).map((value) => (ready[index] ? value : 0))),
      there: leave ? ready : [true, ...heard], // nothing is known of who is not heard
      victims: waiting.map((one) => one.slice(-2).map((way, axis) => single(way + [x, y][axis]))),
      needs: waiting.map((one) => one.slice(1, -2)),
      waits: slots.map((slot) => this.waits(row, slot, found[slot].slice(1, -2))),
    };
  }

  /** Of a victim: the service that it still needs [s], the time until it is lost [s], and whether it is blocked. */
  waits(row, slot, needs) {
    const { served, timeLeft, blocked, services, longestDeadline } = this.known;
    const alike = services.filter((one) => one.needs.every((need, sort) => need === needs[sort]));
    const service = single(Math.max(0, ...alike.map(({ seconds }) => seconds)));
    const share = timeLeft.length ? row[timeLeft[slot]] : 1;
    return {
      wait: served.length ? single(single(1 - row[served[slot]]) * service) : 0,
      left: share < 1 ? single(share * single(longestDeadline)) : ENDLESS_S,
      blocked: blocked.length ? row[blocked[slot]] : 0,
    };
  }

  /**
   * All that the network takes of a row: `cells`, columns of pairs by victim and robot (null: there is none);
   * `at`, victims of the robot's own pairs, with `frames`, `turning` vectors and `masks` of each; `times`; and
   * `home`, the robot itself, in `homeFrame`.
   */
  relate(row) {
    const table = this.table(row), { needs, abilities, velocities, places } = table, mate = nearestMate(table);
    const roles = needs.map((one) => rolesAt(one, abilities));
    const ways = table.victims.map((victim) => places.map((place, robot) => (
      this.way(victim, place, velocities[robot], this.bodies[robot])
    )));
    const times = ways.map((robots) => robots.map(({ time }) => time));
    const own = places.map((_, robot) => times.map((all, victim) => (
      single(all[robot] + (roles[victim].useful[robot] ? 0 : NOBODY_S) + BLOCKED_S * table.waits[victim].blocked)
    )));
    const choices = places.map((_, robot) => roles.filter(({ useful }) => useful[robot]).length);
    const soonest = own.map((all) => Math.min(NOBODY_S, ...all)), ranks = own.map(ranksOf);
    const isThere = (victim, robot) => roles[victim].useful[robot] && ranks[robot][victim] < NEAREST;
    const cells = ways.map((robots, victim) => {
      const shared = this.atVictim(roles[victim], robots, times[victim], needs.length, table.waits[victim]);
      return robots.map((way, robot) => isThere(victim, robot) && columnsOf({
        ...shared(robot), rank: ranks[robot][victim], choices: choices[robot], later: way.time - soonest[robot],
      }));
    });
    const at = needs.flatMap((_, victim) => (isThere(victim, 0) ? [victim] : []));
    const masks = at.map((victim) => [roles[victim].rivals, roles[victim].partners]);
    return {
      cells, at, masks, times, ...this.turning(table, ways, own[0], at, mate),
      ...this.home(table, mate, soonest[0], choices[0]),
    };
  }

  /** From a robot to a victim: the way, its length [m], the speed along it [m/s] and the time that it takes [s]. */
  way([ax, ay], [px, py], [vx, vy], { speed: most, lag }) {
    const way = [single(ax - px), single(ay - py)], [x, y] = way;
    const scalar = (ux, uy) => single(single(x * ux) + single(y * uy)), distance = single(Math.sqrt(scalar(x, y)));
    const speed = Math.max(most, LEAST), towards = single(scalar(vx, vy) / Math.max(distance, LEAST));
    const gap = Math.max(single(distance - this.radius), 0);
    const late = gap > 0 ? Math.max(single(lag * single(1 - single(towards / speed))), 0) : 0;
    return { way, distance, towards, time: Math.min(single(single(gap / speed) + late), LONGEST_S) };
  }

  /** What can be told of a robot at one victim, which `waits`, by the robot's number. */
  atVictim(roles, ways, times, waiting, { wait, left, blocked }) {
    const { half, victims } = this.known, { needed, useful, sets, spare } = roles;
    const inside = ways.map(({ distance }, robot) => distance <= this.radius && useful[robot]);
    const met = Math.min(...sets.map(({ helps, elsewhere }) => (
      single(helps.filter((help, robot) => help && inside[robot]).length + elsewhere)
    )));
    const fill = fillingTimes(roles, times), filled = times.map((_, robot) => fill(robot));
    const ready = filled.map(({ others }, robot) => (useful[robot] ? Math.max(others, times[robot]) : NOBODY_S));
    const complete = Math.min(...ready), count = (flags) => flags.filter(Boolean).length;
    const toSpare = left < ENDLESS_S ? single(single(left - complete) - wait) : ENDLESS_S;
    return (robot) => {
      const { distance, towards, time } = ways[robot], { speed, push } = this.bodies[robot];
      const { without, others } = filled[robot], rivals = roles.rivals[robot];
      return {
        distance, towards, time, needed, met, spare, others, push, waiting, wait, left, blocked, toSpare,
        inside: Number(inside[robot]), fills: roles.filledBy[robot], spareMine: roles.spareMine[robot],
        speed: Math.max(speed, LEAST), arena: half, mostWaiting: victims.length,
        without: single(without - time), last: single(others - time),
        nearer: count(rivals.map((rival, other) => rival && times[other] < time)),
        rivals: count(rivals), partners: count(roles.partners[robot]),
      };
    };
  }

  /** Frames of the robot's own pairs, which bring the victim to x >= y >= 0, and vectors in them. */
  turning({ places, velocities }, ways, own, at, mate) {
    const [first, second = -1] = orderOf(own), frames = at.map((victim) => frameOf(ways[victim][0].way));
    const turning = at.map((victim, pair) => {
      const other = victim === first ? second : first, helps = other >= 0 && own[other] < NOBODY_S;
      const next = helps ? ways[other][0].way : [0, 0];
      const vectors = [ways[victim][0].way, velocities[0], mate, places[0], next];
      return this.withGains(vectors.map((one) => turnedInto(frames[pair], one)));
    });
    return { frames, turning };
  }

  /** The robot itself, in the frame of its way to the centre. */
  home({ places: [[x, y]], velocities: [velocity], abilities }, mate, soonest, choices) {
    const way = [-x, -y], homeFrame = frameOf(way), [{ speed, lag, push }] = this.bodies;
    const asked = this.known.demand.map((demand, sort) => {
      const offered = Math.max(sumOf(abilities.map((able) => able[sort])), 1);
      return single(abilities[0][sort] * single(demand / offered));
    });
    const home = [
      speed, lag, Math.min(push, 3), Number(choices > 0), choices / 3, Math.max(...abilities[0]),
      Math.min(soonest, 4), this.known.half, Math.max(...asked), sumOf(asked),
      ...this.withGains([way, velocity, mate].map((one) => turnedInto(homeFrame, one))),
    ];
    return { home, homeFrame };
  }

  /** Vectors, the first a way and the second the velocity, and what each action gains on the way. */
  withGains(vectors) {
    const [[x, y], [vx, vy]] = vectors, { push, kept, limit, reach } = this.bodies[0];
    const unit = Math.max(Math.min(push, limit) * reach, LEAST), most = Math.max(limit, LEAST);
    const left = DIRECTIONS.map(([across, along]) => {
      const ux = kept * vx + push * across, uy = kept * vy + push * along;
      const far = reach * most / Math.max(Math.hypot(ux, uy), most);
      return Math.hypot(x - far * ux, y - far * uy);
    });
    const gains = left.map((one) => (left[0] - one) / unit);
    const powers = gains.map((gain) => Math.exp(gain * MOVE_SHARPNESS));
    return [...vectors.flat(), ...gains.slice(1), ...powers.map((power) => power / sumOf(powers))];
  }
}

/** When others fill needs of a victim, by a robot's number: all that it could fill, and enough to complete it [s]. */
function fillingTimes({ sets, needed }, times) {
  const order = orderOf(times), place = ranksOf(times), moments = [0, ...order.map((robot) => times[robot])];
  const rooms = sets.map(({ helps, elsewhere }) => {
    let arrived = 0;
    return [elsewhere, ...order.map((robot) => single((arrived += helps[robot]) + elsewhere))];
  });
  return (robot) => {
    let without = NOBODY_S, others = NOBODY_S;
    moments.forEach((moment, count) => {
      let alone = Infinity, beside = Infinity;
      sets.forEach(({ helps }, set) => {
        const room = place[robot] < count ? single(rooms[set][count] - helps[robot]) : rooms[set][count];
        alone = Math.min(alone, room);
        beside = Math.min(beside, single(room + helps[robot]));
      });
      if (beside === alone) without = Math.min(without, moment);
      if (beside >= needed) others = Math.min(others, moment);
    });
    return { without, others };
  };
}

/** The way to the nearest teammate that is there, at most 2 m in x and y; zero if there is none. */
function nearestMate({ places: [[x, y], ...mates], there }) {
  let least = Infinity, found = [0, 0];
  mates.forEach(([mx, my], mate) => {
    const way = [mx - x, my - y], square = way[0] * way[0] + way[1] * way[1];
    if (there[mate + 1] && square < least) [least, found] = [square, way];
  });
  return found.map((one) => cut(one, -FARTHEST_M, FARTHEST_M));
}
