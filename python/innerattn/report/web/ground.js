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
  context.strokeStyle = paint.quiet;
  for (const { position_m: [x, y], radius_m: size } of worlds.stations ?? []) {
    const [atX, atY] = scene.at(x - size, y + size);
    context.strokeRect(atX, atY, 2 * size * scale, 2 * size * scale);
  }
  for (const { position_m: [x, y], radius_m: size } of worlds.depots ?? []) {
    context.beginPath();
    for (const [dx, dy] of [[size, 0], [0, size], [-size, 0], [0, -size]]) context.lineTo(...scene.at(x + dx, y + dy));
    context.closePath();
    context.stroke();
  }
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
  context.fill();
  context.stroke();
}
