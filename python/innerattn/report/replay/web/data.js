// Unpacks the records and answers questions about them by episode, step and robot.

const TYPES = {
  int8: Int8Array, uint8: Uint8Array, int16: Int16Array, int32: Int32Array, float32: Float32Array,
};

async function unpack(base64) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

function view(buffer, spec) {
  const size = spec.shape.reduce((product, length) => product * length, 1);
  return new TYPES[spec.type](buffer, spec.at, size);
}

/** The rows of an integer table, (N, columns), as objects in a list per episode. */
function byEpisode(buffer, spec, episodes, toRow) {
  const values = view(buffer, spec), width = spec.shape[1];
  const lists = Array.from({ length: episodes }, () => []);
  for (let row = 0; row < spec.shape[0]; row++) {
    const cells = values.subarray(row * width, (row + 1) * width);
    lists[cells[0]].push(toRow(cells, row));
  }
  return lists;
}

const HALF_CIRCLE = 32000; // as headings are packed
const FULL_READING = 32000; // as readings of range sensors are packed

/** One policy's episodes. Positions are metres, velocities metres per second. */
class Run {
  constructor(described, buffer, worlds) {
    this.name = described.name;
    this.policy = described.policy;
    this.worlds = worlds;
    this.velocityUnit = described.velocity_unit_mps;
    this.lengths = view(buffer, described.lengths);
    [this.episodes, this.steps, this.size] = described.positions.shape;
    for (const name of ["positions", "velocities", "blocked"]) {
      this[name] = view(buffer, described[name]);
    }
    this.attentions = {};
    for (const [whose, name] of [["critic", "attention"], ["actor", "actor_attention"]]) {
      const spec = described[name];
      if (spec) this.attentions[whose] = { heads: spec.shape[2], weights: view(buffer, spec) };
    }
    this.attendAs("critic");
    this.rewards = (described.rewards || []).map(({ name, unit, values }) => (
      { name, unit, values: view(buffer, values) }
    ));
    const lists = (spec, toRow) => byEpisode(buffer, spec, this.episodes, toRow);
    this.shares = described.served ? view(buffer, described.served) : null;
    this.waiting = described.waits ? view(buffer, described.waits) : null;
    this.headings = described.headings ? view(buffer, described.headings) : null;
    this.charges = described.charge ? view(buffer, described.charge) : null;
    this.loads = described.load ? view(buffer, described.load) : null;
    this.heard = described.heard ? view(buffer, described.heard) : null;
    this.rays = described.rays ? view(buffer, described.rays) : null;
    this.mostRays = described.rays?.shape[3] ?? 0;
    this.slots = (described.served ?? described.waits)?.shape[2] ?? 0;
    this.victims = lists(described.victims, ([, id, task, from, to, x, y, slot, deadline]) => (
      { id, task, from, to, x: x * worlds.unit, y: y * worlds.unit, slot, deadline }
    ));
    this.lost = lists(described.lost, ([, step, victim, task]) => ({ step, victim, task }));
    this.rescues = lists(described.rescues, ([, step, victim, task, ...helpers]) => (
      { step, victim, task, helpers: helpers.filter((robot) => robot >= 0) }
    ));
    this.handoffs = lists(described.handoffs, ([, robot, before, after, first, second]) => (
      { robot, before, after, first, second }
    ));
    const values = view(buffer, described.fault_values);
    this.faults = lists(described.faults, ([, robot, kind, start, end], row) => (
      { robot, kind, start, end, value: values[row] }
    ));
  }

  /** Looks at the attention of the critic or of the actor from now on, if there is any. */
  attendAs(whose) {
    const { heads = 0, weights = null } = this.attentions[whose] ?? {};
    Object.assign(this, { heads, attention: weights });
  }

  /** The first step from which on a robot has moved by itself. */
  firstOf() {
    return 0;
  }

  /** Where a robot is at a step, which may lie between two. */
  place(episode, step, robot) {
    const last = this.lengths[episode] - 1;
    const low = Math.min(Math.floor(step), last), high = Math.min(low + 1, last);
    const share = step - low, { size, positions, worlds } = this;
    const a = 2 * ((episode * this.steps + low) * size + robot);
    const b = 2 * ((episode * this.steps + high) * size + robot);
    return [
      (positions[a] + (positions[b] - positions[a]) * share) * worlds.unit,
      (positions[a + 1] + (positions[b + 1] - positions[a + 1]) * share) * worlds.unit,
    ];
  }

  velocity(episode, step, robot) {
    const at = 2 * ((episode * this.steps + Math.floor(step)) * this.size + robot);
    return [this.velocities[at] * this.velocityUnit, this.velocities[at + 1] * this.velocityUnit];
  }

  /** Where a robot on wheels points, rad; null for another one. */
  heading(episode, step, robot) {
    if (!this.headings || !this.worlds.robots[robot].has_wheels) return null;
    const at = Math.min(Math.floor(step), this.lengths[episode] - 1);
    return (this.headings[(episode * this.steps + at) * this.size + robot] * Math.PI) / HALF_CIRCLE;
  }

  /** Share of its service that a victim has had, 0 to 1. */
  served(episode, step, victim) {
    if (!this.shares) return 0;
    return this.shares[(episode * this.steps + Math.floor(step)) * this.slots + victim.slot] / 255;
  }

  /** Whether a victim has to wait for others. */
  waits(episode, step, victim) {
    if (!this.waiting) return false;
    return this.waiting[(episode * this.steps + Math.floor(step)) * this.slots + victim.slot] === 1;
  }

  isBlocked(episode, step, robot) {
    return this.blocked[(episode * this.steps + Math.floor(step)) * this.size + robot] === 1;
  }

  /** The weight that a robot gives to another, 0 to 1; head -1 is the mean of all. */
  weight(episode, step, head, robot, other) {
    const { size, heads, attention } = this;
    const square = size * size;
    let at = (episode * this.steps + Math.floor(step)) * heads * square + robot * size + other;
    if (head >= 0) return attention[at + head * square] / 255;
    let sum = 0;
    for (let each = 0; each < heads; each++, at += square) sum += attention[at];
    return sum / (255 * heads);
  }

  reward(component, episode, step, robot) {
    const { values, unit } = this.rewards[component];
    return values[(episode * this.steps + step) * this.size + robot] * unit;
  }

  faultsAt(episode, step, robot) {
    return this.faults[episode].filter(
      (one) => one.robot === robot && one.start <= step && step < one.end,
    );
  }

  /** What share of its energy a robot has; 1 of all where there are no batteries. */
  charge(episode, step, robot) {
    if (!this.charges) return 1;
    const at = Math.min(Math.floor(step), this.lengths[episode] - 1);
    return this.charges[(episode * this.steps + at) * this.size + robot] / 255;
  }

  /** How many rescues more a robot can help with; 0 of all where there are no loads. */
  load(episode, step, robot) {
    if (!this.loads) return 0;
    const at = Math.min(Math.floor(step), this.lengths[episode] - 1);
    return this.loads[(episode * this.steps + at) * this.size + robot];
  }

  /** Whether a robot hears another one. */
  hears(episode, step, robot, other) {
    const at = Math.min(Math.floor(step), this.lengths[episode] - 1);
    return this.heard[((episode * this.steps + at) * this.size + robot) * this.size + other] === 1;
  }

  /** What a ray of a robot's range sensor reads: 1 - distance / range; 0: it meets nothing. */
  reading(episode, step, robot, ray) {
    const at = Math.min(Math.floor(step), this.lengths[episode] - 1);
    return this.rays[((episode * this.steps + at) * this.size + robot) * this.mostRays + ray] / FULL_READING;
  }

  isAway(episode, step, robot) {
    const kinds = this.worlds.fault_kinds;
    return this.faultsAt(episode, step, robot).some(
      (one) => kinds[one.kind].name === "unavailable" && one.value >= 1,
    );
  }

  distance(episode, step, robot) {
    return distanceToVictim(this, episode, step, robot);
  }

  /** Rescues up to and with a step that a robot helped in; of the whole team for robot -1. */
  rescuesUntil(episode, step, robot) {
    return this.rescues[episode].filter(
      (one) => one.step <= step && (robot < 0 || one.helpers.includes(robot)),
    ).length;
  }
}
