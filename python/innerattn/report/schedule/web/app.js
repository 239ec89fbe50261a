// The page: the time that is shown, and what buttons, keys and the clock do.

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const WHOLE_S = 30; // how long all takes at speed 1
const STEPS = 1000; // of the slider

class App {
  constructor(described) {
    this.course = new Course(described);
    Object.assign(this, { time: 0, playing: false, speed: 1 });
    this.map = new TaskMap($("map"), this.course);
    this.gantt = new Gantt($("gantt"), this.course, (time) => this.goTo(time));
    fillSelect($("speed"), SPEEDS.map((speed) => [String(speed), `${speed}×`]), "1");
    this.fillTasks();
    this.listen();
    startTheme(() => this.takeTheme());
    new ResizeObserver(() => this.fit()).observe($("stage"));
  }

  fillTasks() {
    const byStart = this.course.tasks.map((task, index) => ({ ...task, index }));
    byStart.sort((a, b) => a.start - b.start);
    this.rows = byStart.map((task) => {
      const state = element("output");
      const note = `needs ${task.skills.length > 1 ? "skills" : "skill"} ${listed(task.skills)}; from ` +
        `${this.course.text(task.start)} to ${this.course.text(task.end)}, by ${task.robots.length > 1 ? "robots" : "robot"} ${listed(task.robots)}`;
      const button = element("button", { type: "button" }, element("strong", {}, `task ${task.index}`), state, element("small", {}, note));
      button.addEventListener("click", () => this.goTo(task.start));
      $("tasks").append(element("li", {}, button));
      return { task, state };
    });
  }

  listen() {
    const on = (id, type, action) => $(id).addEventListener(type, action);
    on("play", "click", () => this.setPlaying(!this.playing));
    on("back", "click", () => this.next(false));
    on("forward", "click", () => this.next(true));
    on("scrubber", "input", () => this.goTo((Number($("scrubber").value) / STEPS) * this.course.makespan));
    on("speed", "change", () => this.setSpeed(Number($("speed").value)));
    document.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const { target } = event, range = target.type === "range";
    if (!$("keys").checked || event.ctrlKey || event.metaKey || event.altKey) return;
    if (target.tagName === "SELECT") return;
    const presses = target.closest("button, summary, input:not([type=range])");
    const at = SPEEDS.indexOf(this.speed), small = this.course.makespan / 100;
    const actions = {
      " ": presses ? null : () => this.setPlaying(!this.playing),
      ArrowLeft: range ? null : () => this.goTo(this.time - small),
      ArrowRight: range ? null : () => this.goTo(this.time + small),
      ",": () => this.next(false),
      ".": () => this.next(true),
      "-": () => this.setSpeed(SPEEDS[Math.max(at - 1, 0)]),
      "+": () => this.setSpeed(SPEEDS[Math.min(at + 1, SPEEDS.length - 1)]),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  setSpeed(speed) {
    this.speed = speed;
    $("speed").value = String(speed);
  }

  setPlaying(playing) {
    if (playing && this.time >= this.course.makespan) this.time = 0;
    this.playing = playing;
    $("play").textContent = playing ? "Pause" : "Play";
    $("now").setAttribute("aria-live", playing ? "off" : "polite");
    this.before = null;
    if (playing) requestAnimationFrame((now) => this.tick(now));
    else this.draw();
  }

  tick(now) {
    if (!this.playing) return;
    const { makespan } = this.course;
    if (this.before !== null) this.time += (this.speed * makespan * (now - this.before)) / (1000 * WHOLE_S);
    this.before = now;
    if (this.time >= makespan) {
      this.time = makespan;
      this.setPlaying(false);
      return;
    }
    this.draw();
    requestAnimationFrame((next) => this.tick(next));
  }

  goTo(time) {
    this.time = Math.min(Math.max(time, 0), this.course.makespan);
    if (this.playing) this.setPlaying(false);
    else this.draw();
  }

  /** To the next time at which work begins or ends, or the one before. */
  next(forward) {
    const { moments } = this.course;
    const found = forward ? moments.find((one) => one > this.time) : moments.findLast((one) => one < this.time);
    if (found !== undefined) this.goTo(found);
  }

  /** Takes the colours of the theme. */
  takeTheme() {
    this.paint = paints();
    fillLegend($("legend"), this.course);
    this.fit();
  }

  fit() {
    this.map.fit();
    this.gantt.draw(this.paint);
    this.draw();
  }

  draw() {
    const { course, time } = this;
    this.map.draw(time, this.paint);
    this.gantt.moveTo(time);
    $("scrubber").value = Math.round((STEPS * time) / (course.makespan || 1));
    const done = `${course.doneAt(time)} of ${counted(course.tasks.length, "task")} done`;
    const clock = `${course.text(time)} of ${course.text(course.makespan)} · ${done}`;
    if ($("clock").textContent === clock) return;
    $("clock").textContent = clock;
    $("scrubber").setAttribute("aria-valuetext", clock);
    $("now").textContent = course.momentText(time);
    $("map").setAttribute("aria-label", `Map: ${course.momentText(time)}`);
    for (const { task, state } of this.rows) state.textContent = course.stateOf(task, time);
  }
}

function fillLegend(list, { robots }) {
  const row = (picture, text) => list.append(element("li", {}, picture, element("span", {}, text)));
  list.replaceChildren();
  const kinds = new Map(robots.map((robot) => [robot.kind, robot]));
  const disc = (fill, stroke, radius) => svg("circle", { r: radius, fill, stroke, "stroke-width": 1.5 });
  for (const { kind, skills } of kinds.values()) {
    const has = skills.length ? `${skills.length > 1 ? "skills" : "skill"} ${listed(skills)}` : "no skill";
    row(symbol(disc(kindColour(kind), "var(--ink)", 8)), `robot with ${has}`);
  }
  const square = (fill, stroke) => svg("polygon", { points: points(taskCorners(0, 0, 0, 8)), fill, stroke, "stroke-width": 1.5 });
  const depot = svg("polygon", { points: points(taskCorners(1, 0, 0, 6)), fill: "none", stroke: "var(--quiet)", "stroke-width": 1.5 });
  row(symbol(depot), "depot");
  row(symbol(square("var(--card)", "var(--victim)")), "task that waits");
  row(symbol(square("var(--victim)", "var(--victim)")), "task being worked on; the circle around its robots closes");
  row(symbol(square("var(--grid)", "var(--quiet)")), "task that is done");
  row(symbol(disc("var(--floor)", kindColour(0), 3.5)), "small circle at a task: a robot that it needs");
  const bar = (more) => svg("rect", { x: -10, y: -6, width: 20, height: 12, fill: kindColour(0), ...more });
  const outline = { fill: "none", stroke: kindColour(0), "stroke-width": 1.5 };
  row(symbol(bar({ "fill-opacity": 0.28 })), "pale bar: drives to a task");
  row(symbol(bar(outline), svg("path", { d: "M-10 6L2 -6M-2 6L10 -6", ...outline })), "hatched bar: waits for other robots");
  row(symbol(bar({})), "full bar with a number: works on that task");
  row(symbol(bar({ ...outline, "stroke-dasharray": "3 3" })), "dashed bar: drives home");
}

try {
  window.replay = new App(JSON.parse($("data").textContent));
} catch (error) {
  $("problem").textContent = `This schedule cannot be shown: ${error.message}`;
  $("problem").hidden = false;
}
