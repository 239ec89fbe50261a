// A world in the page and its policies. It answers the messages that the server of innerattn play answers,
// with the same states: see innerattn.evaluate.interactive and innerattn.report.play.state.

const DECIMALS = 1e5;
const TOUCH_M = 2e-3;
const LEAST_WAY_M = 5e-3;
const FREE_SHARE = 0.5;
const FIRST_SEED = 10000n; // of an evaluation: see innerattn.config.streams

const rounded = (value) => Math.round(value * DECIMALS) / DECIMALS;
const same = (one, other) => one === Math.fround(other);
const pairsOf = (values) => rowsOf(values, 2).map((pair) => pair.map(rounded));

/** A part of the page that answers as a server would. */
class Inside {
  constructor(rust, given) {
    Object.assign(this, { rust, given, sessions: new Map(), count: 0 });
  }

  async ask(path, message) {
    const [, key] = path.split("/");
    if (key) return this.sessions.get(key).answer(message);
    const engine = new Engine(this.rust, this.given), session = String(this.count++);
    this.sessions.set(session, engine);
    const { worlds } = this.given, policies = [...engine.policies.keys()];
    return { ...engine.state(), session, worlds: structuredClone(worlds), policies };
  }

  leave(path) {
    const [, key] = path.split("/");
    this.sessions.get(key)?.world.close();
    this.sessions.delete(key);
  }

  lost(error) {
    return `The world has stopped (${error.message}).`;
  }
}

/** What answers this page: the world in it. */
async function transport() {
  const given = JSON.parse($("given").textContent);
  return new Inside(await Rust.load(await unpacked(bytesOf(given.rust))), given);
}

/** What each message does. */
const DOES = {
  look: () => {},
  step: (engine) => engine.step(),
  restart: (engine, { seed }) => engine.restart(seed ?? null),
  policy: (engine, { name }) => engine.choosePolicy(name),
  steer: (engine, { robot, x = 0, y = 0 }) => engine.steer(robot, [x, y]),
  move_robot: (engine, { robot, x, y }) => engine.moveRobot(robot, x, y),
  push_robot: (engine, { robot, vx, vy }) => engine.pushRobot(robot, vx, vy),
  faults: (engine, { robot, values }) => engine.setFaults(robot, values),
  add_robot: (engine, { kind }) => engine.addRobot(kind),
  move_victim: (engine, { slot, x, y }) => engine.moveVictim(slot, x, y),
  add_victim: (engine, { task, x, y }) => engine.addVictim(task, x, y),
};

/** One world, the policies that may act in it, and hands that reach into it. */
class Engine {
  /** `given` is what innerattn.report.page.page writes into the page. */
  constructor(rust, given) {
    const { worlds, scenario, policies, rays, slots } = given;
    Object.assign(this, { worlds, rays, slots, scenario: JSON.parse(scenario), seed: BigInt(given.seed) });
    this.size = worlds.robots.length;
    this.continuous = this.scenario.actions === "continuous";
    this.policies = new Map(policies.map((one) => [one.name, this.policyOf(one)]));
    Object.assign(this, { policy: policies[0].name, steered: null, drive: [0, 0] });
    this.world = rust.open(scenario, this.seed);
    this.world.restart();
    this.begin();
  }

  policyOf({ name, team, weights, motion }) {
    if (motion) return new (name === "greedy" ? Greedy : Hungarian)(name, motion, this.continuous);
    if (!team) return new Chance(name, this.continuous);
    return new (team.known ? AnyTeam : Team)(name, team, new Float32Array(bytesOf(weights).buffer));
  }

  answer(message) {
    DOES[message.do](this, message);
    return this.state();
  }

  step() {
    const before = this.world.take("positions");
    if (this.world.step(this.actions.flat())) {
      this.begin();
      return;
    }
    this.blocked = this.blockedSince(before);
    const rescues = rowsOf(this.world.take("rescues"), 3 + this.counts().helpers);
    this.note(rescues.map(([step, victim, task, ...helpers]) => (
      { step, victim, task, helpers: helpers.filter((robot) => robot >= 0) }
    )));
    this.lost = rowsOf(this.world.take("losses"), 3).map(([step, victim, task]) => ({ step, victim, task }));
    this.choose();
  }

  /** Begins the next episode, or episode 0 of a seed. */
  restart(seed) {
    if (seed !== null) this.seed = BigInt(seed) + (BigInt(seed) < FIRST_SEED ? 1n << 63n : 0n);
    this.world.restart(seed === null ? undefined : this.seed);
    this.begin();
  }

  choosePolicy(name) {
    this.policy = name;
    this.resetPolicy();
    this.choose();
  }

  steer(robot, drive) {
    Object.assign(this, { steered: robot, drive });
    this.choose();
  }

  moveRobot(robot, x, y) {
    const most = this.worlds.half_width_m - this.worlds.robots[robot].radius_m;
    within("x", x, most, " m");
    within("y", y, most, " m");
    this.setMotion(robot, [x, y], [0, 0]);
  }

  pushRobot(robot, vx, vy) {
    within("vx", vx, this.worlds.most_push_mps, " m/s");
    within("vy", vy, this.worlds.most_push_mps, " m/s");
    this.setMotion(robot, this.world.take("positions").subarray(2 * robot, 2 * robot + 2), [vx, vy]);
  }

  setMotion(robot, place, velocity) {
    const places = this.world.take("positions"), velocities = this.world.take("velocities");
    places.set(place, 2 * robot);
    velocities.set(velocity, 2 * robot);
    this.world.put("motion", [...places, ...velocities]);
    this.changed();
  }

  setFaults(robot, values) {
    const levels = this.world.take("faults"), kinds = this.worlds.fault_kinds;
    for (const [kind, value] of Object.entries(values)) {
      levels[robot * kinds.length + kinds.findIndex(({ name }) => name === kind)] = value;
    }
    this.world.put("faults", levels);
    this.changed();
  }

  /** Lets a spare robot of a kind into the arena, with no fault. */
  addRobot(kind) {
    const spares = this.worlds.robots.flatMap((one, robot) => (one.is_spare ? [{ ...one, robot }] : []));
    const ofKind = spares.filter((one) => one.kind === kind), away = this.away();
    if (!ofKind.length) {
      const kinds = [...new Set(spares.map((one) => one.kind))].join(", ");
      throw new Refusal(`kind = '${kind}': ${kinds ? `must be one of ${kinds}` : "no robot can be added to this world"}`);
    }
    const free = ofKind.find(({ robot }) => away[robot]);
    if (!free) throw new Refusal(`all ${ofKind.length} spare ${kind} robots are in the arena: take one out first`);
    this.setFaults(free.robot, Object.fromEntries(this.worlds.fault_kinds.map(({ name, healthy }) => [name, healthy])));
  }

  /** Which robots are unavailable. */
  away() {
    const { fault_kinds: kinds } = this.worlds, kind = kinds.findIndex(({ name }) => name === "unavailable");
    return rowsOf(this.world.take("faults"), kinds.length).map((levels) => levels[kind] >= 1);
  }

  /** The robots that scripts reckon with; see innerattn.policies.scripted.crew. */
  crew() {
    const { robots, tasks } = this.worlds, all = robots.map((_, robot) => robot);
    if (!robots.some((one) => one.is_spare)) return all;
    const away = this.away(), there = all.filter((robot) => !away[robot]);
    const isAble = tasks.every(({ needs }) => canFill(needs, there.map((robot) => robots[robot].abilities)));
    return isAble ? there : all.filter((robot) => !away[robot] || !robots[robot].is_spare);
  }

  moveVictim(slot, x, y) {
    const victims = this.victims();
    if (!victims[slot]?.present) throw new Refusal(`slot = ${slot}: holds no victim`);
    this.setVictim(victims, slot, { x, y });
  }

  addVictim(task, x, y) {
    const victims = this.victims(), slots = this.slots[task], slot = slots.find((one) => !victims[one].present);
    if (slot === undefined) {
      throw new Refusal(`all ${slots.length} places for victims are taken in this world: move a victim, ` +
        "or wait for a rescue");
    }
    this.setVictim(victims, slot, { present: 1, task, x, y });
  }

  setVictim(victims, slot, change) {
    Object.assign(victims[slot], change);
    this.world.put("victims", victims.flatMap(({ present, task, x, y }) => [present, task, x, y]));
    this.changed();
  }

  victims() {
    return rowsOf(this.world.take("victims"), 8).map(([present, task, id, due, waits, x, y, served]) => (
      { present, task, id, due, waits, x, y, served }
    ));
  }

  counts() {
    const [episode, step, width, victims, helpers] = this.world.take("counts");
    return { episode, step, width, victims, helpers };
  }

  begin() {
    Object.assign(this, { rescued: 0, helped: Array(this.size).fill(0), last: new Map() });
    this.nothingHappened();
    this.resetPolicy();
    this.choose();
  }

  changed() {
    this.nothingHappened();
    this.choose();
  }

  nothingHappened() {
    Object.assign(this, { blocked: Array(this.size).fill(false), rescues: [], lost: [], handoffs: [] });
  }

  resetPolicy() {
    const seed = this.seed + BigInt(this.counts().episode) * 2654435761n;
    this.policies.get(this.policy).reset(Number(BigInt.asUintN(32, seed)));
  }

  /** Chooses the actions of the next step, and asks for the attention that goes with them. */
  choose() {
    const policy = this.policies.get(this.policy);
    this.obs = this.world.take("observations");
    this.actions = policy.act(this.obs, () => this.scene());
    if (this.steered !== null) this.actions[this.steered] = this.steeredAction();
    this.attention = policy.attention(this.obs, this.actions);
  }

  /** What scripts see. */
  scene() {
    const [positions, velocities] = [this.world.take("positions"), this.world.take("velocities")];
    return { positions, velocities, victims: this.victims(), crew: this.crew() };
  }

  steeredAction() {
    const { drive: kind } = this.scenario.robots[this.steered], wheels = this.worlds.robots[this.steered].has_wheels;
    let [x, y] = this.drive;
    if (wheels) [x, y] = [y, -x];
    if (this.continuous) {
      const share = (value) => Math.min(Math.max(value, -1), 1);
      return kind === "differential" ? [share(x - y), share(x + y)] : [x, y];
    }
    if (!x && !y) return 0;
    if (Math.abs(x) >= Math.abs(y)) return x > 0 ? 1 : 2;
    return y > 0 ? 3 : 4;
  }

  /** Counts the rescues of a step, and finds the handoffs that they complete. */
  note(rescues) {
    Object.assign(this, { rescues, handoffs: [] });
    this.rescued += rescues.length;
    for (const rescue of rescues) {
      for (const robot of rescue.helpers) {
        this.helped[robot]++;
        this.handoffs.push(...this.handedOver(robot, rescue));
        this.last.set(robot, rescue);
      }
    }
  }

  handedOver(robot, now) {
    const last = this.last.get(robot), isPair = ({ task }) => (
      this.worlds.tasks[task].needs.length === 2 && !Object.keys(this.worlds.tasks[task].amounts).length
    );
    if (!last || last.task === now.task || !isPair(last) || !isPair(now)) return [];
    const [before, after] = [last, now].map(({ helpers }) => helpers.find((other) => other !== robot));
    return before === after ? [] : [{ robot, before, after, first: last.step, second: now.step }];
  }

  /** Whether something stopped each robot in the last step; see innerattn.measures.moments. */
  blockedSince(before) {
    const ways = this.world.take("ways"), after = this.world.take("positions");
    return this.worlds.robots.map((_, robot) => {
      const at = 2 * robot, length = Math.hypot(ways[at], ways[at + 1]);
      if (length <= LEAST_WAY_M) return false;
      const moved = (after[at] - before[at]) * ways[at] + (after[at + 1] - before[at + 1]) * ways[at + 1];
      return moved / length < FREE_SHARE * length && this.touches(robot, after);
    });
  }

  /** Whether a robot touches a wall, a robot or an obstacle. */
  touches(robot, places) {
    const { robots, half_width_m: half, obstacles, map } = this.worlds, { radius_m: radius, layer } = robots[robot];
    const [x, y] = places.subarray(2 * robot, 2 * robot + 2), at = this.world.take("obstacles");
    if (half - Math.max(Math.abs(x), Math.abs(y)) - radius < TOUCH_M) return true;
    const gap = (left, up, [width, height]) => (
      Math.hypot(Math.max(Math.abs(left) - width, 0), Math.max(Math.abs(up) - height, 0)) - radius
    );
    const isNear = (ox, oy, size, more, passed) => (
      !passed.includes(layer) && gap(x - ox, y - oy, size) - more < TOUCH_M
    );
    return robots.some((other, index) => index !== robot && other.layer === layer &&
        isNear(places[2 * index], places[2 * index + 1], [0, 0], other.radius_m, [])) ||
      obstacles.some((one, index) => isNear(
        at[2 * index], at[2 * index + 1], one.half_extents_m ?? [0, 0], one.radius_m ?? 0, one.passed_by,
      )) ||
      (map?.boxes ?? []).some(([ox, oy, ...size]) => isNear(ox, oy, size, 0, map.passed_by));
  }

  /** The world now, as innerattn.report.play.state has it. */
  state() {
    const { worlds, world } = this, { episode, step } = this.counts();
    const wheels = worlds.robots.some((robot) => robot.has_wheels);
    const shares = (name) => Array.from(world.take(name), rounded);
    const rays = (robot) => this.rays.map((column) => (
      Math.ceil(this.obs[robot * (this.obs.length / this.size) + column] * DECIMALS) / DECIMALS
    ));
    return {
      schema_version: SCHEMA_VERSION, episode, step, policy: this.policy, steered: this.steered,
      positions: pairsOf(world.take("positions")),
      velocities: pairsOf(world.take("velocities")),
      blocked: this.blocked,
      faults: this.wrong(),
      headings: wheels ? Array.from(world.take("headings"), (angle) => [rounded(angle)]) : null,
      charge: worlds.robots.some((robot) => robot.has_battery) ? shares("charges") : null,
      load: worlds.robots.some((robot) => robot.load !== null) ? shares("loads") : null,
      heard: worlds.limits_communication ? rowsOf(world.take("heard"), this.size) : null,
      rays: this.rays.length ? worlds.robots.map((_, robot) => rays(robot)) : null,
      victims: this.victims().flatMap((one, slot) => (one.present ? [this.shown(one, slot)] : [])),
      obstacles: pairsOf(world.take("obstacles")),
      attention: this.attention && this.attention.map((head) => (
        head.map((row) => row.map((weight) => Math.round(1000 * weight) / 1000))
      )),
      rescues: this.rescues, lost: this.lost, handoffs: this.handoffs,
      rescued: this.rescued, helped: [...this.helped],
    };
  }

  shown({ id, task, due, waits, x, y, served }, slot) {
    const { has_services: serves, has_deadlines: ends, has_order: orders } = this.worlds;
    return {
      slot, id, task, ...(serves && { served: Math.round(1000 * served) / 1000 }), ...(ends && { deadline: due }),
      ...(orders && { waits: waits === 1 }), x: rounded(x), y: rounded(y),
    };
  }

  /** What is wrong with each robot, by kind. */
  wrong() {
    const { fault_kinds: kinds } = this.worlds;
    return rowsOf(this.world.take("faults"), kinds.length).map((levels) => Object.fromEntries(
      kinds.flatMap(({ name, healthy }, kind) => (
        same(levels[kind], healthy) ? [] : [[name, rounded(levels[kind])]]
      )),
    ));
  }
}

function within(name, value, most, unit) {
  if (!(Math.abs(value) <= most)) throw new Refusal(`${name} = ${value}: must be in -${most}..=${most}${unit}`);
}
