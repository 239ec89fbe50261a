// Draws one policy's arena at a moment on a canvas.

const TRAIL_STEPS = 15;
const FLASH_STEPS = 2.5;
const WIDEST_ARROW = 0.055; // of the arena's half width, for a weight of 1
const FEW_ROBOTS = 8;

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

class Scene {
  constructor(canvas, run) {
    this.canvas = canvas;
    this.run = run;
    this.worlds = run.worlds;
    this.context = canvas.getContext("2d");
    this.fit();
  }

  /** Takes the canvas' size on the screen. */
  fit() {
    const side = Math.max(this.canvas.clientWidth, 120), ratio = window.devicePixelRatio || 1;
    this.canvas.width = this.canvas.height = Math.round(side * ratio);
    this.side = side;
    this.ratio = ratio;
    this.margin = 10;
    this.scale = (side - 2 * this.margin) / (2 * this.worlds.half_width_m);
    this.letters = Math.min(13, Math.max(11, side / 42));
  }

  at(x, y) {
    return [this.side / 2 + x * this.scale, this.side / 2 - y * this.scale];
  }

  /** The place of a point of the canvas in CSS pixels, m. */
  metres(px, py) {
    return [(px - this.side / 2) / this.scale, (this.side / 2 - py) / this.scale];
  }

  /** The robot under a point of the canvas in CSS pixels, or -1. */
  robotAt(x, y, episode, step) {
    let found = -1, least = 14;
    for (const robot of this.worlds.robots) {
      const [px, py] = this.at(...this.run.place(episode, step, robot.index));
      const away = Math.hypot(px - x, py - y) - robot.radius_m * this.scale;
      if (away < least) [found, least] = [robot.index, away];
    }
    return found;
  }

  /** Draws a moment. look: {robot, all, head, trails}; robot -1: nobody is chosen. */
  draw(episode, step, look, paint) {
    const { context, run } = this;
    Object.assign(this, { episode, step, look, paint, taken: [], labels: [] });
    this.spots = this.worlds.robots.map((one) => this.at(...run.place(episode, step, one.index)));
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.side, this.side);
    context.lineJoin = context.lineCap = "round";
    this.drawArena();
    if (look.trails) this.worlds.robots.forEach((robot) => this.drawTrail(robot));
    run.victims[episode].forEach((victim) => this.drawVictim(victim));
    run.rescues[episode].forEach((rescue) => this.drawFlash(rescue));
    if (run.attention && !look.all && look.robot >= 0) this.drawArrows(look.robot, 0.9);
    if (run.attention && look.all) {
      this.worlds.robots.forEach((one) => this.drawArrows(one.index, one.index === look.robot ? 0.95 : 0.5));
    }
    this.worlds.robots.forEach((robot) => this.drawRobot(robot));
    run.victims[episode].forEach((victim) => this.drawNeeds(victim));
    if (this.worlds.robots.length <= FEW_ROBOTS) {
      this.labels.forEach(([text, places]) => {
        const width = this.measure(text, true);
        const isClear = ([x, y]) => this.taken.every(([tx, ty, tw]) => (
          Math.abs(tx - x) > (tw + width) / 2 || Math.abs(ty - y) > this.letters
        ));
        const place = places.find(isClear); // the list beside the arena has every weight
        if (place) this.write(text, ...place, true);
      });
    }
    this.worlds.robots.forEach((robot) => this.drawName(robot));
  }

  drawArena() {
    const { context, paint, scale, worlds } = this, half = worlds.half_width_m;
    const [left, top] = this.at(-half, half), side = 2 * half * scale;
    context.fillStyle = paint.floor;
    context.fillRect(left, top, side, side);
    context.strokeStyle = paint.grid;
    context.lineWidth = 1;
    context.setLineDash([]);
    context.beginPath();
    for (let line = -Math.floor(half * 2) / 2; line < half; line += 0.5) {
      const [x, y] = this.at(line, line);
      context.moveTo(x, top);
      context.lineTo(x, top + side);
      context.moveTo(left, y);
      context.lineTo(left + side, y);
    }
    context.stroke();
    worlds.obstacles.forEach((shape, index) => this.drawObstacle(shape, index));
    context.strokeStyle = paint.wall;
    context.lineWidth = 3;
    context.strokeRect(left - 1.5, top - 1.5, side + 3, side + 3);
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(left + 10, top + side - 10);
    context.lineTo(left + 10 + 0.5 * scale, top + side - 10);
    context.strokeStyle = paint.quiet;
    context.stroke();
    this.font(11);
    context.fillStyle = paint.quiet;
    context.textAlign = "left";
    context.fillText("0.5 m", left + 10, top + side - 18);
  }

  drawObstacle(shape, index) {
    const { context, paint, scale } = this;
    const [x, y] = this.at(...this.worlds.obstacle(this.episode, index));
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

  drawTrail(robot) {
    const { context, run, episode, step } = this;
    context.strokeStyle = this.paint.of(robot.kindIndex);
    context.lineWidth = 2.5;
    context.setLineDash([]);
    let [x, y] = this.spots[robot.index];
    const first = run.firstOf(episode, robot.index);
    for (let past = Math.ceil(step) - 1; past >= first && past > step - TRAIL_STEPS; past--) {
      const [px, py] = this.at(...run.place(episode, past, robot.index));
      context.globalAlpha = 0.45 * (1 - (step - past) / TRAIL_STEPS);
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(px, py);
      context.stroke();
      [x, y] = [px, py];
    }
    context.globalAlpha = 1;
  }

  drawVictim(victim) {
    if (this.step < victim.from || this.step >= victim.to) return;
    const { context, paint, worlds } = this, [x, y] = this.at(victim.x, victim.y);
    const radius = worlds.rescue_radius_m * this.scale;
    context.strokeStyle = paint.victim;
    context.lineWidth = 1.5;
    context.setLineDash([5, 5]);
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.stroke();
    context.setLineDash([]);
    context.fillStyle = paint.victim;
    context.beginPath();
    taskCorners(victim.task, x, y, 7).forEach(([px, py]) => context.lineTo(px, py));
    context.closePath();
    context.fill();
  }

  /** What a victim needs, in small discs on top of its circle; a need that is met is filled. */
  drawNeeds(victim) {
    if (this.step < victim.from || this.step >= victim.to) return;
    const radius = this.worlds.rescue_radius_m * this.scale, size = 8.5, gap = 2 * size + 2;
    const { needs } = this.worlds.tasks[victim.task], half = ((needs.length - 1) / 2) * gap;
    const [x, y] = this.at(victim.x, victim.y), edge = half + size + 3;
    const middle = Math.min(Math.max(x, edge), this.side - edge);
    const top = y - Math.max(radius, 18);
    const height = top > size + 3 ? top : y + Math.max(radius, 18);
    needs.forEach((need, index) => {
      this.drawNeed(need, middle - half + index * gap, height, size, this.isMet(victim, need, radius));
    });
    this.taken.push([middle, height + 4, 2 * edge]);
  }

  /** Whether a robot that offers what is needed is near enough. */
  isMet(victim, need, radius) {
    const [x, y] = this.at(victim.x, victim.y);
    return this.worlds.robots.some((robot) => {
      const [px, py] = this.spots[robot.index];
      return robot.abilities.includes(need) && Math.hypot(px - x, py - y) <= radius &&
        !this.run.isAway(this.episode, this.step, robot.index);
    });
  }

  drawNeed(need, x, y, size, met) {
    const { context, paint, worlds } = this, kind = worlds.kindOf(need);
    context.beginPath();
    context.arc(x, y, size, 0, 7);
    context.fillStyle = met ? paint.of(kind) : paint.floor;
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = paint.of(kind);
    context.stroke();
    this.font(size * 1.35, true);
    context.textAlign = "center";
    context.fillStyle = met ? letterColour(kind) : paint.ink;
    context.fillText(worlds.letters[need], x, y + size * 0.48);
  }

  drawFlash(rescue) {
    const since = this.step - rescue.step;
    if (since < 0 || since >= FLASH_STEPS) return;
    const { context, paint, run } = this;
    const victim = run.victims[this.episode].find((one) => one.id === rescue.victim);
    if (!victim) return;
    const [x, y] = this.at(victim.x, victim.y), fade = 1 - since / FLASH_STEPS;
    const radius = this.worlds.rescue_radius_m * this.scale;
    context.globalAlpha = fade;
    context.strokeStyle = paint.victim;
    context.lineWidth = 4;
    for (const helper of rescue.helpers) {
      context.beginPath();
      context.moveTo(...this.spots[helper]);
      context.lineTo(x, y);
      context.stroke();
    }
    context.fillStyle = paint.victim;
    context.globalAlpha = 0.25 * fade;
    context.beginPath();
    context.arc(x, y, radius * (1 + 0.35 * since), 0, 7);
    context.fill();
    context.globalAlpha = fade;
    context.stroke();
    context.globalAlpha = 1;
    this.write("rescued", x, y + radius + 14, true);
  }

  /** The arrows from one robot to its teammates; the width of each is its weight. */
  drawArrows(robot, alpha) {
    const { run, worlds, episode, step, look } = this;
    for (const other of worlds.robots) {
      if (other.index === robot) continue;
      const weight = run.weight(episode, step, look.head, robot, other.index);
      const width = weight * WIDEST_ARROW * this.side / 2;
      if (width < 0.4) continue;
      const places = this.arrow(worlds.robots[robot], other, width, alpha);
      if (robot === look.robot) this.labels.push([percent(weight), places]);
    }
  }

  /** A bent arrow between two robots; gives places for its label, the best first. */
  arrow(from, to, width, alpha) {
    const { context, paint, scale } = this;
    const [ax, ay] = this.spots[from.index], [bx, by] = this.spots[to.index];
    const length = Math.hypot(bx - ax, by - ay) || 1;
    const nx = -(by - ay) / length, ny = (bx - ax) / length, bend = 0.16 * length + 4;
    const mx = (ax + bx) / 2 + nx * bend, my = (ay + by) / 2 + ny * bend;
    const angle = Math.atan2(by - my, bx - mx), head = 6 + 1.1 * width;
    const gap = to.radius_m * scale + 3;
    const tx = bx - gap * Math.cos(angle), ty = by - gap * Math.sin(angle);
    const hx = tx - head * Math.cos(angle), hy = ty - head * Math.sin(angle);
    const start = Math.atan2(my - ay, mx - ax), r = from.radius_m * scale;
    context.globalAlpha = alpha;
    context.strokeStyle = context.fillStyle = paint.of(from.kindIndex);
    context.lineWidth = width;
    context.lineCap = "butt";
    context.beginPath();
    context.moveTo(ax + r * Math.cos(start), ay + r * Math.sin(start));
    context.quadraticCurveTo(mx, my, hx, hy);
    context.stroke();
    const spread = 3 + 0.75 * width;
    context.beginPath();
    context.moveTo(tx, ty);
    context.lineTo(hx - spread * Math.sin(angle), hy + spread * Math.cos(angle));
    context.lineTo(hx + spread * Math.sin(angle), hy - spread * Math.cos(angle));
    context.fill();
    context.globalAlpha = 1;
    context.lineCap = "round";
    return [0.5, 0.65, 0.35, 0.75].map((part) => {
      const out = 2 * part * (1 - part) * bend;
      return [ax + (bx - ax) * part + nx * out, ay + (by - ay) * part + ny * out + this.letters / 3];
    });
  }

  drawRobot(robot) {
    const { context, paint, run, episode, step } = this, [x, y] = this.spots[robot.index];
    const radius = robot.radius_m * this.scale, colour = paint.of(robot.kindIndex);
    const away = run.isAway(episode, step, robot.index);
    if (robot.index === this.look.robot) {
      context.beginPath();
      context.arc(x, y, radius + 4.5, 0, 7);
      context.strokeStyle = paint.ink;
      context.lineWidth = 2.5;
      context.stroke();
    }
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.fillStyle = away ? paint.floor : colour;
    context.fill();
    context.lineWidth = away ? 3 : 1.5;
    context.strokeStyle = away ? colour : paint.ink;
    context.stroke();
    this.drawHeading(robot, x, y, radius);
    const letters = robot.abilities.map((ability) => this.worlds.letters[ability]).join("");
    const size = Math.min(15, (1.5 * radius) / Math.max(1, 0.8 * letters.length));
    this.font(size, true);
    context.textAlign = "center";
    context.fillStyle = away ? paint.ink : letterColour(robot.kindIndex);
    context.fillText(letters, x, y + 0.36 * size);
    if (run.isBlocked(episode, step, robot.index)) this.drawBlocked(x, y, radius);
    if (run.faultsAt(episode, step, robot.index).length) this.drawFault(x, y, radius, away);
  }

  drawHeading(robot, x, y, radius) {
    const [vx, vy] = this.run.velocity(this.episode, this.step, robot.index);
    const speed = Math.hypot(vx, vy);
    if (speed < 0.02) return;
    const { context } = this, reach = radius + 3 + 0.06 * speed * this.scale;
    context.strokeStyle = this.paint.ink;
    context.lineWidth = 2.5;
    context.beginPath();
    context.moveTo(x + (radius * vx) / speed, y - (radius * vy) / speed);
    context.lineTo(x + (reach * vx) / speed, y - (reach * vy) / speed);
    context.stroke();
  }

  /** Brackets on both sides: something holds the robot. */
  drawBlocked(x, y, radius) {
    const { context } = this;
    context.strokeStyle = this.paint.blocked;
    context.lineWidth = 3;
    for (const turn of [0, Math.PI]) {
      context.beginPath();
      context.arc(x, y, radius + 9, turn - 0.7, turn + 0.7);
      context.stroke();
    }
  }

  /** A triangle at the robot's upper right; a cross over a robot that is away. */
  drawFault(x, y, radius, away) {
    const { context, paint } = this, fx = x + radius + 3, fy = y - radius - 2;
    context.fillStyle = paint.blocked;
    context.strokeStyle = paint.card;
    context.lineWidth = 1.5;
    context.beginPath();
    taskCorners(2, fx, fy, 6.5).forEach(([px, py]) => context.lineTo(px, py));
    context.closePath();
    context.stroke();
    context.fill();
    if (!away) return;
    context.strokeStyle = paint.blocked;
    context.lineWidth = 3;
    context.beginPath();
    const arm = 0.8 * radius;
    context.moveTo(x - arm, y - arm);
    context.lineTo(x + arm, y + arm);
    context.moveTo(x + arm, y - arm);
    context.lineTo(x - arm, y + arm);
    context.stroke();
  }

  drawName(robot) {
    if (this.worlds.robots.length > FEW_ROBOTS && robot.index !== this.look.robot) return;
    const [x, y] = this.spots[robot.index], away = robot.radius_m * this.scale + 9;
    const lower = away + 0.7 * this.letters;
    const width = this.measure(robot.name, false), edge = width / 2 + 4, beside = away + width / 2;
    const places = [
      [0, -away], [0, lower], [beside, 4], [-beside, 4], [0, -away - 14], [0, lower + 14],
      [0, -away - 28], [0, lower + 28],
    ].map(([dx, dy]) => [Math.min(Math.max(x + dx, edge), this.side - edge), y + dy]);
    const inside = places.filter(([, py]) => py > this.letters + 4 && py < this.side - 6);
    const place = inside.find(([px, py]) => this.isFree(px, py, width)) || inside[0];
    this.write(robot.name, ...place, robot.index === this.look.robot);
  }

  isFree(x, y, width) {
    return this.taken.every(([tx, ty, tw]) => (
      Math.abs(tx - x) > (tw + width) / 2 + 4 || Math.abs(ty - y) > this.letters + 1
    )) && this.spots.every(([sx, sy]) => (
      Math.abs(sx - x) > width / 2 + 4 || Math.abs(sy - y + this.letters / 3) > 16
    ));
  }

  font(size, bold = false) {
    this.context.font = `${bold ? 700 : 500} ${size.toFixed(1)}px system-ui, sans-serif`;
  }

  measure(text, bold) {
    this.font(this.letters, bold);
    return this.context.measureText(text).width;
  }

  /** Text with an edge of the floor's colour. */
  write(text, x, y, bold) {
    const { context, paint } = this;
    this.font(this.letters, bold);
    context.textAlign = "center";
    context.lineWidth = 4;
    context.strokeStyle = paint.floor;
    context.strokeText(text, x, y);
    context.fillStyle = paint.ink;
    context.fillText(text, x, y);
    this.taken.push([x, y, context.measureText(text).width]);
  }
}
