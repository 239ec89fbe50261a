// Small pictures that canvas, scrubber, lists and legend share. A kind has a colour and a twin a
// dash; a task has a shape; an event has a shape; nothing is told by colour alone.

const SVG = "http://www.w3.org/2000/svg";
const DASHES = [[], [6, 4], [2, 3], [9, 3, 2, 3], [12, 4], [4, 2]];
const KINDS = 6;
const EDGES = [[], [4, 3], [1.5, 2.5], [7, 2, 1.5, 2]]; // of robots, by their layer

function svg(tag, attributes = {}, text = "") {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text) node.textContent = text;
  return node;
}

function kindColour(kindIndex) {
  return kindIndex < 0 ? "var(--neutral)" : `var(--kind-${kindIndex % KINDS})`;
}

function dashOf(robot) {
  return DASHES[robot.twin % DASHES.length];
}

function edgeOf(robot) {
  return EDGES[robot.layerIndex % EDGES.length];
}

/** Corners of a task's shape around a centre, as [x, y] pairs. */
function taskCorners(task, x, y, size) {
  const shapes = [
    [4, 0.785, 1.1], [4, 0, 1.2], [3, -1.571, 1.3], [6, 0, 1.1], [3, 1.571, 1.3], [5, -1.571, 1.15],
  ];
  const [count, turn, scale] = shapes[task % shapes.length];
  return Array.from({ length: count }, (_, corner) => {
    const angle = turn + (2 * Math.PI * corner) / count;
    return [x + size * scale * Math.cos(angle), y + size * scale * Math.sin(angle)];
  });
}

function points(corners) {
  return corners.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ");
}

/** The mark of an event around (x, y). */
function eventMark(type, x, y) {
  const shape = (corners, colour) => svg("polygon", { points: points(corners), fill: colour });
  if (type === "rescue") return shape(taskCorners(1, x, y, 5.5), "var(--victim)");
  if (type === "fault") return shape(taskCorners(2, x, y + 1, 5.5), "var(--blocked)");
  const common = { fill: "none", "stroke-width": 2 };
  if (type === "lost") {
    return svg("polygon", { points: points(taskCorners(1, x, y, 4.5)), stroke: "var(--victim)", ...common });
  }
  if (type === "recovery") {
    const corners = points(taskCorners(2, x, y + 1, 4.5));
    return svg("polygon", { points: corners, stroke: "var(--blocked)", ...common });
  }
  if (type === "joining") return svg("path", { d: `M${x - 4} ${y}h8M${x} ${y - 4}v8`, stroke: "var(--accent)", ...common });
  if (type === "handoff") {
    const d = `M${x - 5} ${y - 3}h8l-3 -3m3 3l-3 3M${x + 5} ${y + 4}h-8`;
    return svg("path", { d, stroke: "var(--accent)", ...common });
  }
  return svg("path", { d: `M${x - 4} ${y}h8`, stroke: "var(--quiet)", ...common });
}

function symbol(...children) {
  const node = svg("svg", { class: "symbol", viewBox: "-11 -11 22 22", "aria-hidden": "true" });
  node.append(...children);
  return node;
}

function robotSymbol(worlds, robot) {
  const colour = kindColour(robot.kindIndex);
  const edge = { "stroke-width": robot.layerIndex > 0 ? 2.5 : 1, "stroke-dasharray": edgeOf(robot).join(" ") };
  const disc = svg("circle", { r: 9, fill: colour, stroke: "var(--ink)", ...edge });
  const letters = robot.abilities.map((ability) => worlds.letters[ability]).join("");
  const text = svg("text", {
    y: 4, "text-anchor": "middle", "font-size": letters.length > 2 ? 7 : 11, "font-weight": 700,
    fill: letterColour(robot.kindIndex),
  }, letters);
  return symbol(disc, text);
}

/** Black on light kinds, white on the dark one; in both themes. */
function letterColour(kindIndex) {
  const dark = document.documentElement.dataset.theme === "dark";
  return kindIndex % KINDS === 0 && !dark ? "#ffffff" : "#000000";
}

function taskSymbol(task) {
  return symbol(svg("polygon", { points: points(taskCorners(task, 0, 0, 7)), fill: "var(--victim)" }));
}
