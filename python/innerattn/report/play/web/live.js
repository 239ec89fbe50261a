// What the server told of a world that goes on: the newest moment and those shortly before it. It
// answers the same questions as a recorded run, with the one episode 0.

const KEPT_STEPS = 160;
const FAR_M = 0.3; // nobody drives that far in a step

class LiveRun {
  constructor(name, worlds) {
    Object.assign(this, { name, worlds, size: worlds.robots.length, rewards: [], held: null });
    this.kindNumbers = Object.fromEntries(worlds.fault_kinds.map(({ name: kind }, index) => [kind, index]));
    this.clear();
  }

  clear() {
    Object.assign(this, { moments: [], first: 0, victims: [[]], rescues: [[]], lost: [[]], handoffs: [[]] });
    this.cuts = this.worlds.robots.map(() => 0);
  }

  /** Whether a state belongs to the episode that is known. */
  continues({ episode, step }) {
    return Boolean(this.now) && episode === this.now.episode && step >= this.now.step;
  }

  /** Takes a state; gives what happened, as events. */
  take(state) {
    const before = this.now, again = this.continues(state);
    if (!again) this.clear();
    if (again && state.step === before.step) {
      state = { ...state, rescues: [], lost: [], handoffs: [] }; // told before
      this.moments[this.moments.length - 1] = state;
    } else this.moments.push(state);
    if (this.moments.length > KEPT_STEPS) this.moments.shift();
    this.first = this.moments[0].step;
    this.worlds.places = state.obstacles.flat();
    if (again) this.findCuts(before, state);
    else this.cuts.fill(state.step);
    this.takeVictims(state);
    this.rescues[0].push(...state.rescues);
    this.lost[0].push(...state.lost);
    this.handoffs[0].push(...state.handoffs);
    this.rescues[0] = this.rescues[0].filter((one) => one.step >= this.first);
    this.lost[0] = this.lost[0].filter((one) => one.step >= this.first);
    this.handoffs[0] = this.handoffs[0].filter((one) => one.second >= this.first);
    return this.eventsOf(again ? before : null, state);
  }

  get now() {
    return this.moments[this.moments.length - 1];
  }

  get last() {
    return this.now.step;
  }

  get attention() {
    return this.now.attention;
  }

  get heard() {
    return this.now.heard;
  }

  get rays() {
    return this.now.rays;
  }

  get heads() {
    return this.attention ? this.attention.length : 0;
  }

  /** Robots that somebody has put elsewhere leave no trail and do not slide there. */
  findCuts(before, state) {
    state.positions.forEach(([x, y], robot) => {
      const [ax, ay] = before.positions[robot], far = Math.hypot(x - ax, y - ay);
      const comes = this.isOutside(before, robot) && !this.isOutside(state, robot);
      if (comes || far > (before.step === state.step ? 0 : FAR_M)) this.cuts[robot] = state.step;
    });
  }

  takeVictims({ step, victims }) {
    const list = this.victims[0];
    for (const one of victims) {
      const known = list.find((victim) => victim.id === one.id && victim.to > step);
      if (!known) list.push({ ...one, from: step, to: Infinity });
      else if (!known.held) Object.assign(known, one);
    }
    const present = new Set(victims.map((one) => one.id));
    for (const one of list) if (!present.has(one.id)) one.to = Math.min(one.to, step);
    this.victims[0] = list.filter((one) => one.to > this.first);
  }

  eventsOf(before, state) {
    const { worlds } = this, events = [];
    events.push(...state.rescues.map((one) => rescueEvent(worlds, one)));
    events.push(...state.lost.map((one) => lostEvent(worlds, one)));
    events.push(...state.handoffs.map((one) => handoffEvent(worlds, one)));
    if (!before) return events;
    worlds.robots.forEach(({ index, name }) => {
      const [old, now] = [before.faults[index], state.faults[index]];
      for (const kind of new Set([...Object.keys(old), ...Object.keys(now)])) {
        if (old[kind] === now[kind]) continue;
        if (worlds.robots[index].is_spare && kind === "unavailable") {
          events.push(comingEvent(worlds, state.step, index, !(kind in now)));
          continue;
        }
        const fault = { robot: index, start: state.step, kind: this.kindNumbers[kind] };
        if (kind in now) events.push(faultEvent(worlds, { ...fault, value: now[kind] }));
        else {
          const text = `end of a fault: ${name}, ${faultText(worlds, { ...fault, value: old[kind] })}`;
          events.push({ step: state.step, type: "recovery", robots: [index], text });
        }
      }
    });
    return events;
  }

  moment(step) {
    const index = Math.min(Math.max(Math.floor(step) - this.first, 0), this.moments.length - 1);
    return this.moments[index];
  }

  /** The moment that shows a robot at a step: a later one if somebody has put it elsewhere since. */
  momentOf(step, robot) {
    return this.moment(this.cuts[robot] > Math.floor(step) ? step + 1 : step);
  }

  firstOf(episode, robot) {
    return Math.max(this.first, this.cuts[robot]);
  }

  place(episode, step, robot) {
    if (this.held?.robot === robot) return [this.held.x, this.held.y];
    const low = this.momentOf(step, robot).positions[robot], high = this.moment(step + 1).positions[robot];
    const share = step - Math.floor(step);
    return [low[0] + (high[0] - low[0]) * share, low[1] + (high[1] - low[1]) * share];
  }

  velocity(episode, step, robot) {
    return this.momentOf(step, robot).velocities[robot];
  }

  /** Where a robot on wheels points, rad; null for another one. */
  heading(episode, step, robot) {
    return this.worlds.robots[robot].has_wheels ? this.momentOf(step, robot).headings[robot][0] : null;
  }

  served(episode, step, { id }) {
    return this.moment(step).victims.find((one) => one.id === id)?.served ?? 0;
  }

  waits(episode, step, { id }) {
    return this.moment(step).victims.find((one) => one.id === id)?.waits ?? false;
  }

  isBlocked(episode, step, robot) {
    return this.momentOf(step, robot).blocked[robot];
  }

  weight(episode, step, head, robot, other) {
    const { attention } = this.moment(step);
    if (!attention) return NaN;
    if (head >= 0) return attention[head][robot][other];
    return attention.reduce((sum, one) => sum + one[robot][other], 0) / attention.length;
  }

  faultsAt(episode, step, robot) {
    return Object.entries(this.now.faults[robot]).map(([kind, value]) => (
      { robot, kind: this.kindNumbers[kind], value }
    ));
  }

  charge(episode, step, robot) {
    return this.now.charge?.[robot] ?? 1;
  }

  load(episode, step, robot) {
    return Math.round((this.now.load?.[robot] ?? 1) * this.worlds.robots[robot].load);
  }

  hears(episode, step, robot, other) {
    return this.moment(step).heard[robot][other] === 1;
  }

  /** What a ray of a robot's range sensor reads: 1 - distance / range; 0: it meets nothing. */
  reading(episode, step, robot, ray) {
    return this.momentOf(step, robot).rays[robot][ray];
  }

  isAway(episode, step, robot) {
    return this.now.faults[robot].unavailable >= 1;
  }

  /** Whether a robot is a spare one that was not in the arena at a moment. */
  isOutside({ faults }, robot) {
    return Boolean(this.worlds.robots[robot].is_spare) && faults[robot].unavailable >= 1;
  }

  /** The robots to show now: all but spare ones outside. */
  get team() {
    return this.worlds.robots.filter(({ index }) => !this.isOutside(this.now, index));
  }

  distance(episode, step, robot) {
    if (this.isOutside(this.moment(step), robot)) return NaN;
    return distanceToVictim(this, episode, step, robot);
  }

  rescuesUntil(episode, step, robot) {
    return robot < 0 ? this.now.rescued : this.now.helped[robot];
  }

  /** Abilities that victims need and robots that are not out do not offer, with the victims' tasks. */
  hopeless() {
    const { robots, tasks } = this.worlds, found = new Map();
    const there = robots.filter(({ index }) => !this.isAway(0, this.last, index));
    for (const { task } of this.now.victims) {
      for (const need of tasks[task].needs) {
        if (this.worlds.isReached(task, need, there)) continue;
        found.set(need, (found.get(need) ?? new Set()).add(`victims of ${tasks[task].name}`));
      }
    }
    return [...found].map(([need, waiting]) => [need, [...waiting]]);
  }

  /** Faults since a step, as {robot, kind, value, start, end}; one that goes on ends after the last. */
  faultSpells(from) {
    const open = new Map(), found = [];
    for (const { step, faults } of this.moments) {
      if (step < from) continue;
      faults.forEach((wrong, robot) => {
        for (const kind in this.kindNumbers) {
          const key = `${robot} ${kind}`, spell = open.get(key), value = wrong[kind];
          if (spell?.value === value || (kind === "unavailable" && this.worlds.robots[robot].is_spare)) continue;
          if (spell) spell.end = step;
          open.delete(key);
          if (value === undefined) continue;
          open.set(key, { robot, kind: this.kindNumbers[kind], value, start: step, end: this.last + 1 });
          found.push(open.get(key));
        }
      });
    }
    return found;
  }

  /** The last steps as a run of its own, for charts. */
  recent(steps) {
    const from = Math.max(this.first, this.last + 1 - steps), { worlds, heads, attention } = this;
    const { length: size } = this.team;
    const shift = (step) => step - from;
    const rescues = this.rescues[0].filter((one) => one.step >= from);
    const handoffs = this.handoffs[0].filter((one) => one.second >= from);
    const faults = this.faultSpells(from).map((one) => ({ ...one, start: shift(one.start), end: shift(one.end) }));
    return {
      worlds, size, heads, attention, rewards: [], lengths: [this.last + 1 - from],
      faults: [faults],
      rescues: [rescues.map((one) => ({ ...one, step: shift(one.step) }))],
      handoffs: [handoffs.map((one) => (
        { ...one, first: Math.max(shift(one.first), 0), second: shift(one.second) }
      ))],
      weight: (episode, step, ...rest) => this.weight(episode, step + from, ...rest),
      distance: (episode, step, robot) => this.distance(episode, step + from, robot),
    };
  }
}
