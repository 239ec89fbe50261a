// What a pointer does in the arena: it drags robots and victims, pushes robots, or adds victims.

const CLICK_PX = 4; // less is a click
const PUSH_PER_S = 4; // a push of so many metres a second for each metre that is dragged

class Hands {
  /** `act` has choose(robot), move(robot, x, y), push(robot, vx, vy), moveVictim, addVictim, redraw. */
  constructor(scene, act) {
    Object.assign(this, { scene, act, tool: "move", task: 0, grip: null, step: 0 });
    const { canvas } = scene;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", () => this.drop());
    // A finger on a robot or victim drags it; elsewhere it scrolls the page.
    canvas.addEventListener("touchstart", (event) => {
      const box = canvas.getBoundingClientRect(), touch = event.touches[0];
      if (this.under(touch.clientX - box.left, touch.clientY - box.top)) event.preventDefault();
    }, { passive: false });
  }

  /** What lies under a point of the canvas [px]. */
  under(px, py) {
    const { scene, step } = this, robot = scene.robotAt(px, py, 0, step);
    if (robot >= 0) return { robot };
    const victim = scene.run.victims[0].find((one) => {
      const [x, y] = scene.at(one.x, one.y);
      return one.to > scene.run.last && Math.hypot(x - px, y - py) < 16;
    });
    return victim ? { victim } : null;
  }

  down(event) {
    if (!event.isPrimary || event.button !== 0) return;
    const found = this.under(event.offsetX, event.offsetY);
    if (!found && this.tool === "add") {
      this.act.addVictim(this.task, ...this.inside(event, this.scene.worlds.victim_reach_m));
      return;
    }
    if (!found) return;
    if (found.robot !== undefined) this.act.choose(found.robot);
    this.scene.canvas.setPointerCapture(event.pointerId);
    this.grip = { ...found, from: [event.offsetX, event.offsetY], moved: false, to: null };
  }

  drag(event) {
    const { grip, scene } = this;
    if (!grip) return;
    const [fx, fy] = grip.from;
    if (Math.hypot(event.offsetX - fx, event.offsetY - fy) >= CLICK_PX) grip.moved = true;
    if (!grip.moved) return;
    if (grip.victim) {
      grip.to = this.inside(event, scene.worlds.victim_reach_m);
      [grip.victim.x, grip.victim.y] = grip.to;
      grip.victim.held = true;
    } else if (this.tool === "push") grip.to = scene.metres(event.offsetX, event.offsetY);
    else {
      grip.to = this.inside(event, scene.worlds.half_width_m - scene.worlds.robots[grip.robot].radius_m);
      scene.run.held = { robot: grip.robot, x: grip.to[0], y: grip.to[1] };
      this.act.move(grip.robot, ...grip.to, false);
    }
    this.act.redraw();
  }

  up() {
    const { grip, scene } = this;
    this.grip = null;
    if (!grip?.to) return;
    if (grip.victim) this.act.moveVictim(grip.victim, ...grip.to);
    else if (this.tool === "push") {
      const [x, y] = scene.run.place(0, this.step, grip.robot), most = scene.worlds.most_push_mps;
      const speed = (metres) => Math.min(Math.max(PUSH_PER_S * metres, -most), most);
      this.act.push(grip.robot, speed(grip.to[0] - x), speed(grip.to[1] - y));
    } else this.act.move(grip.robot, ...grip.to, true);
    this.act.redraw();
  }

  /** Lets go without doing anything. */
  drop() {
    if (this.grip?.victim) this.grip.victim.held = false;
    this.scene.run.held = null;
    this.grip = null;
    this.act.redraw();
  }

  /** Metres of an event, at most `reach` from the centre on both axes. */
  inside(event, reach) {
    const most = Math.floor(1e4 * reach) / 1e4;
    return this.scene.metres(event.offsetX, event.offsetY).map(
      (metres) => Math.round(1e4 * Math.min(Math.max(metres, -most), most)) / 1e4,
    );
  }

  /** The push that would happen now, as an arrow from the robot. */
  draw() {
    const { grip, scene } = this;
    if (this.tool !== "push" || !grip?.to || grip.robot === undefined) return;
    const { context, paint } = scene, [x, y] = scene.spots[grip.robot], [tx, ty] = scene.at(...grip.to);
    const angle = Math.atan2(ty - y, tx - x);
    context.strokeStyle = context.fillStyle = paint.ink;
    context.lineWidth = 3;
    context.setLineDash([7, 5]);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(tx, ty);
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    for (const [ahead, side] of [[12, 0], [-2, 7], [-2, -7]]) {
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      context.lineTo(tx + ahead * c - side * s, ty + ahead * s + side * c);
    }
    context.fill();
  }
}
