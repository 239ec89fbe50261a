// Draws depots, tasks and robots at a time on a canvas. Robots at rest stand around their place.

class TaskMap {
  constructor(canvas, course) {
    Object.assign(this, { canvas, course, context: canvas.getContext("2d") });
  }

  /** Takes the canvas' size on the screen; finds where everything stands. */
  fit() {
    const { canvas, course } = this, [left, bottom, extent] = course.extent;
    this.side = Math.max(canvas.clientWidth, 120);
    this.ratio = window.devicePixelRatio || 1;
    canvas.width = canvas.height = Math.round(this.side * this.ratio);
    const most = Math.sqrt(course.robots.length + course.tasks.length);
    this.radius = Math.min(9, Math.max(4, this.side / (7 * most)));
    const margin = 3.5 * this.radius, scale = (this.side - 2 * margin) / extent;
    this.at = ([x, y]) => [margin + (x - left) * scale, this.side - margin - (y - bottom) * scale];
    this.places = course.tasks.map(({ position, robots }) => (
      this.standing(this.at(position), robots, Math.max(2.1 * this.radius, 0.36 * this.radius * robots.length))
    ));
    const depots = new Map();
    course.robots.forEach(({ depot, index }) => {
      const key = depot.join();
      depots.set(key, { depot, robots: [...(depots.get(key)?.robots ?? []), index] });
    });
    this.depots = [...depots.values()].map(({ depot, robots }) => (
      this.standing(this.at(depot), robots, Math.max(1.7 * this.radius, 0.36 * this.radius * robots.length))
    ));
  }

  /** A place, and where around it each of some robots stands. */
  standing(centre, robots, away) {
    const spots = new Map(robots.map((robot, index) => {
      const angle = (2 * Math.PI * index) / robots.length - Math.PI / 2;
      return [robot, [centre[0] + away * Math.cos(angle), centre[1] + away * Math.sin(angle)]];
    }));
    return { centre, spots, away };
  }

  /** Where a robot is, in CSS pixels. */
  spot({ index, spans }, time) {
    const robot = this.course.robots[index], span = this.course.spanAt(robot, time);
    const stop = (task) => (task === null ? this.depots.find(({ spots }) => spots.has(index)) : this.places[task]).spots.get(index);
    if (!span) return stop(null);
    const [x, y] = stop(span.origin), [toX, toY] = stop(span.task);
    const share = span.end > span.begin ? Math.min((time - span.begin) / (span.end - span.begin), 1) : 1;
    return [x + share * (toX - x), y + share * (toY - y)];
  }

  draw(time, paint) {
    Object.assign(this, { time, paint });
    this.context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.context.textAlign = "center";
    this.context.textBaseline = "middle";
    this.drawFloor();
    for (const { centre } of this.depots) {
      this.shape(taskCorners(1, ...centre, 0.6 * this.radius), paint.floor, paint.quiet);
    }
    this.drawWays();
    this.course.tasks.forEach((_, task) => this.drawTask(task));
    this.course.robots.forEach((robot) => this.drawRobot(robot));
  }

  drawFloor() {
    const { context, side, paint, course } = this, [left, bottom, extent] = course.extent;
    context.fillStyle = paint.floor;
    context.fillRect(0, 0, side, side);
    context.strokeStyle = paint.grid;
    context.lineWidth = 1;
    context.beginPath();
    for (let line = 0; line <= 10; line++) {
      const [x, y] = this.at([left + (line * extent) / 10, bottom + (line * extent) / 10]);
      context.moveTo(x, 0);
      context.lineTo(x, side);
      context.moveTo(0, y);
      context.lineTo(side, y);
    }
    context.stroke();
    context.strokeStyle = paint.wall;
    context.lineWidth = 3;
    context.strokeRect(0, 0, side, side);
  }

  /** The way that each driving robot still has. */
  drawWays() {
    const { context, course, time } = this;
    context.lineWidth = 1.5;
    for (const robot of course.robots) {
      const span = course.spanAt(robot, time);
      if (span?.what !== "drive" && span?.what !== "home") continue;
      context.strokeStyle = this.paint.of(robot.kind);
      context.setLineDash(span.what === "home" ? [2, 4] : []);
      context.globalAlpha = 0.45;
      context.beginPath();
      context.moveTo(...this.spot(robot, time));
      context.lineTo(...this.spot(robot, span.end - 1e-9 * (span.end - span.begin)));
      context.stroke();
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  drawTask(index) {
    const { context, paint, radius, course, time } = this;
    const task = course.tasks[index], { centre, spots, away } = this.places[index];
    const state = course.stateOf(task, time), done = state === "done";
    const fill = { waiting: paint.card, "being worked on": paint.victim, done: paint.grid }[state];
    this.shape(taskCorners(0, ...centre, 1.05 * radius), fill, done ? paint.quiet : paint.victim);
    if (state === "being worked on") {
      const share = (time - task.start) / (task.end - task.start);
      context.strokeStyle = paint.victim;
      context.lineWidth = 2.5;
      context.beginPath();
      context.arc(...centre, away + radius + 3, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * share);
      context.stroke();
    }
    if (!done) {
      for (const [robot, [x, y]] of spots) this.disc(x, y, 0.4 * radius, paint.floor, paint.of(course.robots[robot].kind));
    }
    this.write(done ? "✓" : String(index), ...centre, { waiting: paint.ink, "being worked on": paint.card, done: paint.quiet }[state]);
  }

  drawRobot(robot) {
    const [x, y] = this.spot(robot, this.time);
    this.disc(x, y, this.radius, this.paint.of(robot.kind), this.paint.ink);
    this.write(String(robot.index), x, y, letterColour(robot.kind));
  }

  disc(x, y, radius, fill, stroke) {
    this.outlined(() => this.context.arc(x, y, radius, 0, 7), fill, stroke);
  }

  shape(corners, fill, stroke) {
    this.outlined(() => corners.forEach((corner) => this.context.lineTo(...corner)), fill, stroke);
  }

  outlined(path, fill, stroke) {
    const { context } = this;
    context.beginPath();
    path();
    context.closePath();
    context.fillStyle = fill;
    context.strokeStyle = stroke;
    context.lineWidth = 1.5;
    context.fill();
    context.stroke();
  }

  /** A number inside a disc or square; none where it would be too small to read. */
  write(text, x, y, colour) {
    if (this.radius < 7) return;
    this.context.font = `700 ${text.length > 2 ? 9 : 11}px system-ui, sans-serif`;
    this.context.fillStyle = colour;
    this.context.fillText(text, x, y + 0.5);
  }
}
