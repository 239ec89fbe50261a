// A trained team that acts in the page.

/** Numbers that look random, and follow from a seed alone. */
class Draws {
  constructor(seed) {
    this.state = seed >>> 0;
  }

  /** The next one, above 0 and below 1. */
  next() {
    this.state = (this.state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(this.state ^ (this.state >>> 15), 1 | this.state);
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
    return (((mixed ^ (mixed >>> 14)) >>> 0) + 0.5) / 4294967296;
  }

  /** The next one of a normal distribution. */
  normal() {
    return Math.sqrt(-2 * Math.log(this.next())) * Math.cos(2 * Math.PI * this.next());
  }
}

/** A trained team: every robot sees its own row of numbers and chooses its own action. */
class Team {
  /** `described` is of innerattn.report.page.one_team; `numbers` are its weights, a Float32Array. */
  constructor(name, described, numbers) {
    Object.assign(this, { name }, described, { tensors: new Tensors(described.tensors, numbers, described.rows) });
    this.robots = this.rows.length;
    this.frame = new Frame(described.frame);
    const encoder = (layer) => new Encoder(this.tensors, layer, this.entities, this.pooling);
    this.first = encoder("actor.first");
    this.memory = Memory.in(this.tensors, "actor.memory");
    this.messages = this.hearing ? new Messages(this.tensors, encoder("actor.messages.encoder"), this.hearing) : null;
    this.critic = this.heads ? new Attention(this) : null;
    this.reset(0);
  }

  /** Begins an episode. */
  reset(seed) {
    this.draws = new Draws(seed);
    for (const part of [this.memory, this.messages, this.critic]) part?.forget();
  }

  /** The actions of all robots for their observations, R × D, which they remember from now on. */
  act(obs) {
    return this.outputs(obs).map((one) => this.chosen(one));
  }

  /** What the policies of all robots give for one more step of the world. */
  outputs(obs) {
    const rows = this.rowsIn(obs), heard = this.messages?.heard(rows.map((row) => this.seen(row))) ?? [];
    return rows.map((row, robot) => this.logits(robot, row, heard[robot]));
  }

  rowsIn(obs) {
    return Array.from({ length: this.robots }, (_, robot) => this.row(obs, robot));
  }

  row(obs, robot) {
    return obs.subarray(robot * this.width, (robot + 1) * this.width);
  }

  /** A row in its frame, and the element that turned it. */
  seen(row) {
    const turn = this.frame.of(row);
    return { row: this.frame.turned(row, turn), turn };
  }

  /** The likeliest action, or a drawn one. */
  chosen(outputs) {
    if (this.continuous) {
      const [x, y, ...logStd] = outputs;
      const away = logStd.map((one) => (this.greedy ? 0 : Math.exp(one) * this.draws.normal()));
      return [x, y].map((mean, axis) => Math.fround(Math.tanh(mean + away[axis])));
    }
    const worth = this.greedy ? outputs : outputs.map((logit) => logit - Math.log(-Math.log(this.draws.next())));
    return worth.reduce((best, one, action) => (one > worth[best] ? action : best), 0);
  }

  /** What a robot's policy gives for the actions of the world: their logits, or means and log standard deviations. */
  logits(robot, row, heard = []) {
    const { row: turned, turn } = this.seen(row), known = [...turned, ...heard];
    this.critic?.see(robot, turned, turn);
    if (this.memory) known.push(...this.memory.after(robot, known, turn));
    const hidden = leaky(this.tensors.layer("actor.second", robot, leaky(this.first.of(robot, known))));
    const outputs = this.frame.back(this.spread(this.tensors.layer("actor.output", robot, hidden)), robot, turn);
    const stays = this.able.some((column) => !(row[column] > 0));
    return stays ? outputs.map((logit, action) => (action ? HIDDEN : logit)) : outputs;
  }

  /** Outputs with log standard deviations in the place of what they are made of, where actions are vectors. */
  spread(outputs) {
    if (!this.continuous) return outputs;
    const { lowest, highest, shift } = this.logStd;
    return outputs.map((value, at) => (at < 2 ? value : lowest + (highest - lowest) * sigmoid(value + shift)));
  }

  /** What the critic of each robot looks at: weights by head, robot and teammate; null without attention. */
  attention(obs, actions) {
    return this.critic && this.robots > 1 ? this.critic.weights(this.rowsIn(obs), actions) : null;
  }
}
