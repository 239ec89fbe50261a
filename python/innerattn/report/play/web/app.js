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
  constructor(link, opened) {
    const { worlds, policies } = opened;
    this.link = link;
    this.worlds = new Worlds(worlds, opened.obstacles.flat(), 1);
    this.policies = policies;
    this.run = new LiveRun(document.title, this.worlds);
    this.look = { robot: 0, received: false, all: false, least: 0, head: -1, trails: true, ...SENSES };
    this.look.least = strongWeight(this.worlds.robots.length);
    // Only this page changes them: what was asked for last is so, though the answer is on its way.
    Object.assign(this, { steered: opened.steered, policy: opened.policy });
    Object.assign(this, { running: false, due: 0, arrived: 0, charted: 0, times: [], drive: [], moving: null });
    this.events = new EventLog($("events"), $("no-events"), (robot) => this.choose(robot));
    this.charts = new Charts($("charts"), () => {});
    this.scene = new Scene($("arena"), this.run);
    this.hands = new Hands(this.scene, this.acts());
    this.panel = new RobotPanel(
      this.worlds, (values) => this.send({ do: "faults", robot: this.look.robot, values }),
      (x, y) => this.send({ do: "move_robot", robot: this.look.robot, x, y }),
    );
    this.victims = new VictimPanel(
      this.worlds, (slot, x, y) => this.send({ do: "move_victim", slot, x, y }),
      (task, x, y) => this.send({ do: "add_victim", task, x, y }),
    );
    this.take(opened);
    this.fillControls();
    this.listen();
    startTheme(() => this.takeTheme());
    this.setSpeed(0.5);
    this.setRunning(!matchMedia("(prefers-reduced-motion: reduce)").matches);
    setInterval(() => this.stayAlive(), ALIVE_MS / 4);
    requestAnimationFrame((now) => this.frame(now));
  }

  /** What hands in the arena may do. */
  acts() {
    return {
      choose: (robot) => this.choose(robot),
      move: (robot, x, y, drop) => this.moveRobot(robot, x, y, drop),
      push: (robot, vx, vy) => this.send({ do: "push_robot", robot, vx, vy }),
      moveVictim: (victim, x, y) => this.send({ do: "move_victim", slot: victim.slot, x, y })
        .finally(() => (victim.held = false)),
      addVictim: (task, x, y) => {
        if (this.run.now.victims.length < this.worlds.num_victims) this.send({ do: "add_victim", task, x, y });
        else this.tell($("victim-places").textContent);
      },
      redraw: () => (this.stale = true),
    };
  }

  fillControls() {
    $("subtitle").textContent = aboutText(this.worlds, this.run.heads > 0);
    fillSelect($("policy"), this.policies.map((name) => [name, name]), this.run.now.policy);
    fillSelect($("speed"), SPEEDS.map((speed) => [String(speed), `${speed}×`]), "");
    fillSelect($("task"), this.worlds.tasks.map(({ name }, task) => [String(task), name]), "0");
    fillLegend($("legend"), this.worlds);
    fillSenses($("senses"), this.run, this.look, (look) => this.setLook(look));
    $("arena").setAttribute("aria-label", "Arena");
  }

  listen() {
    const on = (id, type, action) => $(id).addEventListener(type, action);
    on("run", "click", () => this.setRunning(!this.running));
    on("step", "click", () => this.step());
    on("restart", "click", () => this.restart());
    on("from-seed", "submit", (event) => {
      event.preventDefault();
      this.send({ do: "restart", seed: Number(event.target.elements.seed.value) });
    });
    on("speed", "change", () => this.setSpeed(Number($("speed").value)));
    on("policy", "change", () => this.choosePolicy($("policy").value));
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
    window.addEventListener("pagehide", () => this.link.end());
    window.addEventListener("pageshow", (event) => event.persisted && location.reload());
    new ResizeObserver(() => {
      this.scene.fit();
      this.stale = true;
    }).observe($("arena"));
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
    return this.steered === this.look.robot;
  }

  async send(message) {
    try {
      const state = await this.link.send(message);
      this.take(state, message.do === "step");
    } catch (error) {
      this.fail(error);
    }
  }

  fail(error) {
    if (error instanceof Refusal && !error.ended) return this.tell(error.message);
    this.setRunning(false);
    const again = element("button", { type: "button" }, "Begin again");
    again.addEventListener("click", () => location.reload());
    const text = error instanceof Refusal ? error.message : this.link.transport.lost(error);
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

  /** Shows a state. */
  take(state, isStep = false) {
    if (!this.run.continues(state)) this.events.clear();
    const events = this.run.take(state);
    this.events.add(events, this.worlds.dt_s);
    if (isStep) this.arrived = performance.now();
    this.happened = events.length ? events : this.happened?.filter((one) => state.step - one.step < 10) ?? [];
    this.fresh = this.stale = this.chartsAreOld = true;
  }

  /** Moves a robot as fast as the server takes it; the last place counts. */
  moveRobot(robot, x, y, drop) {
    this.moving = { robot, x, y, drop };
    if (!this.movesNow) this.sendMoves();
  }

  async sendMoves() {
    this.movesNow = true;
    while (this.moving) {
      const { robot, x, y, drop } = this.moving;
      this.moving = null;
      await this.send({ do: "move_robot", robot, x, y });
      if (drop && !this.moving) this.run.held = null;
    }
    this.movesNow = false;
    this.stale = true;
  }

  step() {
    this.setRunning(false);
    this.send({ do: "step" });
  }

  restart() {
    this.send({ do: "restart" });
  }

  push([x, y]) {
    const [vx, vy] = this.run.now.velocities[this.look.robot];
    const most = (speed) => Math.min(Math.max(speed, -this.worlds.most_push_mps), this.worlds.most_push_mps);
    const pushed = { vx: most(vx + PUSH_MPS * x), vy: most(vy + PUSH_MPS * y) };
    this.send({ do: "push_robot", robot: this.look.robot, ...pushed });
  }

  nudge([x, y]) {
    const { robot } = this.look, [ax, ay] = this.run.now.positions[robot];
    const most = this.worlds.half_width_m - this.worlds.robots[robot].radius_m - 1e-4;
    const inside = (metres) => Math.min(Math.max(metres, -most), most);
    this.send({ do: "move_robot", robot, x: inside(ax + NUDGE_M * x), y: inside(ay + NUDGE_M * y) });
  }

  toggleSteering() {
    this.drive = [];
    this.steered = this.steers ? null : this.look.robot;
    this.send({ do: "steer", robot: this.steered });
    if (this.steered !== null) this.setRunning(true);
  }

  choosePolicy(name) {
    this.policy = name;
    this.send({ do: "policy", name });
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
    const [x, y] = this.drive.at(-1)?.way ?? [0, 0];
    if (this.steered !== null) this.send({ do: "steer", robot: this.steered, x, y });
  }

  stayAlive() {
    if (performance.now() - this.link.sent > ALIVE_MS && this.link.session) this.send({ do: "look" });
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
    Object.assign(this.hands, { tool, task: Number($("task").value) });
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
    if (this.running && !this.link.busy && now >= this.due) {
      this.due = (now - this.due > 3 * this.period ? now : this.due) + this.period;
      this.send({ do: "step" });
    }
    const share = Math.min((performance.now() - this.arrived) / this.period, 1);
    const at = this.run.last - (this.run.moments.length > 1 ? 1 - share : 0);
    const chartsAreDue = this.chartsAreOld && now - this.charted > CHART_MS;
    if (this.stale || chartsAreDue || at !== this.hands.step) {
      this.stale = false;
      this.draw(at, now);
    }
    requestAnimationFrame((next) => this.frame(next));
  }

  /** Draws the moment; keeps how long the script took [ms], of the last thousand frames. */
  draw(at, now) {
    const begin = performance.now();
    this.hands.step = at;
    this.scene.draw(0, at, this.look, this.paint);
    this.hands.draw();
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
    $("policy").value = this.policy;
    this.robots.show(run, 0, now.step, look);
    this.panel.show(run, look.robot, this.steered);
    this.victims.show(now.victims);
    $("clock").textContent = `${(now.step * worlds.dt_s).toFixed(1)} s · ${counted(now.rescued, "rescue")}`;
    const says = this.happened.map(({ text }) => `${text}.`);
    says.push(...run.hopeless().map(([need, tasks]) => `Nobody offers ${need} now: ${listed(tasks)} must wait.`));
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
    r: () => app.choose((look.robot + 1) % app.worlds.robots.length),
    s: () => app.toggleSteering(),
    p: () => app.choosePolicy(next(app.policies, app.policy)),
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
    else action = app.steered !== null ? () => app.hold(key, way) : () => app.nudge(way);
  }
  if (!action || (event.repeat && !way)) return;
  event.preventDefault();
  action();
}

async function start() {
  const link = new Link(await transport()), opened = await link.open();
  $("main").hidden = false;
  window.play = new App(link, opened);
}

start().catch((error) => {
  $("problem").textContent = `This page cannot begin: ${error.message}`;
  $("problem").hidden = false;
  $("subtitle").textContent = "";
});
