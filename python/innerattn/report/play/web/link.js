// Messages to what answers this page, one after the other.

const SCHEMA_VERSION = 1;

/** What was refused, in its words; `ended`: the session is over. */
class Refusal extends Error {
  constructor(text, ended = false) {
    super(text);
    this.ended = ended;
  }
}

class Link {
  /** `transport` has ask(path, message), leave(path) and lost(error). */
  constructor(transport) {
    Object.assign(this, { transport, session: "", waiting: 0, tail: Promise.resolve(), sent: 0 });
  }

  /** Begins a session; gives the opening document. */
  async open() {
    const opened = await this.post("sessions", {});
    this.session = opened.session;
    return opened;
  }

  get busy() {
    return this.waiting > 0;
  }

  /** Sends a message after all earlier ones; gives the state. */
  send(message) {
    this.waiting++;
    const answer = this.tail.then(() => this.post(`sessions/${this.session}`, message));
    this.tail = answer.catch(() => {}).then(() => this.waiting--);
    return answer;
  }

  /** Says that the page goes away. */
  end() {
    if (this.session) this.transport.leave(`sessions/${this.session}`);
    this.session = "";
  }

  async post(path, message) {
    this.sent = performance.now();
    const document = await this.transport.ask(path, message);
    if (document.schema_version !== SCHEMA_VERSION) {
      throw new Error(`the server speaks version ${document.schema_version}, this page ${SCHEMA_VERSION}`);
    }
    return document;
  }
}
