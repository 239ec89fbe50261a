// One arena: its session, what was told of its world, and the hands that reach into it.

const MARKS = ["A", "B"]; // of arenas that stand side by side

class Arena {
  /** `app` is what all arenas share; `opened` is the opening document of the session of `link`. */
  constructor(app, link, opened, index, count) {
    const worlds = new Worlds(opened.worlds, opened.obstacles.flat(), 1);
    Object.assign(this, { app, link, worlds, policies: opened.policies, run: new LiveRun(document.title, worlds) });
    // Only this page changes them: what was asked for last is so, though the answer is on its way.
    Object.assign(this, { steered: opened.steered, policy: opened.policy });
    Object.assign(this, { arrived: 0, happened: [], moving: null });
    this.mark = count > 1 ? MARKS[index] : "";
    this.makePane(index);
    this.scene = new Scene(this.canvas, this.run);
    this.hands = new Hands(this.scene, this.acts());
    this.take(opened);
    new ResizeObserver(() => {
      this.scene.fit();
      app.stale = true;
    }).observe(this.canvas);
  }

  makePane(index) {
    this.canvas = element("canvas", { id: index ? `arena-${index}` : "arena", role: "img" });
    this.canvas.setAttribute("aria-label", `Arena ${this.mark}`.trim());
    this.pane = element("figure", { class: "pane" }, this.canvas);
    $("panes").append(this.pane);
    if (!this.mark) return;
    this.choice = element("select", { "aria-label": `Policy of ${this.mark}` });
    fillSelect(this.choice, this.policies.map((name) => [name, name]), this.policy);
    this.choice.addEventListener("change", () => this.choosePolicy(this.choice.value));
    this.counters = element("output");
    const title = element("label", { class: "inline" }, element("strong", {}, this.mark), this.choice);
    this.pane.prepend(element("figcaption", {}, title, this.counters));
    this.pane.addEventListener("pointerdown", () => this.app.show(this));
  }

  /** What hands in this arena may do. */
  acts() {
    const { app } = this;
    return {
      choose: (robot) => app.choose(robot),
      move: (...where) => app.reached(this).forEach((one) => one.moveRobot(...where)),
      push: (robot, vx, vy) => app.reach({ do: "push_robot", robot, vx, vy }, this),
      moveVictim: (victim, x, y) => this.moveVictim(victim, x, y).finally(() => (victim.held = false)),
      addVictim: (task, x, y) => this.addVictim(task, x, y),
      redraw: () => (app.stale = true),
    };
  }

  /** Sends a message, and shows what is answered. */
  async send(message) {
    try {
      const state = await this.link.send(message);
      this.take(state, message.do === "step");
    } catch (error) {
      this.app.fail(error, this.link);
    }
  }

  take(state, isStep = false) {
    const { app, run, worlds } = this;
    if (!run.continues(state)) {
      app.events.clear();
      this.shareAmong(worlds.robots.filter((one) => !one.is_spare));
      this.losses = 0;
    }
    const events = run.take(state), fresh = run.team.filter((one) => !this.sharing.includes(one));
    if (fresh.length) this.shareAmong([...this.sharing, ...fresh]);
    if (this.steered !== null && run.isOutside(run.now, this.steered)) this.steer(null);
    app.events.add(events, worlds.dt_s, this);
    if (isStep) {
      this.balance.add(state.rescues);
      this.losses += state.lost.length;
      this.arrived = performance.now();
    }
    this.happened = events.length ? events : this.happened.filter((one) => state.step - one.step < 10);
    app.fresh = app.stale = app.chartsAreOld = true;
  }

  /** Counts from now on how evenly some robots share rescues. */
  shareAmong(robots) {
    Object.assign(this, { sharing: robots, balance: new Balance(this.worlds, robots) });
  }

  /** Spare robots of a kind that are outside. */
  waiting(kind) {
    const { worlds, run } = this;
    return worlds.robots.filter((one) => one.kind === kind && run.isOutside(run.now, one.index));
  }

  /** Moves a robot as fast as its world takes it; the last place counts. */
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
    this.app.stale = true;
  }

  /** Moves a victim, and the same one in the other arena, if hands reach into both and it is there. */
  moveVictim({ slot, id }, x, y) {
    const isThere = ({ run }) => run.now.victims.some((one) => one.slot === slot && one.id === id);
    const both = this.app.reached(this).filter((one) => one === this || isThere(one));
    return Promise.all(both.map((one) => one.send({ do: "move_victim", slot, x, y })));
  }

  addVictim(task, x, y) {
    const hasRoom = ({ run, worlds }) => run.now.victims.length < worlds.num_victims;
    if (!hasRoom(this)) this.app.tell(placesText(this.run.now.victims.length, this.worlds.num_victims));
    else for (const one of this.app.reached(this).filter(hasRoom)) one.send({ do: "add_victim", task, x, y });
  }

  choosePolicy(name) {
    this.policy = name;
    this.send({ do: "policy", name });
  }

  push(robot, [x, y]) {
    const [vx, vy] = this.run.now.velocities[robot], { most_push_mps: limit } = this.worlds;
    const most = (speed) => Math.min(Math.max(speed, -limit), limit);
    this.send({ do: "push_robot", robot, vx: most(vx + PUSH_MPS * x), vy: most(vy + PUSH_MPS * y) });
  }

  nudge(robot, [x, y]) {
    const [ax, ay] = this.run.now.positions[robot];
    const most = this.worlds.half_width_m - this.worlds.robots[robot].radius_m - 1e-4;
    const inside = (metres) => Math.min(Math.max(metres, -most), most);
    this.send({ do: "move_robot", robot, x: inside(ax + NUDGE_M * x), y: inside(ay + NUDGE_M * y) });
  }

  /** A robot is driven by hand from now on, or none. */
  steer(robot) {
    this.steered = robot;
    this.send({ do: "steer", robot });
  }

  drive([x, y]) {
    if (this.steered !== null) this.send({ do: "steer", robot: this.steered, x, y });
  }

  /** The step to draw now: between the last two, by the time since the last one came. */
  at(period) {
    const share = Math.min((performance.now() - this.arrived) / period, 1);
    return this.run.last - (this.run.moments.length > 1 ? 1 - share : 0);
  }

  draw(at, look, paint) {
    this.hands.step = at;
    this.scene.draw(0, at, { ...look, head: Math.min(look.head, this.run.heads - 1) }, paint);
    this.hands.draw();
  }

  /** What is above an arena that is not alone: who drives it, and what came of it so far. */
  showCaption(isShown) {
    if (!this.mark) return;
    const { now, worlds } = this.run;
    this.pane.dataset.chosen = String(isShown);
    if (this.choice.value !== this.policy) this.choice.value = this.policy;
    const found = [counted(now.rescued, "rescue")], { isDefined, imbalance } = this.balance;
    if (worlds.has_deadlines) found.push(`${this.losses} lost`);
    if (isDefined) found.push(`imbalance ${imbalance >= 0 ? imbalance.toFixed(2) : "–"}`);
    const text = found.join(" · ");
    if (this.counters.textContent !== text) this.counters.textContent = text;
  }

  /** What is said of the world now; of an arena that is not alone with its mark. */
  says() {
    const said = this.happened.map(({ text }) => `${text}.`);
    said.push(...this.run.hopeless().map(([need, tasks]) => `Nobody offers ${need} now: ${listed(tasks)} must wait.`));
    return this.mark ? said.map((text) => `${this.mark}: ${text}`) : said;
  }
}
