// Layers of networks that act in the page, over lists of numbers.

const SLOPE = 0.01; // of leaky ReLU

function leaky(values) {
  return values.map((value) => (value > 0 ? value : SLOPE * value));
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

/** Sums of numbers times those of another list. */
function dot(one, other) {
  return one.reduce((sum, value, at) => sum + value * other[at], 0);
}

/** Shares that add up to 1; none of nothing. */
function softmax(scores) {
  const most = Math.max(...scores), powers = scores.map((score) => Math.exp(score - most));
  const sum = powers.reduce((all, power) => all + power, 0);
  return powers.map((power) => power / sum);
}

/** The sum of some lists of so many numbers, each times its weight. */
function weighted(lists, weights, width) {
  return Array.from({ length: width }, (_, at) => lists.reduce((sum, one, index) => sum + weights[index] * one[at], 0));
}

/** The largest of each number of some lists; zeros of none. */
function largestOf(lists, width) {
  return Array.from({ length: width }, (_, at) => (lists.length ? Math.max(...lists.map((one) => one[at])) : 0));
}

/** The arrays of a team's networks. Most have a part for each robot, or for each kind of robots. */
class Tensors {
  /** `places`: where each array begins in `numbers`, and its shape; `rows`: which part each robot has. */
  constructor(places, numbers, rows) {
    this.rows = rows;
    this.all = Object.fromEntries(Object.entries(places).map(([name, { begin, shape }]) => (
      [name, { shape, values: numbers.subarray(begin, begin + shape.reduce((all, one) => all * one, 1)) }]
    )));
  }

  has(name) {
    return name in this.all;
  }

  shape(name) {
    return this.all[name].shape;
  }

  /** weight x + bias of a layer that each robot, or each kind, has of its own. */
  layer(name, robot, values) {
    const { shape: [, outputs, inputs], values: weight } = this.all[`${name}.weight`];
    const bias = this.all[`${name}.bias`].values, row = this.rows[robot];
    return product(weight, row * outputs * inputs, outputs, values).map((sum, output) => (
      sum + bias[row * outputs + output]
    ));
  }

  /** weight x of a matrix that all robots share. */
  times(name, values) {
    const { shape, values: weight } = this.all[name];
    return product(weight, 0, shape.at(-2), values);
  }
}
