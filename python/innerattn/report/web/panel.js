// The lists beside the arena: robots, events, legend; and the marks on the scrubber.

class RobotList {
  constructor(list, worlds, choose) {
    this.worlds = worlds;
    this.rows = worlds.robots.map((robot) => {
      const count = element("output"), note = element("small");
      const button = element("button", { type: "button" },
        robotSymbol(worlds, robot), element("strong", { title: robot.name }, robot.name), count, note);
      button.addEventListener("click", () => choose(robot.index));
      const row = element("li", {}, button);
      list.append(row);
      return { row, button, count, note };
    });
  }

  show(run, episode, step, look) {
    this.worlds.robots.forEach((robot, index) => {
      const { row, button, count, note } = this.rows[index];
      row.hidden = Boolean(robot.is_spare) && run.isAway(episode, step, index);
      button.setAttribute("aria-pressed", String(index === look.robot));
      count.textContent = counted(run.rescuesUntil(episode, step, index), "rescue");
      const faults = run.faultsAt(episode, step, index).map((one) => faultText(this.worlds, one));
      if (run.isBlocked(episode, step, index)) faults.push("blocked");
      const charge = run.charge(episode, step, index);
      if (robot.has_battery && charge === 0) faults.push("battery empty");
      const load = run.load(episode, step, index);
      if (robot.load && load === 0) faults.push("load used up");
      note.className = faults.length ? "bad" : "";
      const parts = faults.length ? faults : [`offers ${listed(withAmounts(robot.abilities, robot.amounts))}`];
      if (robot.has_battery && charge > 0) parts.push(`battery ${percent(charge)}`);
      if (robot.load && load > 0) parts.push(`load ${load} of ${robot.load}`);
      if (run.attention && look.robot >= 0 && index !== look.robot) {
        const weight = percent(chosenWeight(run, episode, step, look, index)), { name } = this.worlds.robots[look.robot];
        parts.push(look.received ? `gives ${name} ${weight}` : `${weight} of ${name}'s attention`);
      }
      note.textContent = parts.join(" · ");
    });
  }
}

/** Shows what is chosen in the controls that both pages with an arena have. */
function showLook({ received, all, least }) {
  $("direction").value = received ? "received" : "given";
  $("all").checked = all;
  $("least-box").hidden = !all;
  $("least").value = String(Math.round(100 * least));
  $("least-text").textContent = percent(least);
}

class EventList {
  constructor(list, empty, marks, pick) {
    Object.assign(this, { list, empty, marks, pick, events: [], rows: [] });
  }

  /** Shows the events of an episode; the scrubber has so many steps. */
  show(run, episode, steps) {
    this.events = eventsOf(run, episode);
    this.empty.hidden = this.events.length > 0;
    this.rows = this.events.map((event) => {
      const time = element("time", {}, `${(event.step * run.worlds.dt_s).toFixed(1)} s`);
      const button = element("button", { type: "button" }, time, symbol(eventMark(event.type, 0, 0)),
        element("span", {}, event.text));
      button.addEventListener("click", () => this.pick(event.step, event.robots[0]));
      return button;
    });
    this.list.replaceChildren(...this.rows.map((row) => element("li", {}, row)));
    this.drawMarks(steps);
  }

  /** Marks above the scrubber, whose thumb leaves out half its width at both ends. */
  drawMarks(length) {
    const width = this.marks.clientWidth || 600, thumb = 8;
    const x = (step) => thumb + ((width - 2 * thumb) * step) / Math.max(length - 1, 1);
    const marked = this.events.filter((event) => event.type !== "blocked");
    this.marks.replaceChildren(...marked.map((event) => (
      eventMark(event.type, x(event.step), event.type === "rescue" ? 6 : 18)
    )));
  }

  showStep(step) {
    this.rows.forEach((row, index) => {
      row.setAttribute("aria-current", String(this.events[index].step === Math.floor(step)));
    });
  }

  /** The next step with an event after one, or the one before it; -1: there is none. */
  next(step, forward) {
    const steps = this.events.map((event) => event.step);
    const found = forward ? steps.find((one) => one > step) : steps.findLast((one) => one < step);
    return found === undefined ? -1 : found;
  }
}

function fillLegend(list, worlds) {
  const row = (picture, text) => list.append(element("li", {}, picture, element("span", {}, text)));
  list.replaceChildren();
  for (const kind of worlds.kinds) {
    const robot = worlds.robots.find((one) => one.kind === kind);
    row(robotSymbol(worlds, robot), `${kind} robot, offers ${listed(withAmounts(robot.abilities, robot.amounts))}`);
  }
  for (const layer of worlds.layers.slice(1)) {
    const robot = worlds.robots.find((one) => one.layer === layer);
    row(robotSymbol(worlds, robot), `such an outline: a robot of layer ${layer}, which touches no robot of another layer`);
  }
  if (worlds.map) {
    const passing = worlds.map.passed_by.join(" and ");
    const cell = svg("rect", { x: -7, y: -7, width: 14, height: 14, fill: "var(--obstacle)", "fill-opacity": passing ? 0.4 : 1 });
    row(symbol(cell), passing ? `solid; robots of ${passing} pass it` : "solid");
  }
  for (const layers of new Set(worlds.obstacles.map((one) => one.passed_by.join(" and ")))) {
    const box = { x: -9, y: -6, width: 18, height: 12, fill: "var(--obstacle)", "fill-opacity": 0.4 };
    const edge = { stroke: "var(--obstacle-line)", "stroke-dasharray": EDGES[1].join(" ") };
    if (layers) row(symbol(svg("rect", { ...box, ...edge })), `an obstacle that robots of ${layers} pass`);
  }
  worlds.tasks.forEach((task, index) => {
    row(taskSymbol(index), `victim of ${task.name}, needs ${listed(withAmounts(task.needs, task.amounts))}`);
  });
  const line = (d, stroke = "var(--ink)", more = {}) => symbol(svg("path", { d, stroke, fill: "none", "stroke-width": 2.5, ...more }));
  const disc = (fill, stroke, radius = 8) => svg("circle", { r: radius, fill, stroke, "stroke-width": 2 });
  const kind = kindColour(0), cross = svg("path", { d: "M-6 -6L6 6M6 -6L-6 6", stroke: "var(--blocked)", "stroke-width": 3 });
  row(symbol(svg("circle", { r: 10, fill: "none", stroke: "var(--ink)", "stroke-width": 2 }), disc(kind, "none", 6)), "the chosen robot");
  row(line("M-9 0H9"), "line out of a robot: its velocity");
  if (worlds.robots.some((robot) => robot.has_wheels)) {
    const nose = svg("path", { d: "M10 0L3 -4V4Z", fill: "var(--ink)" });
    row(symbol(svg("circle", { r: 5, cx: -1, fill: kindColour(0) }), nose), "nose of a robot on wheels: where it points");
  }
  row(line("M-9 0H9", kind, { opacity: 0.4 }), "pale line behind a robot: its trail, the last 15 steps");
  row(line("M-9 4Q-2 -6 5 -1M1 -4L7 1L0 3", kind), "arrow: attention, from the robot that attends; the wider, the larger the weight");
  if (worlds.limits_communication) {
    const arrow = "M-9 0H9M4 -3.5L9 0L4 3.5";
    row(line(arrow, "var(--ink)", { "stroke-width": 1.3 }), "thin arrow: the robot at its head hears the one at its start");
  }
  if (worlds.robots.some((robot) => robot.range_sensor)) {
    const met = svg("path", { d: "M-9 -3H7", stroke: kind }), free = svg("path", { d: "M-9 4H9", stroke: kind, opacity: 0.3 });
    const end = svg("circle", { cx: 7, cy: -3, r: 2.5, fill: kind });
    row(symbol(met, free, end), "thin lines out of a robot: rays of its range sensor, up to the dot that they meet; pale: nothing is in range");
  }
  if (worlds.robots.some((robot) => robot.sight)) {
    row(symbol(svg("circle", { r: 9, fill: kind, "fill-opacity": 0.15, stroke: kind })), "pale area around a robot: how far it sees, unless an obstacle hides it");
  }
  if (worlds.occlusion || worlds.robots.some((robot) => robot.sight)) {
    const faint = svg("g", { opacity: 0.3 });
    faint.append(disc(kind, "var(--ink)", 7));
    row(symbol(faint), "faint robot or victim: out of sight of the chosen robot");
  }
  row(symbol(disc("var(--floor)", kind)), "small disc at a victim: what it needs");
  row(symbol(disc(kind, kind)), "filled small disc: robots that offer it, enough of it, are inside the rescue radius");
  const ring = svg("circle", { r: 9, fill: "none", stroke: "var(--victim)", "stroke-dasharray": "4 3", "stroke-width": 1.5 });
  row(symbol(ring), "dashed circle: the rescue radius");
  const brackets = svg("path", { d: "M-7 -6a9 9 0 0 0 0 12M7 -6a9 9 0 0 1 0 12", fill: "none", stroke: "var(--blocked)", "stroke-width": 3 });
  row(symbol(brackets), "blocked robot");
  row(symbol(eventMark("fault", 0, 0)), "a fault, or where it begins");
  row(symbol(eventMark("recovery", 0, 0)), "where a fault ends");
  row(line("M-9 0H9", "var(--blocked)", { "stroke-width": 4 }), "line below a chart: how long a fault lasts");
  row(symbol(disc("var(--floor)", kind), cross), "a robot that is out");
  row(symbol(eventMark("rescue", 0, 0)), "a rescue");
  if (worlds.has_services) {
    const arc = svg("path", { d: "M0 -8a8 8 0 1 1 -8 8", fill: "none", stroke: "var(--victim)", "stroke-width": 4 });
    row(symbol(arc), "thick arc around a victim: the share of its service that it has had");
  }
  for (const [name, { sign, what }] of Object.entries(STOPS)) {
    if ((worlds[name] ?? []).length) row(symbol(svg("path", { d: sign, fill: "none", stroke: "var(--quiet)" })), what);
  }
  if (worlds.has_deadlines) {
    row(symbol(eventMark("lost", 0, 0)), "a victim is lost; seconds below a victim: until it is");
  }
  if (worlds.has_order) {
    const corners = points(taskCorners(0, 0, 0, 7));
    row(symbol(svg("polygon", { points: corners, fill: "none", stroke: "var(--victim)", "stroke-dasharray": "2 2" })), "dashed victim: it waits until others are rescued or lost");
  }
  row(symbol(eventMark("handoff", 0, 0)), "a handoff: a robot rescues with another partner than before");
  row(symbol(svg("rect", { x: -9, y: -9, width: 18, height: 18, fill: "var(--grid)", stroke: "var(--line)" })), "grey band in a chart: from the rescue before a handoff to that after it");
}
