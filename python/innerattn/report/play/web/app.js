// The page: what is chosen, what is shown, and when the next step is asked for.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const CHART_STEPS = 100;
const CHART_MS = 500;
const ALIVE_MS = 20000;
const NUDGE_M = 0.05;
const PUSH_MPS = 1.5;
const NOTICE_MS = 7000;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

class App {
  /** `sessions`: the link and the opening document of each arena. */
  constructor(sessions) {
    Object.assign(this, { running: false, due: 0, charted: 0, times: [], drive: [] });
    this.look = { robot: 0, received: false, all: false, least: 0, head: -1, trails: true, ...SENSES };
    this.events = new EventLog($("events"), $("no-events"), (robot, arena) => {
      this.show(arena);
      this.choose(robot);
    });
    $("panes").dataset.count = String(sessions.length);
    this.arenas = sessions.map(({ link, opened }, index) => new Arena(this, link, opened, index, sessions.length));
    [this.arena] = this.arenas;
    this.look.least = strongWeight(this.worlds.robots.length);
    this.charts = new Charts($("charts"), () => {});
    this.panel = new RobotPanel(
      this.worlds, (values) => this.reach({ do: "faults", robot: this.look.robot, values }),
      (x, y) => this.reach({ do: "move_robot", robot: this.look.robot, x, y }),
    );
    this.victims = new VictimPanel(
      this.worlds, (victim, x, y) => this.arena.moveVictim(victim, x, y),
      (task, x, y) => this.arena.addVictim(task, x, y),
    );
    this.fillControls();
    this.listen();
    startTheme(() => this.takeTheme());
    this.setSpeed(0.5);
    this.setRunning(!matchMedia("(prefers-reduced-motion: reduce)").matches);
    setInterval(() => this.stayAlive(), ALIVE_MS / 4);
    requestAnimationFrame((now) => this.frame(now));
  }

  // What buttons and lists show is of the arena that was chosen last.
  get link() {
    return this.arena.link;
  }

  get run() {
    return this.arena.run;
  }

  get worlds() {
    return this.arena.worlds;
  }

  get scene() {
    return this.arena.scene;
  }

  get hands() {
    return this.arena.hands;
  }

  get movesNow() {
    return this.arena.movesNow;
  }

  /** The arenas that a hand in one of them reaches. */
  reached(arena = this.arena) {
    return $("both").checked ? this.arenas : [arena];
  }

  /** Sends what a hand does. */
  reach(message, arena = this.arena) {
    for (const one of this.reached(arena)) one.send(message);
  }

  /** Sends what the arenas always do together. */
  async sendAll(message) {
    await Promise.all(this.arenas.map((one) => one.send(message)));
  }

  /** Sends to the chosen arena alone. */
  send(message) {
    return this.arena.send(message);
  }

  fillControls() {
    const areTwo = this.arenas.length > 1, attends = this.arenas.some(({ run }) => run.heads > 0);
    $("subtitle").textContent = aboutText(this.worlds, attends, areTwo);
    for (const id of ["both-box", "sides", "key-other", "about-balance"]) $(id).hidden = !areTwo;
    $("policy-box").hidden = areTwo;
    if (areTwo) this.fillSides();
    fillSelect($("policy"), this.arena.policies.map((name) => [name, name]), this.run.now.policy);
    fillSelect($("speed"), SPEEDS.map((speed) => [String(speed), `${speed}×`]), "");
    fillSelect($("task"), this.worlds.tasks.map(({ name }, task) => [String(task), name]), "0");
    fillLegend($("legend"), this.worlds);
    this.spares = new SparePanel(this.worlds, (kind) => this.addRobot(kind));
    fillSenses($("senses"), this.run, this.look, (look) => this.setLook(look));
  }

  /** Buttons that choose one of two arenas. */
  fillSides() {
    this.sides = this.arenas.map((arena) => {
      const button = element("button", { type: "button" });
      button.addEventListener("click", () => this.show(arena));
      $("which").append(button);
      return button;
    });
  }

  /** Shows an arena in buttons and lists. */
  show(arena) {
    if (arena === this.arena) return;
    this.arena = arena;
    this.setLook({});
  }

  listen() {
    const on = (id, type, action) => $(id).addEventListener(type, action);
    on("run", "click", () => this.setRunning(!this.running));
    on("step", "click", () => this.step());
    on("restart", "click", () => this.restart());
    on("from-seed", "submit", (event) => {
      event.preventDefault();
      this.sendAll({ do: "restart", seed: Number(event.target.elements.seed.value) });
    });
    on("speed", "change", () => this.setSpeed(Number($("speed").value)));
    on("policy", "change", () => this.arena.choosePolicy($("policy").value));
    on("head", "change", () => this.setLook({ head: Number($("head").value) }));
    on("all", "change", () => this.setLook({ all: $("all").checked }));
    on("least", "input", () => this.setLook({ least: $("least").value / 100 }));
    on("direction", "change", () => this.setLook({ received: $("direction").value === "received" }));
    on("trails", "change", () => this.setLook({ trails: $("trails").checked }));
    on("task", "change", () => this.setTool("add"));
    on("steer", "click", () => this.toggleSteering());
    for (const radio of document.querySelectorAll("[name=tool]")) {
      radio.addEventListener("change", () => this.setTool(radio.value));
    }
    for (const button of document.querySelectorAll(".pad button")) this.listenToPad(button);
    document.addEventListener("keydown", (event) => pressed(this, event));
    document.addEventListener("keyup", (event) => this.release(event.key));
    window.addEventListener("blur", () => this.release());
    window.addEventListener("pagehide", () => this.arenas.forEach(({ link }) => link.end()));
    window.addEventListener("pageshow", (event) => event.persisted && location.reload());
  }

  /** An arrow button drives while it is held, or pushes once. */
  listenToPad(button) {
    const way = [Number(button.dataset.x), Number(button.dataset.y)], key = `pad ${way}`;
    const down = () => (this.steers ? this.hold(key, way) : this.push(way));
    button.addEventListener("pointerdown", down);
    for (const type of ["pointerup", "pointercancel", "pointerleave", "blur"]) {
      button.addEventListener(type, () => this.release(key));
    }
    button.addEventListener("keydown", (event) => {
      if ([" ", "Enter"].includes(event.key) && !event.repeat) down();
    });
    button.addEventListener("keyup", () => this.release(key));
  }

  /** Whether the chosen robot is steered by hand. */
  get steers() {
    return this.arena.steered === this.look.robot;
  }

  fail(error, link) {
    if (error instanceof Refusal && !error.ended) return this.tell(error.message);
    this.setRunning(false);
    const again = element("button", { type: "button" }, "Begin again");
    again.addEventListener("click", () => location.reload());
    const text = error instanceof Refusal ? error.message : link.transport.lost(error);
    clearTimeout(this.telling);
    $("problem").replaceChildren(text, again);
    $("problem").hidden = false;
  }

  tell(text) {
    $("problem").replaceChildren(text);
    $("problem").hidden = false;
    clearTimeout(this.telling);
    this.telling = setTimeout(() => ($("problem").hidden = true), NOTICE_MS);
  }

  step() {
    this.setRunning(false);
    this.sendAll({ do: "step" });
  }

  restart() {
    this.sendAll({ do: "restart" });
  }

  /** Lets a spare robot of a kind into the arenas that hands reach, and chooses it. */
  async addRobot(kind) {
    const { arena } = this, [robot] = arena.waiting(kind);
    if (!robot) return this.tell(noSpareText(this.worlds, kind));
    const reached = this.reached().filter((one) => one.waiting(kind).length);
    await Promise.all(reached.map((one) => one.send({ do: "add_robot", kind })));
    if (!arena.run.isOutside(arena.run.now, robot.index)) this.choose(robot.index);
  }

  push(way) {
    for (const arena of this.reached()) arena.push(this.look.robot, way);
  }

  nudge(way) {
    for (const arena of this.reached()) arena.nudge(this.look.robot, way);
  }

  toggleSteering() {
    const robot = this.steers ? null : this.look.robot;
    this.drive = [];
    for (const arena of this.reached()) arena.steer(robot);
    if (robot !== null) this.setRunning(true);
  }

  /** Drives the steered robot that way until the key is released; the latest key counts. */
  hold(key, way) {
    if (this.drive.some((one) => one.key === key)) return;
    this.drive.push({ key, way });
    this.sendDrive();
  }

  release(key) {
    const before = this.drive.length;
    this.drive = key === undefined ? [] : this.drive.filter((one) => one.key !== key);
    if (this.drive.length < before) this.sendDrive();
  }

  sendDrive() {
    // Where hands let go, no robot goes on.
    const { way } = this.drive.at(-1) ?? {};
    for (const arena of way ? this.reached() : this.arenas) arena.drive(way ?? [0, 0]);
  }

  stayAlive() {
    for (const arena of this.arenas) {
      const { sent, session } = arena.link;
      if (performance.now() - sent > ALIVE_MS && session) arena.send({ do: "look" });
    }
  }

  choose(robot) {
    this.setLook({ robot });
  }

  setLook(look) {
    Object.assign(this.look, look);
    showLook(this.look);
    this.charted = 0;
    this.fresh = this.stale = this.chartsAreOld = true;
  }

  setTool(tool) {
    for (const { hands } of this.arenas) Object.assign(hands, { tool, task: Number($("task").value) });
    document.querySelector(`[name=tool][value=${tool}]`).checked = true;
  }

  setSpeed(speed) {
    this.speed = speed;
    $("speed").value = String(speed);
  }

  setRunning(running) {
    this.running = running;
    $("run").textContent = running ? "Pause" : "Run";
    $("now").setAttribute("aria-live", running ? "off" : "polite");
  }

  /** Takes the colours of the theme. */
  takeTheme() {
    this.paint = paints();
    $("robots").replaceChildren();
    this.robots = new RobotList($("robots"), this.worlds, (robot) => this.choose(robot));
    fillLegend($("legend"), this.worlds);
    this.setLook({});
  }

  /** Milliseconds from a step to the next. */
  get period() {
    return (1000 * this.worlds.dt_s) / this.speed;
  }

  frame(now) {
    if (this.running && !this.arenas.some(({ link }) => link.busy) && now >= this.due) {
      this.due = (now - this.due > 3 * this.period ? now : this.due) + this.period;
      this.sendAll({ do: "step" });
    }
    const moments = this.arenas.map((arena) => arena.at(this.period));
    const chartsAreDue = this.chartsAreOld && now - this.charted > CHART_MS;
    if (this.stale || chartsAreDue || this.arenas.some(({ hands }, index) => moments[index] !== hands.step)) {
      this.stale = false;
      this.draw(moments, now);
    }
    requestAnimationFrame((next) => this.frame(next));
  }

  /** Draws a moment of each arena; keeps how long the script took [ms], of the last thousand frames. */
  draw(moments, now) {
    const begin = performance.now(), { run } = this;
    if (run.isOutside(run.now, this.look.robot)) this.choose(run.team[0].index);
    this.arenas.forEach((arena, index) => arena.draw(moments[index], this.look, this.paint));
    if (this.fresh) {
      this.fresh = false;
      this.showTexts();
    } else if (this.chartsAreOld && now - this.charted > CHART_MS) {
      Object.assign(this, { charted: now, chartsAreOld: false });
      this.showCharts();
    }
    this.times.push(performance.now() - begin);
    if (this.times.length > 1000) this.times.shift();
  }

  showCharts() {
    const recent = this.run.recent(CHART_STEPS);
    this.charts.show(recent, 0, this.look);
    this.charts.moveTo(recent.lengths[0] - 1);
  }

  showTexts() {
    const { run, look, worlds } = this, { now } = run;
    if (String(run.heads) !== $("head").dataset.heads) this.showHeads();
    look.head = Math.min(look.head, run.heads - 1);
    $("head").value = String(look.head);
    $("policy").value = this.arena.policy;
    this.robots.show(run, 0, now.step, look);
    this.panel.show(run, look.robot, this.arena.steered, this.arena.mark);
    this.victims.show(now.victims);
    this.spares.show((kind) => this.arena.waiting(kind).length);
    this.arenas.forEach((arena, index) => {
      arena.showCaption(arena === this.arena);
      if (!this.sides) return;
      this.sides[index].textContent = `${arena.mark}: ${arena.policy}`;
      this.sides[index].setAttribute("aria-pressed", String(arena === this.arena));
    });
    const rescues = this.sides ? "" : ` · ${counted(now.rescued, "rescue")}`;
    $("clock").textContent = `${(now.step * worlds.dt_s).toFixed(1)} s${rescues}`;
    const says = this.arenas.flatMap((arena) => arena.says());
    says.push(worlds.robots.length > 1 ? attentionText(run, 0, now.step, look) : "");
    $("now").textContent = says.filter(Boolean).join(" ");
  }

  showHeads() {
    const { heads } = this.run;
    $("head").dataset.heads = String(heads);
    $("heads").hidden = !heads;
    $("no-attention").hidden = heads > 0;
    const options = Array.from({ length: heads }, (_, head) => [String(head), String(head + 1)]);
    fillSelect($("head"), [["-1", "mean"], ...options], "-1");
  }
}

/** What keys do. */
function pressed(app, event) {
  const { target, key } = event, way = ARROWS[key], { look } = app;
  if (!$("keys").checked || event.ctrlKey || event.metaKey || event.altKey) return;
  if (target.closest("select, textarea, input:not([type=checkbox])")) return;
  const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
  const faster = (by) => app.setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(app.speed) + by, 0), SPEEDS.length - 1)]);
  const actions = {
    " ": target.closest("button, summary, input") ? null : () => app.setRunning(!app.running),
    ".": () => app.step(),
    n: () => app.restart(),
    r: () => app.choose(next(app.run.team, app.worlds.robots[look.robot]).index),
    s: () => app.toggleSteering(),
    p: () => app.arena.choosePolicy(next(app.arena.policies, app.arena.policy)),
    x: () => app.show(next(app.arenas, app.arena)),
    h: () => app.setLook({ head: ((look.head + 2) % (app.run.heads + 1)) - 1 }),
    g: () => app.setLook({ received: !look.received }),
    a: () => app.setLook({ all: !look.all }),
    "-": () => faster(-1),
    "+": () => faster(1),
  };
  for (const one of BREAKS) actions[one.key] = () => app.panel.toggle(one);
  let action = actions[key];
  if (way) {
    if (event.shiftKey) action = () => event.repeat || app.push(way);
    else action = app.arena.steered !== null ? () => app.hold(key, way) : () => app.nudge(way);
  }
  if (!action || (event.repeat && !way)) return;
  event.preventDefault();
  action();
}

/** The session of an arena; the policy that it begins with, if that is not the first one. */
async function session(answering, policy) {
  const link = new Link(answering), opened = await link.open();
  return { link, opened: policy ? { ...opened, ...await link.send({ do: "policy", name: policy }) } : opened };
}

async function start() {
  const answering = await transport(), { beside } = $("main").dataset, sessions = [await session(answering)];
  if (beside) sessions.push(await session(answering, beside));
  $("main").hidden = false;
  window.play = new App(sessions);
}

start().catch((error) => {
  $("problem").textContent = `This page cannot begin: ${error.message}`;
  $("problem").hidden = false;
  $("subtitle").textContent = "";
});
