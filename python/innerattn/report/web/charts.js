// Strip charts below the arena: attention, reward, distance; a line on them shows the moment.

const MANY_LINES = 8;
const CHART = { width: 800, height: 112, left: 40, right: 118, top: 6, bottom: 18 };

/** The values of some lines, without gaps. */
function known(lines) {
  return lines.flatMap((line) => line.values).filter((value) => !Number.isNaN(value));
}

/** Charts of one robot of one policy; picks a moment when one clicks or drags on them. */
class Charts {
  constructor(box, pick) {
    this.box = box;
    this.pick = pick;
    this.cursors = [];
    this.width = CHART.width;
  }

  /** Draws the charts of an episode anew. */
  show(run, episode, look) {
    const robot = Math.max(look.robot, 0);
    Object.assign(this, { run, episode, robot, look: { ...look, robot } });
    this.length = run.lengths[episode];
    this.width = Math.max(300, this.box.clientWidth || CHART.width);
    this.cursors = [];
    const charts = [];
    if (run.attention) charts.push(this.attentionChart());
    if (run.rewards.length) charts.push(this.rewardChart());
    charts.push(this.distanceChart());
    this.box.replaceChildren(...charts);
  }

  x(step) {
    const { left, right } = CHART;
    return left + ((this.width - left - right) * step) / Math.max(this.length - 1, 1);
  }

  moveTo(step) {
    for (const cursor of this.cursors) cursor.setAttribute("transform", `translate(${this.x(step)} 0)`);
  }

  name(robot) {
    return this.run.worlds.robots[robot].name;
  }

  lineOf(robot, label, of) {
    const { worlds } = this.run, one = worlds.robots[robot];
    return { label, values: this.series(of), colour: kindColour(one.kindIndex), dash: dashOf(one) };
  }

  series(of) {
    return Array.from({ length: this.length }, (_, step) => of(step));
  }

  attentionChart() {
    const { run, episode, robot, look } = this, even = 1 / (run.size - 1);
    const lines = run.worlds.robots.filter((one) => one.index !== robot).map((one) => (
      this.lineOf(one.index, one.name, (step) => chosenWeight(run, episode, step, look, one.index))
    ));
    const which = look.head < 0 ? `mean of ${counted(run.heads, "head")}` : `head ${look.head + 1}`;
    const [title, whose] = look.received ? ["Attention received by", "from"] : ["Attention of", "to"];
    return this.chart(`${title} ${this.name(robot)}`, `${whose} each teammate, ${which}; dashed: even`, lines, {
      low: 0, high: Math.max(1.5 * even, ...known(lines)), text: percent,
      level: even, spans: this.handoffSpans(),
    });
  }

  /** Where the robot hands over: from its rescue with one partner to that with the next. */
  handoffSpans() {
    return this.run.handoffs[this.episode].filter((one) => one.robot === this.robot).map((one) => (
      { from: one.first, to: one.second, text: `${this.name(one.before)} → ${this.name(one.after)}` }
    ));
  }

  rewardChart() {
    const { run, episode, robot } = this, marks = ["var(--ink)", "var(--victim)", "var(--accent)", "var(--quiet)"];
    const lines = run.rewards.map(({ name }, index) => ({
      label: name, colour: marks[index % marks.length], dash: DASHES[index % DASHES.length],
      values: this.series((step) => run.reward(index, episode, step, robot)),
    }));
    const all = lines.flatMap((line) => line.values);
    return this.chart(`Reward of ${this.name(robot)}`, "in each step, by component", lines, {
      low: Math.min(0, ...all), high: Math.max(0.1, ...all), text: (value) => (Math.round(10 * value) / 10 || 0).toFixed(1), level: 0,
    });
  }

  distanceChart() {
    const { run, episode } = this;
    const all = run.worlds.robots.map((one) => ({
      ...this.lineOf(one.index, one.name, (step) => run.distance(episode, step, one.index)),
      thick: one.index === this.robot, isSpare: one.is_spare,
    }));
    const lines = all.filter(({ isSpare, values }) => !isSpare || values.some((value) => !Number.isNaN(value)));
    return this.chart("Distance", "to the nearest victim that the robot can help, in m; dashed: rescue radius", lines, {
      low: 0, high: Math.max(0.5, ...known(lines)), text: (value) => value.toFixed(1), level: run.worlds.rescue_radius_m,
    });
  }

  chart(title, note, lines, scale) {
    const { height, left, right, top, bottom } = CHART, { width } = this;
    const y = (value) => height - bottom - ((height - top - bottom) * (value - scale.low)) / (scale.high - scale.low);
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} ${note}` });
    const end = width - right, texts = [];
    for (const { from, to, text } of scale.spans || []) {
      const [x0, x1] = [this.x(from), this.x(to)];
      picture.append(svg("rect", { x: x0, y: top, width: x1 - x0, height: height - top - bottom, fill: "var(--grid)" }));
      texts.push({ x: (x0 + x1) / 2, text });
    }
    for (const value of [scale.low, scale.high]) {
      picture.append(svg("line", { x1: left, x2: end, y1: y(value), y2: y(value), stroke: "var(--line)" }));
      picture.append(svg("text", { x: left - 5, y: y(value) + 4, "text-anchor": "end", class: "scale" }, scale.text(value)));
    }
    const dashed = { stroke: "var(--quiet)", "stroke-dasharray": "4 4" };
    picture.append(svg("line", { x1: left, x2: end, y1: y(scale.level), y2: y(scale.level), ...dashed }));
    for (const rescue of this.run.rescues[this.episode]) {
      picture.append(eventMark("rescue", this.x(rescue.step), height - bottom + 9));
    }
    texts.push(...this.addFaults(picture, height - bottom));
    const drawn = [...lines].sort((a, b) => Number(a.thick || 0) - Number(b.thick || 0));
    for (const line of drawn) picture.append(this.path(line, y, lines.length));
    this.addLabels(picture, lines, y, end);
    picture.append(...this.texts(texts, end));
    const cursor = svg("line", { x1: 0, x2: 0, y1: 0, y2: height - bottom + 2, stroke: "var(--ink)", "stroke-width": 1.5 });
    picture.append(cursor);
    this.cursors.push(cursor);
    this.listen(picture);
    const heading = document.createElement("h2"), quiet = document.createElement("span");
    quiet.textContent = note;
    heading.append(title, quiet);
    const box = document.createElement("div");
    box.className = "chart";
    box.append(heading, picture);
    return box;
  }

  /** Marks the faults of all robots on the axis; gives their texts, of few robots or the chosen one. */
  addFaults(picture, axis) {
    const { run } = this, last = this.length - 1;
    return run.faults[this.episode].flatMap((fault) => {
      const from = this.x(fault.start), to = this.x(Math.min(fault.end, last));
      const text = `${this.name(fault.robot)}: ${faultText(run.worlds, fault)}`;
      const mark = svg("g", { class: "fault" });
      mark.append(svg("title", {}, text), svg("rect", { x: from, y: axis - 2, width: Math.max(to - from, 2), height: 4, fill: "var(--blocked)" }),
        eventMark("fault", from, axis + 9));
      if (fault.end <= last) mark.append(eventMark("recovery", to, axis + 9));
      picture.append(mark);
      return run.size <= MANY_LINES || fault.robot === this.robot ? [{ x: from, text }] : [];
    });
  }

  /** Texts in up to three rows, clear of each other; what finds no room is left out. */
  texts(found, end) {
    const rows = [[], [], []];
    return found.flatMap(({ x, text }) => {
      const half = 3.2 * [...text].length, at = Math.min(Math.max(x, CHART.left + half), Math.max(end - half, CHART.left + half));
      const row = rows.findIndex((taken) => taken.every((other) => Math.abs(other.at - at) > other.half + half));
      if (row < 0) return [];
      rows[row].push({ at, half });
      return [svg("text", { x: at, y: CHART.top + 11 + 14 * row, "text-anchor": "middle", class: "over" }, text)];
    });
  }

  path(line, y, count) {
    let d = "", pen = "M";
    line.values.forEach((value, step) => {
      if (Number.isNaN(value)) pen = "M";
      else {
        d += `${pen}${this.x(step).toFixed(1)} ${y(value).toFixed(1)}`;
        pen = "L";
      }
    });
    return svg("path", {
      d, fill: "none", stroke: line.colour, "stroke-width": line.thick ? 3.2 : count > MANY_LINES ? 1.2 : 2,
      "stroke-dasharray": line.dash.join(" "), "stroke-linejoin": "round",
    });
  }

  /** Names of the lines at their ends, moved apart; of many lines, the thick or the uppermost. */
  addLabels(picture, lines, y, end) {
    const last = (line) => line.values.findLast((value) => !Number.isNaN(value));
    const { height, bottom, top } = CHART, gap = 13;
    const room = Math.floor((height - bottom - top) / gap) + 1;
    const ends = lines.filter((line) => last(line) !== undefined).map((line) => ({ line, at: y(last(line)) })).sort((a, b) => a.at - b.at);
    const chosen = ends.filter(({ line }) => line.thick);
    const shown = lines.length > MANY_LINES && chosen.length ? chosen : ends.slice(0, room);
    shown.forEach((one, index) => {
      one.to = Math.max(one.at, index ? shown[index - 1].to + gap : top + 4);
    });
    for (let index = shown.length - 1, most = height - bottom; index >= 0; index--, most -= gap) {
      shown[index].to = Math.min(shown[index].to, most);
    }
    for (const { line, at, to } of shown) {
      const stroke = { stroke: line.colour, fill: "none", "stroke-dasharray": line.dash.join(" ") };
      picture.append(svg("path", { d: `M${end + 2} ${at}L${end + 8} ${to}h14`, "stroke-width": 2, ...stroke }));
      const text = [...line.label].length > 14 ? `${[...line.label].slice(0, 13).join("")}…` : line.label;
      picture.append(svg("text", { x: end + 26, y: to + 4, "font-weight": line.thick ? 700 : 400 }, text));
    }
  }

  listen(picture) {
    const choose = (event) => {
      const box = picture.getBoundingClientRect();
      const x = ((event.clientX - box.left) * this.width) / box.width;
      const share = (x - CHART.left) / (this.width - CHART.left - CHART.right);
      this.pick(Math.round(Math.min(Math.max(share, 0), 1) * (this.length - 1)));
    };
    picture.addEventListener("pointerdown", choose);
    picture.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) choose(event);
    });
  }
}
