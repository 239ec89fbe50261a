// The worlds themselves: Rust, compiled to WebAssembly. Numbers go in and out as lists.

// The quantities of rust_env/wasm/src/place.rs, in their order.
const QUANTITIES = [
  "observations", "positions", "velocities", "headings", "charges", "loads", "heard", "faults", "victims",
  "obstacles", "rescues", "losses", "counts", "ways", "motion",
];
const REFUSED = -1;

/** The bytes of a text in base64. */
function bytesOf(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let index = 0; index < text.length; index++) bytes[index] = text.charCodeAt(index);
  return bytes;
}

/** What was compressed with gzip. */
async function unpacked(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The module; it makes worlds. */
class Rust {
  static async load(code) {
    const { instance } = await WebAssembly.instantiate(code, {});
    return new Rust(instance.exports);
  }

  constructor(exports) {
    this.exports = exports;
  }

  /** A world of a scenario, as JSON, under a seed, a BigInt. */
  open(scenario, seed) {
    const bytes = new TextEncoder().encode(scenario), place = this.exports.text(bytes.length);
    new Uint8Array(this.exports.memory.buffer, place, bytes.length).set(bytes);
    return new RustWorld(this, this.checked(this.exports.open(BigInt.asIntN(64, seed))));
  }

  /** An answer that is no refusal. */
  checked(answer) {
    if (answer !== REFUSED) return answer;
    const { text_place: place, text_length: length, memory } = this.exports;
    throw new Refusal(new TextDecoder().decode(new Uint8Array(memory.buffer, place(), length())));
  }
}

/** One world. */
class RustWorld {
  constructor(rust, number) {
    Object.assign(this, { rust, number });
  }

  close() {
    this.rust.exports.close(this.number);
  }

  /** Begins the next episode, or episode 0 of a seed. */
  restart(seed) {
    const { exports } = this.rust;
    if (seed === undefined) this.rust.checked(exports.restart(this.number));
    else this.rust.checked(exports.restart_with(this.number, BigInt.asIntN(64, seed)));
  }

  /** Does a control step; gives whether the episode is over, and the next has begun. */
  step(actions) {
    this.write(actions);
    return this.rust.checked(this.rust.exports.step(this.number)) === 1;
  }

  take(name) {
    const { exports } = this.rust;
    const count = this.rust.checked(exports.take(this.number, QUANTITIES.indexOf(name)));
    return new Float64Array(exports.memory.buffer, exports.numbers_place(), count).slice();
  }

  put(name, values) {
    this.write(values);
    this.rust.checked(this.rust.exports.put(this.number, QUANTITIES.indexOf(name)));
  }

  write(values) {
    const { exports } = this.rust, place = exports.numbers(values.length);
    new Float64Array(exports.memory.buffer, place, values.length).set(values);
  }
}

/** A list as rows of some numbers. */
function rowsOf(values, width) {
  return Array.from({ length: values.length / width }, (_, row) => (
    Array.from(values.subarray(row * width, (row + 1) * width))
  ));
}
