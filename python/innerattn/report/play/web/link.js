// Messages to the server, one after the other.

const SCHEMA_VERSION = 1;

/** What the server refused, in its words; `ended`: the session is over. */
class Refusal extends Error {
  constructor(text, status) {
    super(text);
    this.ended = status === 410;
  }
}

class Link {
  constructor() {
    Object.assign(this, { session: "", waiting: 0, tail: Promise.resolve(), sent: 0 });
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

  /** Tells the server that the page goes away. */
  end() {
    const body = new Blob(['{"do":"end"}'], { type: "application/json" });
    if (this.session) navigator.sendBeacon(`sessions/${this.session}`, body);
    this.session = "";
  }

  async post(path, message) {
    this.sent = performance.now();
    const answer = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(message),
    });
    const document = await answer.json();
    if (!answer.ok) throw new Refusal(document.error, answer.status);
    if (document.schema_version !== SCHEMA_VERSION) {
      throw new Error(`the server speaks version ${document.schema_version}, this page ${SCHEMA_VERSION}`);
    }
    return document;
  }
}
