// What the critic of each robot looks at: see innerattn.nn.critic and innerattn.nn.attention.

const HIDDEN = -1e30;

/** The attention of a team's critic. */
class Attention {
  constructor(team) {
    const { tensors, entities, pooling } = team;
    const encoder = (name) => new Encoder(tensors, `critic.${name}`, entities, pooling);
    Object.assign(this, { team, tensors, state: encoder("state_encoder"), action: encoder("action_encoder") });
    this.memory = Memory.in(tensors, "critic.memory");
    this.forget();
  }

  /** Begins an episode. */
  forget() {
    this.memory?.forget();
    this.remembered = new Map();
  }

  /** Remembers what a robot sees in its frame. */
  see(robot, row, turn) {
    if (this.memory) this.remembered.set(robot, this.memory.after(robot, row, turn));
  }

  /** Weights by head, robot and teammate, for what robots see and do. */
  weights(rows, actions) {
    const { heads, available, uniform } = this.team, robots = [...rows.keys()];
    const there = rows.map((row) => available < 0 || row[available] > 0.5);
    const seen = (one, other) => one !== other && there[other];
    if (uniform) {
      const share = (one) => 1 / Math.max(robots.filter((other) => seen(one, other)).length, 1);
      const weights = robots.map((one) => robots.map((other) => (seen(one, other) ? share(one) : 0)));
      return Array.from({ length: heads }, () => weights);
    }
    const encoded = robots.map((robot) => this.encoded(rows[robot], robot, actions[robot]));
    const depth = encoded[0].query.length / heads;
    return Array.from({ length: heads }, (_, head) => robots.map((one) => {
      const part = (values) => values.slice(head * depth, (head + 1) * depth);
      const score = (other) => dot(part(encoded[one].query), part(encoded[other].key)) / Math.sqrt(depth);
      const scores = robots.map((other) => (seen(one, other) ? score(other) : HIDDEN));
      return softmax(scores).map((share, other) => (seen(one, other) ? share : 0));
    }));
  }

  /** A robot's question to its teammates, and what it shows them. */
  encoded(row, robot, action) {
    const { frame, continuous, actions } = this.team, turn = frame.of(row), taken = frame.action(action, robot, turn);
    const doing = continuous ? taken : Array.from({ length: actions }, (_, one) => Number(one === taken));
    const known = [...frame.turned(row, turn), ...(this.remembered.get(robot) ?? [])];
    const own = leaky(this.state.of(robot, known)), other = leaky(this.action.of(robot, [...known, ...doing]));
    const through = (matrix, values) => this.tensors.times(`critic.attention.${matrix}`, values);
    return { query: through("query", own), key: through("key", other) };
  }
}
