// The server that sent this page, and answers its messages.

class Server {
  /** Asks the server; gives the document that it answers. */
  async ask(path, message) {
    const answer = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(message),
    });
    const document = await answer.json();
    if (!answer.ok) throw new Refusal(document.error, answer.status === 410);
    return document;
  }

  /** Tells it that the page goes away. */
  leave(path) {
    navigator.sendBeacon(path, new Blob(['{"do":"end"}'], { type: "application/json" }));
  }

  lost(error) {
    return `The server does not answer (${error.message}). Is innerattn play still running?`;
  }
}

/** What answers this page. */
async function transport() {
  return new Server();
}
