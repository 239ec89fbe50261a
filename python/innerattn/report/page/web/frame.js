// The frames that robots see and act in: see innerattn.policies.exported.frame. An element of the group is a number
// 0 to 7: bit 0 mirrors x, bit 1 y, and bit 2 then swaps both.

/** The element that turns back what another one turns. */
function inverseOf(turn) {
  return turn & 4 ? 4 + 2 * (turn & 1) + ((turn >> 1) & 1) : turn;
}

/** The element that turns what one has turned into what another one turns. */
function between(first, second) {
  const mirrors = (first ^ second) & 3, swap = (first ^ second) & 4;
  return swap + (first & 4 ? ((mirrors & 1) << 1) + (mirrors >> 1) : mirrors);
}

/** Numbers of a memory or a message in a turned world: half of them stay, then come x and last y of vectors. */
function turnedHalf(values, turn) {
  const quarter = values.length / 4;
  const plain = values.slice(0, 2 * quarter), x = values.slice(2 * quarter, 3 * quarter), y = values.slice(3 * quarter);
  const mirrored = [x.map((one) => (turn & 1 ? -one : one)), y.map((one) => (turn & 2 ? -one : one))];
  return [...plain, ...(turn & 4 ? mirrored.reverse() : mirrored).flat()];
}

/** Turns what robots see into their frames, and actions there and back. */
class Frame {
  /** `tables` are of innerattn.report.page.one_team; null: robots see the world as it is. */
  constructor(tables) {
    this.tables = tables;
  }

  /** The element that brings a row into its frame. */
  of(row) {
    if (!this.tables) return 0;
    const x = this.tables.x.map((column) => row[column]), y = this.tables.y.map((column) => row[column]);
    const isNegative = (values) => (values.find((value) => value !== 0) ?? 0) < 0;
    const mirrorX = isNegative(x), mirrorY = isNegative(y);
    const apart = x.map((value, at) => (mirrorX ? -value : value) - (mirrorY ? -y[at] : y[at]));
    return Number(mirrorX) + 2 * Number(mirrorY) + 4 * Number(isNegative(apart));
  }

  turned(row, turn) {
    if (!this.tables) return Array.from(row);
    const { signs, order } = this.tables, mirrored = Array.from(row, (value, at) => value * signs[turn][at]);
    return order[turn].map((column) => mirrored[column]);
  }

  /** What a robot's policy gives in its frame, for the actions of the world. */
  back(outputs, robot, turn) {
    if (!this.tables) return outputs;
    const { names, mirrors } = this.tables;
    return names[robot][turn].map((name, at) => outputs[name] * (mirrors ? mirrors[robot][turn][at] : 1));
  }

  /** A robot's action, a number or a vector, as its frame has it. */
  action(taken, robot, turn) {
    if (!this.tables) return taken;
    const names = this.tables.names[robot][turn], { mirrors } = this.tables;
    if (!mirrors) return names[taken];
    return taken.reduce((found, one, at) => ((found[names[at]] = one * mirrors[robot][turn][at]), found), []);
  }
}
