// The chart of a schedule: a row for each robot, a bar for each span, a cursor at the time.

const BAR = 18, ROW = 22, AXIS = 24;

class Gantt {
  constructor(box, course, pick) {
    Object.assign(this, { box, course });
    this.canvas = element("canvas", { role: "img", "aria-label": `What ${counted(course.robots.length, "robot")} do until ${course.text(course.makespan)}` });
    this.cursor = element("div", { class: "cursor" });
    box.append(this.canvas, this.cursor);
    const choose = (event) => {
      pick(this.timeAt(event.offsetX));
      this.tell(event);
    };
    this.canvas.addEventListener("pointerdown", choose);
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) choose(event);
      else this.tell(event);
    });
    this.canvas.addEventListener("pointerleave", () => ($("span").textContent = ""));
  }

  /** Says what the bar under the pointer is. */
  tell(event) {
    const robot = this.course.robots[Math.floor(event.offsetY / ROW)];
    const span = robot && this.course.spanAt(robot, this.timeAt(event.offsetX));
    $("span").textContent = span ? this.course.spanText(span) : "";
  }

  x(time) {
    return this.left + (time / (this.course.makespan || 1)) * (this.width - this.left - 10);
  }

  timeAt(x) {
    const share = (x - this.left) / (this.width - this.left - 10);
    return Math.min(Math.max(share, 0), 1) * this.course.makespan;
  }

  /** Takes the size on the screen and draws all but the cursor. */
  draw(paint) {
    const { canvas, course } = this, context = canvas.getContext("2d");
    const ratio = window.devicePixelRatio || 1, height = course.robots.length * ROW + AXIS;
    this.width = Math.max(this.box.clientWidth, 120);
    const wide = this.width > 500;
    this.left = wide ? 62 : 24;
    Object.assign(this, { context, paint });
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(this.width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawAxis(height);
    context.textBaseline = "middle";
    course.robots.forEach((robot) => {
      const y = robot.index * ROW + (ROW - BAR) / 2;
      context.font = "12px system-ui, sans-serif";
      context.fillStyle = paint.ink;
      context.textAlign = "right";
      context.fillText(wide ? `robot ${robot.index}` : String(robot.index), this.left - 6, y + BAR / 2);
      robot.spans.forEach((span) => this.drawSpan(span, robot.kind, y));
    });
  }

  drawAxis(height) {
    const { context, course, paint } = this;
    context.font = "11.5px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (const tick of ticks(0, course.makespan || 1, this.width > 500 ? 10 : 5)) {
      const x = this.x(tick);
      context.fillStyle = paint.grid;
      context.fillRect(x - 0.5, 0, 1, height - AXIS);
      context.fillStyle = paint.quiet;
      context.fillText(short(tick), x, height - 8);
    }
  }

  /** Pale: driving; hatched: waiting; full: working; dashed: driving home. */
  drawSpan({ what, begin, end, task }, kind, y) {
    const { context, paint } = this, colour = paint.of(kind), x = this.x(begin), width = this.x(end) - x;
    if (width <= 0) return;
    context.save();
    context.beginPath();
    context.rect(x, y, width, BAR);
    context.clip();
    context.fillStyle = context.strokeStyle = colour;
    context.globalAlpha = { drive: 0.28, wait: 0.6, work: 1, home: 0.7 }[what];
    context.lineWidth = 1.5;
    if (what === "drive" || what === "work") context.fillRect(x, y, width, BAR);
    else if (what === "wait") hatch(context, x, y, width, BAR);
    else {
      context.setLineDash([3, 3]);
      context.strokeRect(x + 1, y + 1, width - 2, BAR - 2);
    }
    context.globalAlpha = 1;
    context.restore();
    const texts = { drive: [`to ${task}`, "→"], wait: ["wait"], work: [`task ${task}`, String(task)], home: ["home"] }[what];
    context.font = `${what === "work" ? 700 : 400} 11px system-ui, sans-serif`;
    const text = texts.find((one) => context.measureText(one).width <= width - 4);
    if (!text) return;
    context.textAlign = "center";
    if (what === "wait") {
      context.strokeStyle = paint.card;
      context.lineWidth = 4;
      context.lineJoin = "round";
      context.strokeText(text, x + width / 2, y + BAR / 2);
    }
    context.fillStyle = what === "work" ? letterColour(kind) : paint.ink;
    context.fillText(text, x + width / 2, y + BAR / 2);
  }

  moveTo(time) {
    this.cursor.style.transform = `translateX(${this.x(time)}px)`;
  }
}

function hatch(context, x, y, width, height) {
  context.beginPath();
  for (let at = x - height; at < x + width; at += 6) {
    context.moveTo(at, y + height);
    context.lineTo(at + height, y);
  }
  context.stroke();
  context.strokeRect(x, y, width, height);
}
