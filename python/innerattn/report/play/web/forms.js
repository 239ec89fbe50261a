// What is beside the arena for the chosen robot and the victims: buttons and forms.

const BREAKS = [
  { text: "Break motor", kind: "motor_gain", value: 0.2, key: "m" },
  { text: "Blind", kind: "blackout", value: 1, key: "b" },
  { text: "Take out", kind: "unavailable", value: 1, key: "o" },
];
const MOST_EVENTS = 60;

/** Writes a number into a field that nobody is writing in. */
function showNumber(field, value) {
  if (document.activeElement !== field) field.value = String(Math.round(1000 * value) / 1000);
}

class RobotPanel {
  /** `change` takes values of faults by kind; `put` takes x and y. */
  constructor(worlds, change, put) {
    Object.assign(this, { worlds, change });
    this.buttons = BREAKS.map((one) => {
      const button = element("button", { type: "button" }, one.text);
      button.addEventListener("click", () => this.toggle(one));
      $("breaks").append(button);
      return button;
    });
    this.fields = worlds.fault_kinds.map((kind) => {
      const field = element("input", { type: "number", min: kind.least, max: kind.most, step: "any" });
      field.addEventListener("change", () => {
        if (field.value !== "" && field.reportValidity()) this.change({ [kind.name]: Number(field.value) });
      });
      const unit = kind.unit ? ` [${kind.unit}]` : "";
      $("faults").append(element("label", {}, `${kind.name.replaceAll("_", " ")}${unit}`, field));
      return field;
    });
    $("repair").addEventListener("click", () => {
      this.change(Object.fromEntries(worlds.fault_kinds.map(({ name, healthy }) => [name, healthy])));
    });
    $("robot-place").addEventListener("submit", (event) => {
      event.preventDefault();
      const { x, y } = event.target.elements;
      document.activeElement.blur();
      put(Number(x.value), Number(y.value));
    });
  }

  toggle({ kind, value }) {
    const { healthy } = this.worlds.fault_kinds.find(({ name }) => name === kind);
    this.change({ [kind]: kind in this.wrong ? healthy : value });
  }

  /** `mark` is of the arena, if there are two. */
  show(run, robot, steered, mark = "") {
    this.wrong = run.now.faults[robot];
    $("chosen").replaceChildren(this.worlds.robots[robot].name, mark && ` in ${mark}`);
    BREAKS.forEach(({ kind }, index) => {
      this.buttons[index].setAttribute("aria-pressed", String(kind in this.wrong));
    });
    this.worlds.fault_kinds.forEach(({ name, healthy }, index) => {
      showNumber(this.fields[index], this.wrong[name] ?? healthy);
    });
    const { x, y } = $("robot-place").elements, at = run.now.positions[robot];
    const most = this.worlds.half_width_m - this.worlds.robots[robot].radius_m;
    for (const field of [x, y]) Object.assign(field, { min: -most, max: most });
    showNumber(x, at[0]);
    showNumber(y, at[1]);
    $("steer").textContent = steered === robot ? "Let go" : "Steer";
    const does = steered === robot ? "The arrows drive it, as the arrow keys do." :
      "The arrows push it. Steer: you drive it, the policy drives the others.";
    if ($("pad-does").textContent !== does) $("pad-does").textContent = does;
  }
}

class VictimPanel {
  /** `put` takes a victim, x and y; `add` takes a task, x and y. */
  constructor(worlds, put, add) {
    Object.assign(this, { worlds, key: "" });
    this.form = $("victim-place");
    const { which, x, y } = this.form.elements, most = worlds.victim_reach_m;
    for (const field of [x, y]) Object.assign(field, { min: -most, max: most });
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      const [what, number] = which.value.split(" "), place = [Number(x.value), Number(y.value)];
      if (what === "new") add(Number(number), ...place);
      else put(this.victims.find((one) => one.slot === Number(number)), ...place);
    });
    which.addEventListener("change", () => {
      const [what, slot] = which.value.split(" ");
      const victim = what === "slot" && this.victims.find((one) => one.slot === Number(slot));
      if (victim) [x.value, y.value] = [victim.x, victim.y];
    });
  }

  show(victims) {
    this.victims = victims;
    const key = victims.map((one) => [one.slot, one.id, one.task].join()).join(" ");
    if (key === this.key) return;
    this.key = key;
    const { which } = this.form.elements, chosen = which.value, { tasks, num_victims: most } = this.worlds;
    const there = victims.map(({ slot, id, task }) => [`slot ${slot}`, `${id + 1}, ${tasks[task].name}`]);
    const free = victims.length < most;
    const fresh = free ? tasks.map(({ name }, task) => [`new ${task}`, `new, ${name}`]) : [];
    const options = [...fresh, ...there];
    fillSelect(which, options, options.some(([value]) => value === chosen) ? chosen : options[0]?.[0]);
    $("victim-places").textContent = placesText(victims.length, most);
  }
}

/** How many places for victims are taken. */
function placesText(taken, most) {
  if (taken < most) return `${taken} of ${counted(most, "place")} taken.`;
  return `${most === 1 ? "The only place is" : `All ${most} places are`} taken: move a victim, or wait for a rescue.`;
}

/** Buttons that add a robot, one for each kind that has spare ones. */
class SparePanel {
  /** `add` takes a kind. */
  constructor({ robots, kinds }, add) {
    const able = kinds.filter((kind) => robots.some((one) => one.is_spare && one.kind === kind));
    $("joining").hidden = !able.length;
    this.rows = able.map((kind) => {
      const left = element("small"), button = element("button", { type: "button" }, `${kind} `, left);
      button.addEventListener("click", () => add(kind));
      $("kinds").append(button);
      return { kind, left };
    });
  }

  /** `waiting` gives how many of a kind are outside. */
  show(waiting) {
    for (const { kind, left } of this.rows) {
      const text = `${waiting(kind)} left`;
      if (left.textContent !== text) left.textContent = text;
    }
  }
}

function noSpareText({ robots }, kind) {
  const most = robots.filter((one) => one.is_spare && one.kind === kind).length;
  return `All ${most} ${kind} robots that can be added are in the arena: take one out first.`;
}

/** The newest events, the latest first. */
class EventLog {
  constructor(list, empty, choose) {
    Object.assign(this, { list, empty, choose });
  }

  /** Adds what happened in an arena. */
  add(events, dt, arena) {
    const before = arena.mark && `${arena.mark}: `;
    for (const event of events) {
      const time = element("time", {}, `${(event.step * dt).toFixed(1)} s`);
      const button = element("button", { type: "button" }, time, symbol(eventMark(event.type, 0, 0)),
        element("span", {}, before + event.text));
      button.addEventListener("click", () => this.choose(event.robots[0], arena));
      this.list.prepend(element("li", {}, button));
    }
    while (this.list.children.length > MOST_EVENTS) this.list.lastChild.remove();
    this.empty.hidden = this.list.children.length > 0;
  }

  clear() {
    this.list.replaceChildren();
    this.empty.hidden = false;
  }
}
