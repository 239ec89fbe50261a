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

/** What all policies of the page share: the arena, the team, the tasks. */
class Worlds {
  constructor(described, buffer) {
    Object.assign(this, described);
    this.unit = described.position_unit_m;
    this.places = view(buffer, described.obstacle_places);
    this.kinds = [...new Set(this.robots.map((robot) => robot.kind))];
    this.robots.forEach((robot, index) => {
      robot.index = index;
      robot.kindIndex = this.kinds.indexOf(robot.kind);
      robot.twin = this.robots.slice(0, index).filter((other) => other.kind === robot.kind).length;
    });
    this.abilities = [...new Set(this.robots.flatMap((robot) => robot.abilities))];
    this.tasks.flatMap((task) => task.needs).forEach((need) => {
      if (!this.abilities.includes(need)) this.abilities.push(need);
    });
    this.letters = shortNames(this.abilities);
  }

  /** The kind whose colour an ability has: the only one that offers it, or none. */
  kindOf(ability) {
    const kinds = new Set(
      this.robots.filter((robot) => robot.abilities.includes(ability)).map((one) => one.kindIndex),
    );
    return kinds.size === 1 ? [...kinds][0] : -1;
  }

  canHelp(robot, task) {
    return this.tasks[task].needs.some((need) => this.robots[robot].abilities.includes(need));
  }

  obstacle(episode, index) {
    const at = 2 * (episode * this.obstacles.length + index);
    return [this.places[at] * this.unit, this.places[at + 1] * this.unit];
  }
}

/** The shortest beginnings that tell some names apart. */
function shortNames(names) {
  const found = {};
  for (const name of names) {
    const letters = [...name];
    let length = 1;
    while (
      length < letters.length &&
      names.some((other) => other !== name && [...other].slice(0, length).join("") ===
        letters.slice(0, length).join(""))
    ) length++;
    const short = letters.slice(0, Math.min(length, 3)).join("");
    found[name] = short.charAt(0).toUpperCase() + short.slice(1);
  }
  return found;
}

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
    this.heads = described.attention ? described.attention.shape[2] : 0;
    this.attention = described.attention ? view(buffer, described.attention) : null;
    this.rewards = (described.rewards || []).map(({ name, unit, values }) => (
      { name, unit, values: view(buffer, values) }
    ));
    const lists = (spec, toRow) => byEpisode(buffer, spec, this.episodes, toRow);
    this.victims = lists(described.victims, ([, id, task, from, to, x, y]) => (
      { id, task, from, to, x: x * worlds.unit, y: y * worlds.unit }
    ));
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

  isAway(episode, step, robot) {
    const kinds = this.worlds.fault_kinds;
    return this.faultsAt(episode, step, robot).some(
      (one) => kinds[one.kind].name === "unavailable" && one.value >= 1,
    );
  }

  /** Metres to the nearest victim that a robot can help; NaN: there is none. */
  distance(episode, step, robot) {
    const [x, y] = this.place(episode, step, robot);
    let least = NaN;
    for (const victim of this.victims[episode]) {
      if (step < victim.from || step >= victim.to) continue;
      if (!this.worlds.canHelp(robot, victim.task)) continue;
      const away = Math.hypot(victim.x - x, victim.y - y);
      if (!(away >= least)) least = away;
    }
    return least;
  }

  /** Rescues up to and with a step that a robot helped in; of the whole team for robot -1. */
  rescuesUntil(episode, step, robot) {
    return this.rescues[episode].filter(
      (one) => one.step <= step && (robot < 0 || one.helpers.includes(robot)),
    ).length;
  }
}
