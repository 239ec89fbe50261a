// What robots say to each other, and what each makes of what it hears: see innerattn.nn.message.

/** The messages of a team; half of each is vectors, which turn into the frame of who hears them. */
class Messages {
  /** `hearing`: how rows say whom a robot hears, as of innerattn.nn.message.Hearing, and the pooling. */
  constructor(tensors, encoder, hearing) {
    Object.assign(this, { tensors, encoder, hearing });
    [, this.width] = tensors.shape("actor.messages.output.weight");
    this.forget();
  }

  /** Begins an episode, before which nobody said anything. */
  forget() {
    this.past = Array(this.hearing.delay).fill(null);
  }

  /** What each robot hears; `now`: what each sees in its frame, and the element that turned it. */
  heard(now) {
    this.past.push(now);
    const said = this.past.shift();
    if (!said) return now.map(() => Array(this.width).fill(0));
    const encoded = said.map(({ row }, robot) => leaky(this.encoder.of(robot, row)));
    const messages = encoded.map((one, robot) => (
      this.tensors.layer("actor.messages.output", robot, one).map(Math.tanh)
    ));
    return now.map((seen, robot) => {
      const others = messages.flatMap((message, other) => {
        const mate = other < robot ? other : other - 1;
        if (other === robot || !this.hears(seen.row, mate, said[other].row)) return [];
        return { message: turnedHalf(message, between(said[other].turn, seen.turn)), mate };
      });
      return this.pooled(robot, seen.row, others, this.hearing.delay ? null : encoded[robot]);
    });
  }

  /** Whether a robot hears what a teammate said. */
  hears(row, mate, said) {
    const { sends, heard } = this.hearing;
    return said[sends] > YES && (!heard.length || row[heard[mate]] > YES);
  }

  pooled(robot, row, others, encoded) {
    const messages = others.map(({ message }) => message);
    if (!messages.length) return Array(this.width).fill(0);
    if (this.hearing.pooling === "max") return largestOf(messages, this.width);
    return weighted(messages, this.weights(robot, row, others, encoded), this.width);
  }

  /** How much each message that a robot hears counts. */
  weights(robot, row, others, encoded) {
    const { pooling, places, seen } = this.hearing;
    if (pooling === "mean") return others.map(() => 1 / others.length);
    if (pooling === "nearest") {
      const isSeen = (mate) => !seen.length || row[seen[mate]] > YES;
      const away = others.map(({ mate }) => (isSeen(mate) ? squareOf(row, places[mate]) : Infinity));
      const nearest = away.map((one) => one === Math.min(...away)), count = nearest.filter(Boolean).length;
      return nearest.map((isOne) => (isOne ? 1 / count : 0));
    }
    const asked = this.tensors.layer("actor.messages.query", robot, encoded ?? leaky(this.encoder.of(robot, row)));
    return softmax(others.map(({ message }) => dot(asked, message) / Math.sqrt(this.width)));
  }
}
