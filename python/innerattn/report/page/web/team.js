// A trained team that acts in the page, and its critic's attention.

const SLOPE = 0.01; // of leaky ReLU
const HIDDEN = -1e30;

function leaky(values) {
  return values.map((value) => (value > 0 ? value : SLOPE * value));
}

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
}

/** A trained team: every robot sees its own row of numbers and chooses its own action. */
class Team {
  /** `described` is of innerattn.report.page.team; `numbers` are its weights, a Float32Array. */
  constructor(name, described, numbers) {
    Object.assign(this, { name }, described);
    this.robots = this.rows.length;
    this.tensors = Object.fromEntries(Object.entries(described.tensors).map(([key, { begin, shape }]) => (
      [key, { shape, values: numbers.subarray(begin, begin + shape.reduce((all, one) => all * one, 1)) }]
    )));
    this.reset(0);
  }

  reset(seed) {
    this.draws = new Draws(seed);
  }

  /** The actions of all robots for their observations, R × D. */
  act(obs) {
    return Array.from({ length: this.robots }, (_, robot) => this.chosen(this.logits(robot, this.row(obs, robot))));
  }

  row(obs, robot) {
    return obs.subarray(robot * this.width, (robot + 1) * this.width);
  }

  chosen(logits) {
    const worth = this.greedy ? logits : logits.map((logit) => logit - Math.log(-Math.log(this.draws.next())));
    return worth.reduce((best, one, action) => (one > worth[best] ? action : best), 0);
  }

  /** The logits of a robot's actions in the world. */
  logits(robot, row) {
    const element = this.element(row), layer = (name, values) => this.layer(`actor.${name}`, robot, values);
    const hidden = leaky(layer("second", leaky(layer("first", this.turned(row, element)))));
    const inside = layer("output", hidden);
    return this.frame ? inside.map((_, action) => inside[this.frame.forward[element][action]]) : inside;
  }

  /** What the critic of each robot looks at: weights by head, robot and teammate; null without attention. */
  attention(obs, actions) {
    const robots = Array.from({ length: this.robots }, (_, robot) => robot);
    if (!this.heads || this.robots < 2) return null;
    const there = robots.map((robot) => (
      this.available < 0 || this.row(obs, robot)[this.available] > 0.5
    ));
    const seen = (one, other) => one !== other && there[other];
    if (this.uniform) {
      const share = (one) => 1 / Math.max(robots.filter((other) => seen(one, other)).length, 1);
      const weights = robots.map((one) => robots.map((other) => (seen(one, other) ? share(one) : 0)));
      return Array.from({ length: this.heads }, () => weights);
    }
    const encoded = robots.map((robot) => this.encoded(obs, robot, actions[robot]));
    const depth = encoded[0].query.length / this.heads;
    return Array.from({ length: this.heads }, (_, head) => robots.map((one) => {
      const score = (other) => {
        let sum = 0;
        for (let at = head * depth; at < (head + 1) * depth; at++) {
          sum += encoded[one].query[at] * encoded[other].key[at];
        }
        return sum / Math.sqrt(depth);
      };
      const scores = robots.map((other) => (seen(one, other) ? score(other) : HIDDEN));
      const most = Math.max(...scores);
      const powers = scores.map((value, other) => (seen(one, other) ? Math.exp(value - most) : 0));
      const sum = powers.reduce((all, power) => all + power, 0) || 1;
      return powers.map((power) => power / sum);
    }));
  }

  /** A robot's question to its teammates, and what it shows them. */
  encoded(obs, robot, action) {
    const row = this.row(obs, robot), element = this.element(row), turned = this.turned(row, element);
    const taken = this.frame ? this.frame.forward[element][action] : action;
    const doing = Array.from({ length: this.actions }, (_, one) => Number(one === taken));
    const own = leaky(this.layer("critic.state_encoder", robot, turned));
    const other = leaky(this.layer("critic.action_encoder", robot, [...turned, ...doing]));
    return { query: this.times("critic.attention.query", own), key: this.times("critic.attention.key", other) };
  }

  /** weight x + bias of a layer that each robot, or each kind, has of its own. */
  layer(name, robot, values) {
    const { shape: [, outputs, inputs], values: weight } = this.tensors[`${name}.weight`];
    const bias = this.tensors[`${name}.bias`].values, row = this.rows[robot];
    return product(weight, row * outputs * inputs, outputs, values).map((sum, output) => (
      sum + bias[row * outputs + output]
    ));
  }

  times(name, values) {
    const { shape: [outputs], values: weight } = this.tensors[name];
    return product(weight, 0, outputs, values);
  }

  /** Which turn of the world brings a row into its frame: bit 0 mirrors x, bit 1 y, bit 2 swaps both. */
  element(row) {
    if (!this.frame) return 0;
    const x = this.frame.x.map((column) => row[column]), y = this.frame.y.map((column) => row[column]);
    const isNegative = (values) => (values.find((value) => value !== 0) ?? 0) < 0;
    const mirrorX = isNegative(x), mirrorY = isNegative(y);
    const apart = x.map((value, at) => (mirrorX ? -value : value) - (mirrorY ? -y[at] : y[at]));
    return Number(mirrorX) + 2 * Number(mirrorY) + 4 * Number(isNegative(apart));
  }

  turned(row, element) {
    if (!this.frame) return Array.from(row);
    const { signs, order } = this.frame, mirrored = Array.from(row, (value, at) => value * signs[element][at]);
    return order[element].map((column) => mirrored[column]);
  }
}

/** Sums of weights times values, for some rows of a matrix that begin at a place. */
function product(weight, begin, outputs, values) {
  const count = values.length;
  return Array.from({ length: outputs }, (_, output) => {
    let sum = 0;
    for (let at = 0, place = begin + output * count; at < count; at++) sum += weight[place + at] * values[at];
    return sum;
  });
}
