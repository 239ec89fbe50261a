// Draws what lies below all else in an arena: floor, grid, obstacles, walls and a scale.

/** The page's colours as canvases need them. */
function paints() {
  const style = getComputedStyle(document.documentElement), found = { kinds: [] };
  const names = ["floor", "grid", "wall", "ink", "quiet", "victim", "obstacle", "obstacle-line",
    "blocked", "card", "neutral"];
  for (const name of names) found[name] = style.getPropertyValue(`--${name}`).trim();
  for (let kind = 0; kind < KINDS; kind++) {
    found.kinds.push(style.getPropertyValue(`--kind-${kind}`).trim());
  }
  found.of = (kindIndex) => (kindIndex < 0 ? found.neutral : found.kinds[kindIndex % KINDS]);
  return found;
}

/** Places that give robots something, by their name in worlds: a sign of 16 by 16, and what they are. */
const STOPS = {
  stations: { sign: "M2 -8L-5 2L-1 2L-2 8L5 -2L1 -2Z", what: "a station that charges batteries, and its reach" },
  depots: { sign: "M-7 -5L7 -5L7 7L-7 7ZM-7 -1L7 -1M0 -5L0 -1", what: "a depot that refills loads, and its reach" },
};

function drawStop(scene, { position_m, radius_m }, sign) {
  const { context, paint, scale } = scene, [x, y] = scene.at(...position_m);
  context.beginPath();
  context.arc(x, y, radius_m * scale, 0, 7);
  context.fillStyle = paint.grid;
  context.strokeStyle = paint.quiet;
  context.fill();
  context.stroke();
  context.translate(x, y);
  context.stroke(new Path2D(sign));
  context.translate(-x, -y);
}

function drawGround(scene) {
  const { context, paint, scale, worlds } = scene, half = worlds.half_width_m;
  const [left, top] = scene.at(-half, half), side = 2 * half * scale;
  context.fillStyle = paint.floor;
  context.fillRect(left, top, side, side);
  context.strokeStyle = paint.grid;
  context.lineWidth = 1;
  context.setLineDash([]);
  context.beginPath();
  for (let line = -Math.floor(half * 2) / 2; line < half; line += 0.5) {
    const [x, y] = scene.at(line, line);
    context.moveTo(x, top);
    context.lineTo(x, top + side);
    context.moveTo(left, y);
    context.lineTo(left + side, y);
  }
  context.stroke();
  context.save();
  context.beginPath();
  context.rect(left, top, side, side);
  context.clip();
  for (const [name, { sign }] of Object.entries(STOPS)) {
    for (const stop of worlds[name] ?? []) drawStop(scene, stop, sign);
  }
  context.restore();
  if (worlds.map) drawMap(scene, worlds.map);
  worlds.obstacles.forEach((shape, index) => drawObstacle(scene, shape, index));
  context.strokeStyle = paint.wall;
  context.lineWidth = 3;
  context.strokeRect(left - 1.5, top - 1.5, side + 3, side + 3);
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(left + 10, top + side - 10);
  context.lineTo(left + 10 + 0.5 * scale, top + side - 10);
  context.strokeStyle = paint.quiet;
  context.stroke();
  scene.font(11);
  context.fillStyle = paint.quiet;
  context.textAlign = "left";
  context.fillText("0.5 m", left + 10, top + side - 18);
}

/** All solid cells in one path, so that no lines stand between them. */
function drawMap(scene, map) {
  const { context, paint, scale } = scene;
  context.beginPath();
  for (const [x, y, width, height] of map.boxes) {
    const [left, top] = scene.at(x - width, y + height);
    context.rect(left, top, 2 * width * scale, 2 * height * scale);
  }
  context.fillStyle = paint.obstacle;
  context.globalAlpha = map.passed_by.length ? 0.4 : 1;
  context.fill();
  context.globalAlpha = 1;
}

function drawObstacle(scene, shape, index) {
  const { context, paint, scale } = scene;
  const [x, y] = scene.at(...scene.worlds.obstacle(scene.episode, index));
  context.beginPath();
  if (shape.radius_m !== null) context.arc(x, y, shape.radius_m * scale, 0, 7);
  else {
    const [width, height] = shape.half_extents_m.map((half) => half * scale);
    context.rect(x - width, y - height, 2 * width, 2 * height);
  }
  context.fillStyle = paint.obstacle;
  context.strokeStyle = paint["obstacle-line"];
  context.lineWidth = 1.5;
  context.globalAlpha = shape.passed_by.length ? 0.4 : 1;
  context.fill();
  context.globalAlpha = 1;
  context.setLineDash(shape.passed_by.length ? EDGES[1] : []);
  context.stroke();
  context.setLineDash([]);
}
