// The page: what is chosen, what is shown, and what buttons, keys and the clock do.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

class App {
  constructor(described, buffer) {
    const { obstacle_places: places, position_unit_m: unit } = described.worlds;
    this.worlds = new Worlds(described.worlds, view(buffer, places), unit);
    this.runs = described.runs.map((run) => new Run(run, buffer, this.worlds));
    this.look = { robot: 0, received: false, all: false, least: 0, head: -1, trails: true, ...SENSES };
    this.look.least = strongWeight(this.worlds.robots.length);
    Object.assign(this, { chosen: 0, step: 0, playing: false, hovered: -1, times: [] });
    this.order = [];
    this.attendAs(this.runs.some((run) => run.attentions.critic) ? "critic" : "actor");
    this.chosen = Math.max(this.runs.findIndex((run) => run.attention), 0);
    this.charts = new Charts($("charts"), (step) => this.goTo(step));
    this.robots = new RobotList($("robots"), this.worlds, (robot) => this.choose(robot));
    this.events = new EventList($("events"), $("no-events"), $("marks"), (step, robot) => {
      if (robot !== undefined) this.look.robot = robot; // nobody loses a victim
      this.showCharts();
      this.goTo(step);
    });
    this.makePanes();
    this.fillControls();
    this.listen();
    startTheme(() => this.takeTheme());
    this.setSort(this.sorts()[0]);
    this.choose(this.run.handoffs[this.episode][0]?.robot ?? 0);
    const seconds = this.runs[0].steps * this.worlds.dt_s;
    this.setSpeed(seconds < 5 ? 0.25 : 1);
    this.fillMoments(described.moments ?? []);
  }

  get run() {
    return this.runs[this.chosen];
  }

  get last() {
    return Math.max(...this.runs.map((run) => run.lengths[this.episode])) - 1;
  }

  sorts() {
    return Object.keys(SORTS).filter((name) => !SORTS[name].pairs || this.runs.length > 1);
  }

  makePanes() {
    $("panes").dataset.count = this.runs.length;
    this.scenes = this.runs.map((run, index) => {
      const canvas = element("canvas", { role: "img" }), count = element("output");
      const pane = element("figure", { class: "pane" },
        element("figcaption", {}, element("strong", { title: run.name }, run.name), count), canvas);
      $("panes").append(pane);
      const scene = Object.assign(new Scene(canvas, run), { pane, count });
      const under = (event) => scene.robotAt(event.offsetX, event.offsetY, this.episode, this.step);
      canvas.addEventListener("pointermove", (event) => {
        if (event.pointerType === "mouse") this.hover(under(event));
      });
      canvas.addEventListener("pointerleave", () => this.hover(-1));
      canvas.addEventListener("click", (event) => {
        if (this.chosen !== index) this.choosePolicy(index);
        const robot = under(event);
        if (robot >= 0) this.choose(robot);
      });
      return scene;
    });
  }

  fillControls() {
    const { situation, episodes, seed } = this.worlds;
    $("subtitle").textContent = `Situation ${situation}, ${counted(episodes, "episode")}, ` +
      `worlds of seed ${seed}` + (this.runs.length > 1 ? ", the same for each policy" : "");
    fillSelect($("sort"), this.sorts().map((name) => [name, SORTS[name].label]), "");
    fillSelect($("speed"), SPEEDS.map((speed) => [String(speed), `${speed}×`]), "");
    const both = ["critic", "actor"].every((whose) => this.runs.some((run) => run.attentions[whose]));
    $("whose-box").hidden = !both;
    $("whose-key").hidden = !both;
    this.fillHeads();
    const sensing = this.runs.find((run) => run.heard || run.rays) ?? this.run;
    fillSenses($("senses"), sensing, this.look, (look) => this.setLook(look));
    $("policies").hidden = this.runs.length < 2;
    this.runs.forEach((run, index) => {
      const button = element("button", { type: "button" }, run.name);
      button.addEventListener("click", () => this.choosePolicy(index));
      $("which").append(button);
    });
    fillLegend($("legend"), this.worlds);
  }

  /** Lists moments that somebody chose, and opens the one in the address, or else the first. */
  fillMoments(moments) {
    $("moments-box").hidden = moments.length === 0;
    $("moments").append(...moments.map(({ text, address }) => (
      element("li", {}, element("a", { href: `#${address}` }, text))
    )));
    const open = () => this.open(location.hash.slice(1));
    window.addEventListener("hashchange", open);
    if (location.hash.length > 1) open();
    else if (moments.length) this.open(moments[0].address);
  }

  /** Shows the moment that the part of an address behind # names; what is unknown is left out. */
  open(address) {
    const asked = new URLSearchParams(address), number = (key) => Number.parseInt(asked.get(key), 10);
    const policy = this.runs.findIndex((run) => run.name === asked.get("policy"));
    if (policy >= 0) this.choosePolicy(policy);
    const episode = number("episode") - this.worlds.first_episode;
    if (this.order.includes(episode)) this.setEpisode(episode);
    if (this.run.attentions[asked.get("attention")]) this.setWhose(asked.get("attention"));
    const look = { head: (number("head") || 0) - 1 };
    const robot = this.worlds.robots.findIndex(({ name }) => name === asked.get("robot"));
    if (robot >= 0) look.robot = robot;
    const arrows = asked.get("arrows");
    this.setLook({ ...look, received: arrows === "to", all: arrows === "all" });
    if (number("step") >= 1) this.goTo(number("step") - 1);
    [...$("moments").children].forEach(({ firstChild: link }) => {
      link.setAttribute("aria-current", String(link.getAttribute("href") === `#${address}`));
    });
  }

  /** The part of an address behind # that `open` takes for what is shown. */
  address() {
    const { look, run } = this, robot = this.worlds.robots[look.robot];
    const named = {
      ...(this.runs.length > 1 ? { policy: run.name } : {}),
      episode: this.worlds.first_episode + this.episode, step: Math.floor(this.step) + 1,
      ...(robot ? { robot: robot.name } : {}),
      ...(run.attention ? { attention: this.whose } : {}),
      ...(look.head >= 0 ? { head: look.head + 1 } : {}),
      ...(look.all ? { arrows: "all" } : look.received ? { arrows: "to" } : {}),
    };
    return new URLSearchParams(named).toString();
  }

  fillHeads() {
    const heads = Math.max(...this.runs.map((run) => run.heads));
    const options = Array.from({ length: heads }, (_, head) => [String(head), String(head + 1)]);
    fillSelect($("head"), [["-1", "mean"], ...options], String(this.look.head));
  }

  /** Takes the attention of the critic or of the actor for all that is shown. */
  attendAs(whose) {
    this.whose = whose;
    this.runs.forEach((run) => run.attendAs(whose));
    $("of-critic").hidden = whose !== "critic";
    $("of-actor").hidden = whose !== "actor";
  }

  setWhose(whose) {
    $("whose").value = whose;
    this.attendAs(whose);
    this.look.head = -1;
    this.fillHeads();
    this.showRun();
    this.draw();
  }

  listen() {
    const on = (id, type, action) => $(id).addEventListener(type, action);
    on("play", "click", () => this.setPlaying(!this.playing));
    on("back", "click", () => this.goTo(Math.ceil(this.step) - 1));
    on("forward", "click", () => this.goTo(Math.floor(this.step) + 1));
    on("next-event", "click", () => this.goToEvent(true));
    on("previous-episode", "click", () => this.nextEpisode(-1));
    on("next-episode", "click", () => this.nextEpisode(1));
    on("scrubber", "input", () => this.goTo(Number($("scrubber").value)));
    on("episode", "change", () => this.setEpisode(Number($("episode").value)));
    on("sort", "change", () => this.setSort($("sort").value));
    on("speed", "change", () => this.setSpeed(Number($("speed").value)));
    on("head", "change", () => this.setLook({ head: Number($("head").value) }));
    on("whose", "change", () => this.setWhose($("whose").value));
    on("all", "change", () => this.setLook({ all: $("all").checked }));
    on("least", "input", () => this.setLook({ least: $("least").value / 100 }));
    on("direction", "change", () => this.setLook({ received: $("direction").value === "received" }));
    on("trails", "change", () => this.setLook({ trails: $("trails").checked }));
    document.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.fit()).observe($("panes"));
  }

  key(event) {
    const { target } = event, range = target.type === "range";
    if (!$("keys").checked || event.ctrlKey || event.metaKey || event.altKey) return;
    if (["SELECT", "TEXTAREA"].includes(target.tagName)) return;
    const presses = target.closest("button, summary, input:not([type=range])");
    const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
    const robots = this.worlds.robots.map((robot) => robot.index);
    const actions = {
      " ": presses ? null : () => this.setPlaying(!this.playing),
      ArrowLeft: range ? null : () => this.goTo(Math.ceil(this.step) - 1),
      ArrowRight: range ? null : () => this.goTo(Math.floor(this.step) + 1),
      ",": () => this.goToEvent(false),
      ".": () => this.goToEvent(true),
      "[": () => this.nextEpisode(-1),
      "]": () => this.nextEpisode(1),
      r: () => this.choose(next(robots, this.look.robot)),
      h: () => this.setLook({ head: ((this.look.head + 2) % (this.run.heads + 1)) - 1 }),
      g: () => this.setLook({ received: !this.look.received }),
      a: () => this.setLook({ all: !this.look.all }),
      c: $("whose-box").hidden ? null : () => this.setWhose(next(["critic", "actor"], this.whose)),
      "-": () => this.setSpeed(SPEEDS[Math.max(SPEEDS.indexOf(this.speed) - 1, 0)]),
      "+": () => this.setSpeed(SPEEDS[Math.min(SPEEDS.indexOf(this.speed) + 1, SPEEDS.length - 1)]),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  /** Takes the colours of the theme. */
  takeTheme() {
    this.paint = paints();
    $("robots").replaceChildren();
    this.robots = new RobotList($("robots"), this.worlds, (robot) => this.choose(robot));
    fillLegend($("legend"), this.worlds);
    if (this.episode !== undefined) this.draw();
  }

  setSort(sort) {
    $("sort").value = sort;
    this.order = sortedEpisodes(this.runs, sort, this.run);
    this.setEpisode(this.order[0]);
    const texts = this.order.map((episode) => [String(episode), episodeText(this.runs, episode)]);
    fillSelect($("episode"), texts, String(this.episode));
  }

  setSpeed(speed) {
    this.speed = speed;
    $("speed").value = String(speed);
  }

  setEpisode(episode) {
    this.episode = episode;
    this.setPlaying(false);
    $("episode").value = String(episode);
    $("previous-episode").disabled = episode === this.order[0];
    $("next-episode").disabled = episode === this.order[this.order.length - 1];
    $("scrubber").max = this.last;
    this.showRun();
    this.goTo(0);
  }

  nextEpisode(by) {
    const at = this.order.indexOf(this.episode) + by;
    if (at >= 0 && at < this.order.length) this.setEpisode(this.order[at]);
  }

  choosePolicy(index) {
    this.chosen = index;
    this.showRun();
    this.scenes[index].fit(); // a phone shows the chosen one only
    this.goTo(this.step);
  }

  choose(robot) {
    this.setLook({ robot });
  }

  setLook(look) {
    Object.assign(this.look, look);
    this.look.head = Math.min(this.look.head, this.run.heads - 1);
    $("head").value = String(Math.max(this.look.head, -1));
    showLook(this.look);
    this.showCharts();
    this.draw();
  }

  hover(robot) {
    if (robot === this.hovered) return;
    this.hovered = robot;
    if (!this.playing) this.draw();
  }

  /** Shows everything that depends on the policy and the episode. */
  showRun() {
    const { run } = this;
    const attends = (one) => Object.keys(one.attentions).length > 0;
    $("no-attention").hidden = Boolean(run.attention);
    $("no-attention").textContent = attends(run) ?
      `The ${this.whose} of this policy has no attention.` : "This policy shows no attention.";
    $("attention-settings").hidden = !this.runs.some(attends);
    [...$("which").children].forEach((button, index) => {
      button.setAttribute("aria-pressed", String(index === this.chosen));
    });
    this.scenes.forEach(({ pane }, index) => (pane.dataset.chosen = index === this.chosen));
    this.events.show(run, this.episode, this.last + 1);
    this.showCharts();
  }

  showCharts() {
    this.charts.show(this.run, this.episode, this.look);
    this.charts.moveTo(this.step);
  }

  fit() {
    this.scenes.forEach((scene) => scene.fit());
    this.events.drawMarks(this.last + 1);
    this.showCharts();
    this.draw();
  }

  setPlaying(playing) {
    if (playing && this.step >= this.last) this.step = 0;
    this.playing = playing;
    $("play").textContent = playing ? "Pause" : "Play";
    $("now").setAttribute("aria-live", playing ? "off" : "polite");
    this.before = null;
    if (playing) requestAnimationFrame((now) => this.tick(now));
    else this.draw();
  }

  tick(now) {
    if (!this.playing) return;
    if (this.before !== null) {
      this.step += (this.speed * (now - this.before)) / (1000 * this.worlds.dt_s);
    }
    this.before = now;
    if (this.step >= this.last) {
      this.step = this.last;
      this.setPlaying(false);
      return;
    }
    this.draw();
    requestAnimationFrame((next) => this.tick(next));
  }

  goTo(step) {
    this.step = Math.min(Math.max(step, 0), this.last);
    if (this.playing) this.setPlaying(false);
    else this.draw();
  }

  goToEvent(forward) {
    const step = this.events.next(Math.floor(this.step), forward);
    if (step >= 0) this.goTo(step);
  }

  /** Draws the moment; keeps how long the script took [ms], of the last thousand frames. */
  draw() {
    if (this.episode === undefined) return;
    const begin = performance.now();
    const look = { ...this.look, robot: this.hovered >= 0 ? this.hovered : this.look.robot };
    this.scenes.forEach((scene) => {
      const step = Math.min(this.step, scene.run.lengths[this.episode] - 1);
      scene.draw(this.episode, step, look, this.paint);
    });
    this.charts.moveTo(Math.min(this.step, this.run.lengths[this.episode] - 1));
    this.showTexts(look);
    this.times.push(performance.now() - begin);
    if (this.times.length > 1000) this.times.shift();
  }

  /** The texts, only when the step, the robot or the policy is another one. */
  showTexts(look) {
    const { run, episode } = this, step = Math.min(Math.floor(this.step), run.lengths[episode] - 1);
    const key = [this.chosen, this.whose, episode, step, ...Object.values(look), document.documentElement.dataset.theme].join();
    $("scrubber").value = Math.floor(this.step);
    if (key === this.shown) return;
    this.shown = key;
    const { dt_s: dt } = this.worlds, seconds = (step * dt).toFixed(1);
    $("clock").textContent = `step ${step + 1} of ${run.lengths[episode]} · ${seconds} s`;
    $("scrubber").setAttribute("aria-valuetext", `step ${step + 1}, ${seconds} seconds`);
    $("here").setAttribute("href", `#${this.address()}`);
    this.robots.show(run, episode, step, look);
    this.events.showStep(step);
    const happens = this.events.events.filter((one) => one.step === step).map((one) => `${one.text}.`);
    if (look.robot >= 0) happens.push(attentionText(run, episode, step, look));
    $("now").textContent = happens.filter(Boolean).map(capital).join(" ");
    this.scenes.forEach(({ run: one, count, canvas }) => {
      const now = Math.min(step, one.lengths[episode] - 1);
      count.textContent = counted(one.rescuesUntil(episode, now, -1), "rescue");
      canvas.setAttribute("aria-label", `Arena of ${one.name} at step ${now + 1}: ${count.textContent}`);
    });
  }
}

function capital(text) {
  return text.startsWith("handoff") || text.startsWith("fault") || text.startsWith("end") ?
    text.charAt(0).toUpperCase() + text.slice(1) : text;
}

async function start() {
  const described = JSON.parse($("data").textContent);
  window.replay = new App(described, await unpack(described.data));
}

start().catch((error) => {
  $("problem").textContent = `This replay cannot be shown: ${error.message}`;
  $("problem").hidden = false;
});
