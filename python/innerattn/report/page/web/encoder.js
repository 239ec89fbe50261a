// The first layer of a network: of a whole row, or of its entities one by one; see innerattn.nn.encoder.

const HEAD_WIDTH = 8;
const YES = 0.5;

/** Maps a robot's row, perhaps with more columns of the robot behind it. */
class Encoder {
  /** `entities`: whose columns are whose, as innerattn.policies.exported.contract has it; null: it takes whole rows. */
  constructor(tensors, name, entities, pooling) {
    Object.assign(this, { tensors, name, entities, pooling });
  }

  of(robot, row) {
    if (!this.entities) return this.tensors.layer(this.name, robot, row);
    const { own, teammates, teammate, victims, victim, ...told } = this.entities;
    const from = own + teammates * teammate, end = from + victims * victim;
    const layer = (part, values) => this.tensors.layer(`${this.name}.${part}`, robot, values);
    const itself = leaky(layer("own", [...row.slice(0, own), ...row.slice(end)])), width = itself.length;
    const asked = this.pooling === "attention" ? layer("query", itself) : [];
    const pooled = (part, blocks, place, query) => {
      const encodings = blocks.map((block) => leaky(layer(part, block)));
      return this.pooled(encodings, blocks, place, query, width);
    };
    const waiting = blocksOf(row, from, victims, victim).filter((one) => one[told.present] > YES);
    const parts = [itself, pooled("victim", waiting, told.victim_place, asked.slice(0, width))];
    if (teammates) {
      const known = blocksOf(row, own, teammates, teammate).filter((one) => this.isKnown(one));
      parts.push(pooled("teammate", known, told.teammate_place, asked.slice(width)));
    }
    return layer("output", parts.flat());
  }

  /** Whether something is known of a teammate. */
  isKnown(block) {
    const { seen } = this.entities;
    if (seen !== null) return block[seen] > YES;
    return this.pooling === "attention" || block.some((value) => value !== 0);
  }

  /** What is made of the encodings of the entities that are there, of so many numbers each. */
  pooled(encodings, blocks, place, query, width) {
    if (!encodings.length) return Array(width).fill(0);
    if (this.pooling === "max") return largestOf(encodings, width);
    if (this.pooling === "mean") return weighted(encodings, encodings.map(() => 1 / encodings.length), width);
    if (this.pooling === "nearest") {
      const away = blocks.map((block) => squareOf(block, place));
      return encodings[away.indexOf(Math.min(...away))];
    }
    return Array.from({ length: width / HEAD_WIDTH }, (_, head) => {
      const part = (values) => values.slice(head * HEAD_WIDTH, (head + 1) * HEAD_WIDTH), some = encodings.map(part);
      const scores = some.map((one) => dot(part(query), one) / Math.sqrt(HEAD_WIDTH));
      return weighted(some, softmax(scores), HEAD_WIDTH);
    }).flat();
  }
}

/** Some columns from a place on, cut into blocks. */
function blocksOf(row, begin, count, width) {
  return Array.from({ length: count }, (_, index) => row.slice(begin + index * width, begin + (index + 1) * width));
}

/** The square of the distance that two columns give, rounded as training rounds it. */
function squareOf(row, [x, y]) {
  return Math.fround(Math.fround(row[x] * row[x]) + Math.fround(row[y] * row[y]));
}
