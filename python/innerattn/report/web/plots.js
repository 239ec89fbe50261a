// Draws plots of numbers: courses over time with bands, or a value for each of some rows.
// A plot is what innerattn.report.runs.plots.Plot.to_json gives; colours are the page's.

const PLOT = { height: 300, left: 58, right: 16, top: 12, bottom: 42, row: 12, point: 9, near: 12 };

/** About so many round numbers from low to high, both included. */
function ticks(low, high, count) {
  const raw = (high - low) / count, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((factor) => factor * size).find((one) => one >= raw * 0.999);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, index) => (first + index) * step);
}

function short(value) {
  return value.toLocaleString("en", { maximumSignificantDigits: 6, maximumFractionDigits: 6 });
}

function valueText(value) {
  return value.toFixed(2).replace(/^-(0\.00)$/, "$1");
}

function given(values) {
  return values.filter((value) => value !== null && value !== undefined);
}

/** A plot in a box, drawn anew when the box gets another width. */
class PlotView {
  constructor(box) {
    this.box = box;
    this.plot = null;
    this.width = 0;
    new ResizeObserver(() => {
      if (this.plot && Math.abs(this.box.clientWidth - this.width) > 1) this.show(this.plot);
    }).observe(box);
  }

  show(plot) {
    this.plot = plot;
    this.width = Math.max(this.box.clientWidth, 240);
    const title = element("h3", {}, plot.title);
    const picture = plot.rows.length ? this.rows() : this.courses();
    picture.setAttribute("class", "picture");
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", `${plot.title}. ${plot.note}`);
    this.box.replaceChildren(title, picture, this.legend());
  }

  canvas(height) {
    return svg("svg", { viewBox: `0 0 ${this.width} ${height}`, height });
  }

  /** Rules and numbers of one axis: place gives the coordinate of a value. */
  axis(picture, values, place, vertical, from, to) {
    for (const value of values) {
      const at = place(value);
      const ends = vertical ? { x1: from, x2: to, y1: at, y2: at } : { x1: at, x2: at, y1: from, y2: to };
      picture.append(svg("line", { ...ends, class: "rule" }));
      const anchor = at > this.width - 30 ? { x: this.width - 1, "text-anchor": "end" } : { x: at, "text-anchor": "middle" };
      const spot = vertical ? { x: from - 7, y: at + 4, "text-anchor": "end" } : { y: to + 17, ...anchor };
      picture.append(svg("text", spot, short(value)));
    }
  }

  scale(values, from, to) {
    const low = Math.min(0, ...values), high = Math.max(...values, low + 1e-9) * 1.06;
    return { low, high, place: (value) => from + ((to - from) * (value - low)) / (high - low) };
  }

  courses() {
    const { plot, width } = this, { height, left, right, top, bottom } = PLOT;
    const picture = this.canvas(height), end = width - right, floor = height - bottom;
    const times = plot.lines.flatMap((line) => line.x);
    const seen = plot.lines.flatMap((line) => [line.y, line.low, line.high].flatMap(given));
    const y = this.scale([...given(seen), ...Object.values(plot.levels), 1e-9], floor, top);
    const [first, last] = times.length ? [Math.min(...times), Math.max(...times)] : [0, 1];
    const start = first > 0 ? 0 : first, span = last - start || 1;
    const x = (value) => left + ((end - left) * (value - start)) / span;
    this.axis(picture, ticks(y.low, y.high, 5), y.place, true, left, end);
    this.axis(picture, ticks(start, start + span, width < 500 ? 3 : 6), x, false, top, floor);
    picture.append(svg("text", { x: (left + end) / 2, y: height - 6, "text-anchor": "middle" }, plot.x));
    picture.append(svg("text", { transform: `translate(13 ${(top + floor) / 2}) rotate(-90)`, "text-anchor": "middle" }, plot.y));
    for (const line of plot.lines) if (line.low.length) picture.append(this.band(line, x, y.place));
    this.levels(picture, y.place, left, end);
    for (const line of plot.lines) {
      const known = line.x.map((_, index) => index).filter((index) => line.y[index] !== null);
      const spots = known.map((index) => `${x(line.x[index]).toFixed(1)} ${y.place(line.y[index]).toFixed(1)}`);
      picture.append(svg("path", { d: spots.length ? `M${spots.join("L")}` : "", ...stroked(line) }));
      if (spots.length === 1) {
        const [cx, cy] = spots[0].split(" ");
        picture.append(svg("circle", { cx, cy, r: 4, fill: `var(--${line.colour})` }));
      }
    }
    this.follow(picture, x, top, floor);
    return picture;
  }

  band(line, x, y) {
    const known = line.x.map((_, index) => index).filter((index) => line.low[index] !== null && line.high[index] !== null);
    const corner = (values) => (index) => `${x(line.x[index]).toFixed(1)},${y(values[index]).toFixed(1)}`;
    const corners = [...known.map(corner(line.high)), ...[...known].reverse().map(corner(line.low))];
    return svg("polygon", { points: corners.join(" "), fill: `var(--${line.colour})`, "fill-opacity": 0.18 });
  }

  /** Dashed lines with their names; a name that would lie on the one above it goes below its line. */
  levels(picture, y, left, end) {
    let above = -Infinity;
    for (const [name, value] of Object.entries(fromTheTop(this.plot.levels))) {
      const at = y(value);
      picture.append(svg("line", { x1: left, x2: end, y1: at, y2: at, class: "level" }));
      const spot = at - 4 - above < 13 ? at + 13 : at - 4;
      picture.append(svg("text", { x: end - 2, y: spot, "text-anchor": "end", class: "over" }, name));
      above = spot;
    }
  }

  /** A cursor: the legend tells the values at its time. */
  follow(picture, x, top, floor) {
    const cursor = svg("line", { y1: top, y2: floor, class: "cursor", visibility: "hidden" });
    const time = svg("text", { y: top + 3, class: "over", visibility: "hidden" });
    picture.append(cursor, time);
    const look = (event) => {
      const box = picture.getBoundingClientRect(), at = ((event.clientX - box.left) * this.width) / box.width;
      const nearest = this.plot.lines.map((line) => (
        line.x.reduce((best, value, index) => (
          line.y[index] !== null && (best < 0 || Math.abs(x(value) - at) < Math.abs(x(line.x[best]) - at)) ? index : best
        ), -1)
      ));
      const found = nearest.map((index, which) => this.plot.lines[which].x[index]).filter((value) => value !== undefined);
      if (!found.length) return;
      const when = found.reduce((best, value) => (Math.abs(x(value) - at) < Math.abs(x(best) - at) ? value : best));
      for (const node of [cursor, time]) node.setAttribute("visibility", "visible");
      cursor.setAttribute("x1", x(when));
      cursor.setAttribute("x2", x(when));
      const right = x(when) > this.width / 2;
      time.setAttribute("x", x(when) + (right ? -5 : 5));
      time.setAttribute("text-anchor", right ? "end" : "start");
      time.textContent = short(when);
      nearest.forEach((index, which) => {
        const line = this.plot.lines[which], near = Math.abs(x(line.x[index]) - x(when)) < PLOT.near;
        this.values[which].textContent = near ? valueText(line.y[index]) : "";
      });
    };
    picture.addEventListener("pointermove", look);
    picture.addEventListener("pointerdown", look);
    picture.addEventListener("pointerleave", () => {
      for (const node of [cursor, time]) node.setAttribute("visibility", "hidden");
      for (const node of this.values) node.textContent = "";
    });
  }

  /** A row for each name, with a point and its interval for each line. */
  rows() {
    const { plot, width } = this, { right, top, bottom } = PLOT;
    const row = Math.max(28, PLOT.row + PLOT.point * plot.lines.length);
    const left = Math.min(150, width * 0.42), end = width - right;
    const floor = top + row * plot.rows.length, picture = this.canvas(floor + bottom);
    const seen = plot.lines.flatMap((line) => [line.y, line.low, line.high].flatMap(given));
    const x = this.scale([...given(seen), ...Object.values(plot.levels)], left, end);
    this.axis(picture, ticks(x.low, x.high, width < 500 ? 3 : 6), x.place, false, top, floor);
    picture.append(svg("text", { x: (left + end) / 2, y: floor + bottom - 6, "text-anchor": "middle" }, plot.y));
    for (const value of Object.values(plot.levels)) {
      picture.append(svg("line", { x1: x.place(value), x2: x.place(value), y1: top, y2: floor, class: "level" }));
    }
    plot.rows.forEach((name, index) => {
      const middle = top + row * (index + 0.5);
      picture.append(svg("text", { x: left - 10, y: middle + 4, "text-anchor": "end" }, name));
      plot.lines.forEach((line, which) => {
        const found = line.x.indexOf(index);
        if (found < 0) return;
        const at = middle + (row - PLOT.row) * ((which + 0.5) / plot.lines.length - 0.5);
        const ends = { x1: x.place(line.low[found]), x2: x.place(line.high[found]), y1: at, y2: at };
        const colour = `var(--${line.colour})`;
        picture.append(svg("line", { ...ends, stroke: colour, "stroke-width": 2 }));
        picture.append(svg("polygon", { points: points(taskCorners(which, x.place(line.y[found]), at, 4.5)), fill: colour }));
      });
    });
    return picture;
  }

  legend() {
    this.values = this.plot.lines.map(() => element("span", { class: "value" }));
    const items = this.plot.lines.map((line, which) => {
      const mark = svg("svg", { viewBox: "0 0 30 12", width: 30, height: 12, "aria-hidden": "true" });
      if (this.plot.rows.length) mark.append(svg("polygon", { points: points(taskCorners(which, 15, 6, 5)), fill: `var(--${line.colour})` }));
      else mark.append(svg("path", { d: "M1 6h28", ...stroked(line) }));
      return element("li", {}, mark, line.name, this.values[which]);
    });
    return element("ul", { class: "legend" }, ...items);
  }
}

function fromTheTop(levels) {
  return Object.fromEntries(Object.entries(levels).sort(([, one], [, other]) => other - one));
}

function stroked(line) {
  return {
    fill: "none", stroke: `var(--${line.colour})`, "stroke-width": line.thin ? 1.5 : 2.5,
    "stroke-dasharray": DASHES[line.dash % DASHES.length].join(" "), "stroke-linejoin": "round",
  };
}

const views = new WeakMap();

/** Draws a plot in a box, or anew with other numbers. */
function drawPlot(box, plot) {
  if (!views.has(box)) views.set(box, new PlotView(box));
  views.get(box).show(plot);
}
