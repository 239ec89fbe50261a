// What robots and tasks do at a time, from the packed schedule.

const DOES = { drive: "drives to", wait: "waits at", work: "works on", home: "drives home" };

class Course {
  constructor({ robots, tasks, makespan, extent }) {
    Object.assign(this, { tasks, makespan, extent });
    this.digits = makespan > 0 ? Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(makespan)))) : 2;
    this.robots = robots.map(({ spans, ...robot }, index) => {
      let origin = null; // task at which a robot is as a span begins; null: its depot
      const named = spans.map(([what, begin, end, task]) => {
        const span = { robot: index, what, begin, end, task, origin };
        origin = task;
        return span;
      });
      return { ...robot, index, spans: named };
    });
    const marks = tasks.flatMap(({ start, end }) => [start, end]);
    this.moments = [...new Set([0, ...marks, makespan])].sort((a, b) => a - b);
  }

  /** What a robot does; undefined: it is at its depot. */
  spanAt(robot, time) {
    const found = robot.spans.findLast(({ begin }) => begin <= time);
    return found && found.what === "home" && found.end <= time ? undefined : found;
  }

  stateOf({ start, end }, time) {
    if (time >= end) return "done";
    return time >= start ? "being worked on" : "waiting";
  }

  doneAt(time) {
    return this.tasks.filter((task) => this.stateOf(task, time) === "done").length;
  }

  text(time) {
    return time.toFixed(this.digits);
  }

  spanText({ robot, what, begin, end, task }) {
    const where = task === null ? "" : ` task ${task}`;
    return `robot ${robot} ${DOES[what]}${where} from ${this.text(begin)} to ${this.text(end)}`;
  }

  /** All of a moment in words. */
  momentText(time) {
    const spans = this.robots.map((robot) => this.spanAt(robot, time)?.what);
    const robots = [["drive", "drive"], ["wait", "wait"], ["work", "work"], ["home", "drive home"], [undefined, "are at depots"]]
      .map(([what, words]) => [spans.filter((one) => one === what).length, words]);
    const states = this.tasks.map((task) => this.stateOf(task, time));
    const tasks = ["waiting", "being worked on", "done"].map((state) => [states.filter((one) => one === state).length, state]);
    const told = (counts) => listed(counts.filter(([count]) => count).map((one) => one.join(" ")));
    return `Robots: ${told(robots)}. Tasks: ${told(tasks)}.`;
  }
}
