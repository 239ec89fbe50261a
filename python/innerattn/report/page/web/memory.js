// What robots remember from step to step of an episode: see innerattn.nn.memory.

const sigmoid = (value) => 1 / (1 + Math.exp(-value));

/** A gated recurrent unit for each robot. */
class Memory {
  /** The one with such a name in a team's networks; null: they have none. */
  static in(tensors, name) {
    return tensors.has(`${name}.of_past.weight`) ? new Memory(tensors, name) : null;
  }

  constructor(tensors, name) {
    const [, , width] = tensors.shape(`${name}.of_past.weight`);
    Object.assign(this, { tensors, name, width });
    this.forget();
  }

  /** Begins an episode. */
  forget() {
    this.past = new Map();
  }

  /** What a robot remembers once it has seen one more row, in the frame of that row; kept as it lies in the world. */
  after(robot, row, turn) {
    const past = turnedHalf(this.past.get(robot) ?? Array(this.width).fill(0), turn);
    const read = this.gates("of_input", robot, row), recalled = this.gates("of_past", robot, past);
    const found = past.map((old, at) => {
      const [reset, kept] = [0, 1].map((gate) => sigmoid(read[gate][at] + recalled[gate][at]));
      const fresh = Math.tanh(read[2][at] + reset * recalled[2][at]);
      return fresh + kept * (old - fresh);
    });
    this.past.set(robot, turnedHalf(found, inverseOf(turn)));
    return found;
  }

  /** Three lists: for what is forgotten, for what is kept, and for what is new. */
  gates(part, robot, values) {
    const found = this.tensors.layer(`${this.name}.${part}`, robot, values);
    return blocksOf(found, 0, 3, this.width);
  }
}
