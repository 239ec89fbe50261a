// A policy for any team that acts in the page: see innerattn.policies.exported.pair_network.

const SHARPNESS = 10;
const LARGEST_LOGIT = 20;
const ALMOST_NOTHING = 1e-9;

const rectified = (values) => values.map((value) => Math.max(value, 0));
const largest = (one, other) => one.map((value, at) => Math.max(value, other[at]));

/** The logarithm of the sum of exponentials. */
function logSum(values) {
  const most = Math.max(...values);
  return most + Math.log(values.reduce((sum, value) => sum + Math.exp(value - most), 0));
}

/** What stay, +x, -x, +y and -y of the world are called in a frame. */
function namesIn(frame) {
  let [stay, right, left, up, down] = frame & 4 ? [0, 3, 4, 1, 2] : [0, 1, 2, 3, 4];
  if (frame & 1) [right, left] = [left, right];
  if (frame & 2) [up, down] = [down, up];
  return [stay, right, left, up, down];
}

const NAMES = Array.from({ length: 8 }, (_, frame) => namesIn(frame));

/** Log-probabilities of actions in the world; a proposal is its weight's logarithm and those of its actions. */
function mixture(proposals, frames) {
  const total = logSum(proposals.map(([weight]) => weight));
  const rows = proposals.map(([weight, ...choices], at) => {
    const rest = weight - total - logSum(choices);
    return NAMES[frames[at]].map((name) => choices[name] + rest);
  });
  return rows[0].map((_, action) => logSum(rows.map((row) => row[action])));
}

/** All robots have one network; each looks at its own row. */
class AnyTeam extends Team {
  /** `described` is of innerattn.report.page.any_team. */
  constructor(name, described, numbers) {
    super(name, described, numbers);
    this.views = this.rows.map((_, robot) => new Relating(this.known, robot));
  }

  /** The log-probabilities of a robot's actions in the world. */
  logits(robot, row) {
    const seen = this.views[robot].relate(row), { proposed, own } = this.proposed(seen);
    const home = this.layer("home_out", rectified(this.layer("home", [...seen.home, ...own])));
    const proposals = [...proposed, home].map((one) => one.map((value) => SHARPNESS * value));
    return mixture(proposals, [...seen.frames, seen.homeFrame]);
  }

  /** Weight and actions of each own pair, and what the robot makes of all. */
  proposed({ cells, at, masks, times, turning }) {
    const [, width] = this.tensors.shape("first.weight"), nothing = Array(width).fill(0);
    if (!at.length) return { proposed: [], own: nothing };
    const hidden = (name, values) => rectified(this.layer(name, values));
    const mostOf = (rows) => this.rows.map((_, robot) => (
      rows.map((robots) => robots[robot]).filter(Boolean).reduce(largest, nothing)
    ));
    const first = cells.map((robots) => robots.map((columns) => columns && hidden("first", columns)));
    const most = mostOf(first);
    const second = first.map((robots) => robots.map((row, robot) => row && hidden("second", [...row, ...most[robot]])));
    const further = mostOf(second);
    // From here on the robot's own victims count, first for all robots there.
    const third = at.map((victim, pair) => {
      const there = second[victim].map((row) => row || nothing);
      return second[victim].map((row, robot) => {
        if (!row) return nothing;
        const others = this.others("", robot, there, masks[pair], times[victim]);
        return hidden("third", [...row, ...others, ...further[robot]]);
      });
    });
    const own = third.map(([mine]) => mine).reduce(largest, nothing);
    const proposed = at.map((victim, pair) => {
      const others = this.others("_again", 0, third[pair], masks[pair], times[victim]);
      const parts = [...cells[victim][0], ...turning[pair], ...third[pair][0], ...others, ...own];
      return this.layer("out", hidden("fifth", hidden("fourth", parts)));
    });
    return { proposed, own };
  }

  /** What a robot's pair at a victim makes of those of its rivals and of its partners there. */
  others(suffix, robot, there, [rivals, partners], times) {
    return [
      ...this.pooled(`rivals${suffix}`, there[robot], there, rivals[robot], times),
      ...this.pooled(`partners${suffix}`, there[robot], there, partners[robot], times),
    ];
  }

  /** What a pair at a victim makes of those of the robots there that a mask shows. */
  pooled(name, asking, there, mask, times) {
    const robots = mask.flatMap((shown, robot) => (shown ? [robot] : [])), nothing = there[0].map(() => 0);
    const sum = (weights) => nothing.map((_, at) => (
      robots.reduce((all, robot, index) => all + weights[index] * there[robot][at], 0)
    ));
    if (!robots.length) return nothing;
    if (this.pooling === "max") return robots.map((robot) => there[robot]).reduce(largest, nothing);
    if (this.pooling === "mean") return sum(robots.map(() => 1 / robots.length));
    if (this.pooling === "nearest") {
      return there[robots.reduce((best, robot) => (times[robot] < times[best] ? robot : best))];
    }
    const query = this.layer(`${name}.query`, asking), scale = 1 / Math.sqrt(query.length);
    const powers = robots.map((robot) => {
      const logit = scale * dot(query, this.tensors.times(`${name}.key.weight`, there[robot]));
      return Math.exp(Math.min(logit, LARGEST_LOGIT));
    });
    const total = powers.reduce((all, power) => all + power, 0) + ALMOST_NOTHING;
    return sum(powers.map((power) => power / total));
  }

  /** The outputs of a layer of the one network. */
  layer(name, values) {
    return this.tensors.layer(name, 0, values);
  }

  /** Its critic has none. */
  attention() {
    return null;
  }
}
