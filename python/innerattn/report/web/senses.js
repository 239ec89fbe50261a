// What robots hear, measure and see: its switches, and how it is drawn.

const SENSES = { hearing: "own", rays: true, sight: true }; // as a page begins

/** Switches for the senses that a page knows of; `change` takes what is to be drawn. */
function fillSenses(box, run, look, change) {
  const { robots } = run.worlds;
  const toggle = (name, text) => {
    const input = element("input", { type: "checkbox", id: name });
    input.checked = look[name];
    input.addEventListener("change", () => change({ [name]: input.checked }));
    box.append(element("label", { class: "inline" }, input, ` ${text}`));
  };
  box.replaceChildren();
  if (run.heard) {
    const select = element("select", { id: "hearing" });
    const texts = [["none", "hidden"], ["own", "chosen robot"], ["all", "all robots"]];
    fillSelect(select, texts, look.hearing);
    select.addEventListener("change", () => change({ hearing: select.value }));
    box.append(element("label", { class: "inline" }, "Who hears whom ", select));
  }
  if (run.rays && robots.some((robot) => robot.range_sensor)) toggle("rays", "rays");
  if (run.worlds.occlusion || robots.some((robot) => robot.sight)) toggle("sight", "sight");
  box.hidden = !box.children.length;
}

/** Ends of a robot's rays [m], and whether each meets something; none of a robot without a sensor. */
function rayEnds(run, episode, step, robot) {
  const sensor = run.worlds.robots[robot].range_sensor, at = Math.floor(step);
  if (!sensor || !run.rays) return [];
  const [x, y] = run.place(episode, at, robot), ahead = run.heading(episode, at, robot) ?? 0;
  return sensor.angles_rad.map((angle, ray) => {
    const reading = run.reading(episode, at, robot, ray), far = (1 - reading) * sensor.range_m;
    return { x: x + far * Math.cos(ahead + angle), y: y + far * Math.sin(ahead + angle), met: reading > 0 };
  });
}

/** Pairs [who hears, who is heard] that a look asks for. */
function heardPairs(run, episode, step, look) {
  if (!run.heard || look.hearing === "none") return [];
  const robots = run.worlds.robots.map((robot) => robot.index);
  const hearers = look.hearing === "all" || look.robot < 0 ? robots : [look.robot];
  return hearers.flatMap((hearer) => (
    robots.filter((other) => run.hears(episode, step, hearer, other)).map((other) => [hearer, other])
  ));
}

/** Robots whose rays and sight are drawn: the chosen one, or all. */
function sensing({ worlds, look }) {
  return look.robot < 0 ? worlds.robots : [worlds.robots[look.robot]];
}

/** Robots and victims that the chosen robot does not see, by index and id; none while nobody is chosen. */
function outOfSight({ run, worlds, look, episode, step }) {
  const seer = look.sight ? worlds.robots[look.robot] : undefined;
  if (!seer || !(seer.sight || worlds.occlusion)) return { robots: [], victims: [] };
  const isHidden = ([x, y]) => !isInSight(run, episode, step, seer, x, y);
  const others = worlds.robots.filter((one) => one !== seer && isHidden(run.place(episode, step, one.index)));
  const victims = run.victims[episode].filter((one) => step >= one.from && step < one.to && isHidden([one.x, one.y]));
  return { robots: others.map((one) => one.index), victims: victims.map((one) => one.id) };
}

/** Whether a robot sees a place [m]: as far, as wide, and with nothing in the way; faults are left out. */
function isInSight(run, episode, step, seer, x, y) {
  const { worlds } = run, from = run.place(episode, step, seer.index), way = [x - from[0], y - from[1]];
  const { range_m: range, field_of_view_rad: field } = seer.sight ?? { range_m: null, field_of_view_rad: 2 * Math.PI };
  if (range !== null && Math.hypot(...way) > range) return false;
  if (field < 2 * Math.PI - 1e-6) {
    const off = Math.atan2(way[1], way[0]) - (run.heading(episode, step, seer.index) ?? 0);
    if (Math.abs(Math.atan2(Math.sin(off), Math.cos(off))) > field / 2) return false;
  }
  if (!worlds.occlusion) return true;
  const blocks = (solid) => !solid.passed_by.includes(seer.layer);
  const isCrossed = (shape, [cx, cy]) => leadsThrough(shape, [from[0] - cx, from[1] - cy], way);
  if (worlds.obstacles.some((one, index) => blocks(one) && isCrossed(one, worlds.obstacle(episode, index)))) return false;
  return !(worlds.map && blocks(worlds.map) && worlds.map.boxes.some(([cx, cy, ...half]) => (
    isCrossed({ radius_m: null, half_extents_m: half }, [cx, cy])
  )));
}

/** Whether a straight way leads through a disc or a box around the origin. */
function leadsThrough({ radius_m: radius, half_extents_m: half }, [x, y], [wx, wy]) {
  if (radius !== null) {
    const share = Math.min(Math.max(-(x * wx + y * wy) / Math.max(wx * wx + wy * wy, 1e-12), 0), 1);
    return Math.hypot(x + share * wx, y + share * wy) < radius;
  }
  const [mx, my] = [x + wx / 2, y + wy / 2], [rx, ry] = [Math.abs(wx) / 2, Math.abs(wy) / 2];
  return Math.abs(mx) < half[0] + rx && Math.abs(my) < half[1] + ry
    && Math.abs(mx * wy - my * wx) < half[0] * Math.abs(wy) + half[1] * Math.abs(wx);
}

/** Below robots and victims, and only inside the walls; `scene.rays` keeps the ends that it drew. */
function drawSenses(scene) {
  const { context, look, worlds, scale } = scene, half = worlds.half_width_m;
  scene.rays = [];
  context.save();
  context.beginPath();
  context.rect(...scene.at(-half, half), 2 * half * scale, 2 * half * scale);
  context.clip();
  if (look.sight) sensing(scene).forEach((robot) => drawSight(scene, robot));
  if (look.rays) sensing(scene).forEach((robot) => drawRays(scene, robot));
  context.restore();
}

/** How far a robot sees, and within which angle. */
function drawSight(scene, robot) {
  if (!robot.sight) return;
  const { context, paint, run, worlds, episode, step } = scene, [x, y] = scene.spots[robot.index];
  const { range_m: range, field_of_view_rad: field } = robot.sight;
  const radius = (range ?? 3 * worlds.half_width_m) * scene.scale;
  const ahead = run.heading(episode, step, robot.index) ?? 0;
  context.beginPath();
  if (field < 2 * Math.PI - 1e-6) context.moveTo(x, y);
  context.arc(x, y, radius, -ahead - field / 2, -ahead + field / 2);
  context.closePath();
  context.fillStyle = context.strokeStyle = paint.of(robot.kindIndex);
  context.globalAlpha = 0.08;
  context.fill();
  context.globalAlpha = 0.5;
  context.lineWidth = 1;
  context.stroke();
  context.globalAlpha = 1;
}

/** A robot's rays; one that meets something ends in a dot, any other one is faint. */
function drawRays(scene, robot) {
  const { context, paint, run, episode, step } = scene, [x, y] = scene.spots[robot.index];
  if (Number.isNaN(x)) return;
  context.strokeStyle = context.fillStyle = paint.of(robot.kindIndex);
  context.lineWidth = 1.2;
  for (const end of rayEnds(run, episode, step, robot.index)) {
    scene.rays.push({ robot: robot.index, ...end });
    const [ex, ey] = scene.at(end.x, end.y);
    context.globalAlpha = end.met ? 0.75 : 0.22;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(ex, ey);
    context.stroke();
    if (!end.met) continue;
    context.beginPath();
    context.arc(ex, ey, 2.5, 0, 7);
    context.fill();
  }
  context.globalAlpha = 1;
}

/** A thin arrow to each robot from those that it hears; `scene.heard` keeps these pairs. */
function drawHearing(scene) {
  const { context, paint, run, worlds, episode, step, look } = scene;
  context.strokeStyle = paint.ink;
  context.lineWidth = 1.3;
  scene.heard = heardPairs(run, episode, step, look);
  for (const [to, from] of scene.heard) {
    const [ax, ay] = scene.spots[from], [bx, by] = scene.spots[to];
    const length = Math.hypot(bx - ax, by - ay), turn = Math.atan2(by - ay, bx - ax);
    const start = worlds.robots[from].radius_m * scene.scale + 2;
    const end = length - worlds.robots[to].radius_m * scene.scale - 4;
    if (!(end > start)) continue; // they touch, or one has left
    context.globalAlpha = to === look.robot ? 0.9 : 0.5;
    context.translate(ax, ay);
    context.rotate(turn);
    context.beginPath(); // beside the middle: those who hear each other have two
    context.moveTo(start, 3);
    context.lineTo(end, 3);
    context.moveTo(end - 6, -0.5);
    context.lineTo(end, 3);
    context.lineTo(end - 6, 6.5);
    context.stroke();
    context.rotate(-turn);
    context.translate(-ax, -ay);
  }
  context.globalAlpha = 1;
}
