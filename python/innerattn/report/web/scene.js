// Draws one policy's arena at a moment on a canvas.

const TRAIL_STEPS = 15;
const FLASH_STEPS = 2.5;
const WIDEST_ARROW = 0.055; // of the arena's half width, for a weight of 1
const FEW_ROBOTS = 8;
const FAINT = 0.3; // what the chosen robot does not see
const BADGE = 8.5; // radius of what a victim needs, px

/** The weight from which on arrows of all robots are drawn at first: of large teams the strongest. */
function strongWeight(size) {
  return size > 4 ? Math.ceil(200 / (size - 1)) / 100 : 0;
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

  /** Where a robot is on the canvas; no numbers, which draw nothing, while it has left the arena. */
  spot(episode, step, index) {
    const left = this.worlds.robots_leave && this.run.isAway(episode, step, index);
    return left ? [NaN, NaN] : this.at(...this.run.place(episode, step, index));
  }

  /** The robot under a point of the canvas in CSS pixels, or -1. */
  robotAt(x, y, episode, step) {
    let found = -1, least = 14;
    for (const robot of this.worlds.robots) {
      const [px, py] = this.spot(episode, step, robot.index);
      const away = Math.hypot(px - x, py - y) - robot.radius_m * this.scale;
      if (away < least) [found, least] = [robot.index, away];
    }
    return found;
  }

  /**
   * Draws a moment. look: {robot, received, all, least, head, trails, hearing, rays, sight}; robot -1:
   * nobody is chosen.
   * Where no free place is left for a badge it lies below robots, and a text is left out.
   */
  draw(episode, step, look, paint) {
    const { context, run, worlds } = this, victims = run.victims[episode];
    Object.assign(this, { episode, step, look, paint, labels: [] });
    this.spots = worlds.robots.map((one) => this.spot(episode, step, one.index));
    const shown = worlds.robots.filter(({ index, is_spare: isSpare }) => !isSpare || !Number.isNaN(this.spots[index][0]));
    this.isSmall = shown.length <= FEW_ROBOTS;
    this.room = new Room(this.side, worlds.robots.map(({ index, radius_m: radius }) => (
      [...this.spots[index], radius * this.scale + (index === look.robot ? 6 : 2)]
    )));
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.side, this.side);
    context.lineJoin = context.lineCap = "round";
    drawGround(this);
    drawSenses(this);
    if (look.trails) worlds.robots.forEach((robot) => this.drawTrail(robot));
    this.unseen = outOfSight(this);
    const { robots: away, victims: hidden } = this.unseen;
    victims.forEach((victim) => this.faintly(hidden.includes(victim.id), () => this.drawVictim(victim)));
    run.rescues[episode].forEach((rescue) => this.drawFlash(rescue));
    drawHearing(this);
    if (run.attention) this.drawAttention();
    worlds.robots.forEach((robot) => this.drawFault(robot));
    victims.forEach((victim) => this.faintly(hidden.includes(victim.id), () => this.drawNeeds(victim)));
    worlds.robots.forEach((robot) => this.faintly(away.includes(robot.index), () => this.drawRobot(robot)));
    // The list beside the arena has every weight.
    if (this.isSmall) this.labels.forEach(([text, places]) => this.writeAt(text, places, true));
    worlds.robots.forEach((robot) => this.drawName(robot));
  }

  /** What draws in full strength, or faintly. */
  faintly(isFaint, draw) {
    this.context.globalAlpha = isFaint ? FAINT : 1;
    draw();
    this.context.globalAlpha = 1;
  }

  drawTrail(robot) {
    const { context, run, episode, step } = this;
    context.strokeStyle = this.paint.of(robot.kindIndex);
    context.lineWidth = 2.5;
    context.setLineDash([]);
    let [x, y] = this.spots[robot.index];
    const first = run.firstOf(episode, robot.index);
    for (let past = Math.ceil(step) - 1; past >= first && past > step - TRAIL_STEPS; past--) {
      const [px, py] = this.spot(episode, past, robot.index);
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
    if (this.run.waits(this.episode, this.step, victim)) {
      context.setLineDash([2, 2]);
      context.stroke();
      context.setLineDash([]);
    } else {
      context.fill();
    }
    this.room.take(x, y, 8, 8);
    this.drawTimes(victim, x, y);
  }

  /** How far the service of a victim is, and how long it still waits. */
  drawTimes(victim, x, y) {
    const { context, paint, run, worlds } = this, served = run.served(this.episode, this.step, victim);
    if (served > 0) {
      context.strokeStyle = paint.victim;
      context.lineWidth = 4;
      context.beginPath();
      context.arc(x, y, 14, -Math.PI / 2, (2 * served - 0.5) * Math.PI);
      context.stroke();
    }
    if (victim.deadline >= 0) {
      const left = Math.max(victim.deadline - this.step, 0) * worlds.dt_s;
      this.writeAt(`${left.toFixed(1)} s`, [[x, y + 28], [x, y - 20], [x + 34, y + 4], [x - 34, y + 4]], false);
    }
  }

  /** What a victim needs, in small discs on its circle; a need that is met is filled. */
  drawNeeds(victim) {
    if (this.step < victim.from || this.step >= victim.to) return;
    const radius = this.worlds.rescue_radius_m * this.scale, gap = 2 * BADGE + 2;
    const { needs } = this.worlds.tasks[victim.task], half = ((needs.length - 1) / 2) * gap;
    const [x, y] = this.at(victim.x, victim.y), reach = Math.max(radius, 18);
    const places = [reach, reach + gap].flatMap((far) => [0, 45, -45, 90, -90, 135, -135, 180].map((turn) => {
      const angle = (turn * Math.PI) / 180;
      return [x + far * Math.sin(angle), y - far * Math.cos(angle)];
    }));
    const [middle, height] = this.room.find(places, half + BADGE + 1, BADGE + 1) ?? places[0];
    needs.forEach((need, index) => {
      this.drawNeed(need, middle - half + index * gap, height, BADGE, this.isMet(victim, need, radius));
    });
  }

  /** Whether robots that offer what is needed are near enough. */
  isMet(victim, need, radius) {
    const [x, y] = this.at(victim.x, victim.y);
    return this.worlds.isReached(victim.task, need, this.worlds.robots.filter((robot) => {
      const [px, py] = this.spots[robot.index];
      return Math.hypot(px - x, py - y) <= radius && !this.run.isAway(this.episode, this.step, robot.index);
    }));
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
    this.writeAt("rescued", [[x, y + radius + 14], [x, y - radius - 8]], true);
  }

  /** Arrows of the chosen robot, or from it and to it and of all others that are strong enough. */
  drawAttention() {
    const { worlds, look } = this;
    for (const { index: from } of worlds.robots) {
      for (const { index: to } of worlds.robots) {
        const isOwn = (look.received ? to : from) === look.robot;
        if (from !== to && (look.all || isOwn)) this.drawArrow(from, to, isOwn);
      }
    }
  }

  /** The arrow from one robot to another; its width is the weight. */
  drawArrow(from, to, isOwn) {
    const { run, worlds, episode, step, look } = this;
    const weight = run.weight(episode, step, look.head, from, to);
    const width = weight * WIDEST_ARROW * this.side / 2;
    if (width < 0.4 || (look.all && weight < look.least)) return;
    const places = this.arrow(worlds.robots[from], worlds.robots[to], width, isOwn ? 0.9 : 0.5);
    if (isOwn) this.labels.push([percent(weight), places]);
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
    return [0.5, 0.65, 0.35, 0.75, 0.25, 0.58, 0.42, 0.82, 0.18].map((part) => {
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
    context.lineWidth = away || robot.layerIndex > 0 ? 3 : 1.5;
    context.strokeStyle = away ? colour : paint.ink;
    context.setLineDash(edgeOf(robot));
    context.stroke();
    context.setLineDash([]);
    this.drawVelocity(robot, x, y, radius);
    this.drawNose(robot, x, y, radius);
    const letters = robot.abilities.map((ability) => this.worlds.letters[ability]).join("");
    const size = Math.min(15, (1.5 * radius) / Math.max(1, 0.8 * letters.length));
    this.font(size, true);
    context.textAlign = "center";
    context.fillStyle = away ? paint.ink : letterColour(robot.kindIndex);
    context.fillText(letters, x, y + 0.36 * size);
    if (run.isBlocked(episode, step, robot.index)) this.drawBlocked(x, y, radius);
    if (away) this.drawCross(x, y, 0.8 * radius);
  }

  /** The nose of a robot on wheels, where it points. */
  drawNose(robot, x, y, radius) {
    const heading = this.run.heading(this.episode, this.step, robot.index);
    if (heading === null) return;
    const { context } = this, reach = Math.max(1.5 * radius, radius + 5);
    context.fillStyle = this.paint.ink;
    context.beginPath();
    for (const [turn, far] of [[0, reach], [0.55, radius], [-0.55, radius]]) {
      context.lineTo(x + far * Math.cos(heading + turn), y - far * Math.sin(heading + turn));
    }
    context.closePath();
    context.fill();
  }

  drawVelocity(robot, x, y, radius) {
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

  /** A triangle at a corner of the robot. */
  drawFault(robot) {
    const { context, paint, run, room } = this, [x, y] = this.spots[robot.index];
    if (!run.faultsAt(this.episode, this.step, robot.index).length) return;
    const away = robot.radius_m * this.scale + 3;
    const corners = [[1, -1], [-1, -1], [1, 1], [-1, 1]].map(([right, down]) => [x + right * away, y + down * away]);
    const [fx, fy] = room.find(corners, 7, 7, robot.index) ?? corners[0];
    context.fillStyle = paint.blocked;
    context.strokeStyle = paint.card;
    context.lineWidth = 1.5;
    context.beginPath();
    taskCorners(2, fx, fy, 6.5).forEach(([px, py]) => context.lineTo(px, py));
    context.closePath();
    context.stroke();
    context.fill();
  }

  /** Over a robot that is out. */
  drawCross(x, y, arm) {
    const { context } = this;
    context.strokeStyle = this.paint.blocked;
    context.lineWidth = 3;
    context.beginPath();
    context.moveTo(x - arm, y - arm);
    context.lineTo(x + arm, y + arm);
    context.moveTo(x + arm, y - arm);
    context.lineTo(x - arm, y + arm);
    context.stroke();
  }

  drawName(robot) {
    const chosen = robot.index === this.look.robot;
    if (!this.isSmall && !chosen) return;
    const [x, y] = this.spots[robot.index], away = robot.radius_m * this.scale + 9;
    const width = this.measure(robot.name, chosen), edge = width / 2 + 4;
    const lower = away + 0.7 * this.letters, beside = away + width / 2;
    const places = [
      [0, -away], [0, lower], [beside, 4], [-beside, 4], [0, -away - 14], [0, lower + 14],
      [beside, -away], [-beside, -away], [beside, lower], [-beside, lower], [0, -away - 28], [0, lower + 28],
    ].map(([dx, dy]) => [Math.min(Math.max(x + dx, edge), this.side - edge), y + dy]);
    this.writeAt(robot.name, places, chosen);
  }

  font(size, bold = false) {
    this.context.font = `${bold ? 700 : 500} ${size.toFixed(1)}px system-ui, sans-serif`;
  }

  measure(text, bold) {
    this.font(this.letters, bold);
    return this.context.measureText(text).width;
  }

  /** Writes a text at the first place, the middle of its base line, where it covers nothing. */
  writeAt(text, places, bold) {
    const width = this.measure(text, bold) / 2 + 2, rise = 0.35 * this.letters;
    const found = this.room.find(places.map(([x, y]) => [x, y - rise]), width, 0.55 * this.letters);
    if (found) this.write(text, found[0], found[1] + rise, bold);
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
  }
}
