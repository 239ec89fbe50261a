// What a robot world is made of, as pages know it.

/** What all policies of the page share: the arena, the team, the tasks. */
class Worlds {
  /** `places`: x and y of the obstacles in each episode, in units of `unit` metres. */
  constructor(described, places, unit) {
    Object.assign(this, described, { places, unit });
    this.kinds = [...new Set(this.robots.map((robot) => robot.kind))];
    this.robots.forEach((robot, index) => {
      robot.index = index;
      robot.kindIndex = this.kinds.indexOf(robot.kind);
      robot.layerIndex = this.layers.indexOf(robot.layer);
      robot.twin = this.robots.slice(0, index).filter((other) => other.kind === robot.kind).length;
    });
    this.abilities = [...new Set(this.robots.flatMap((robot) => robot.abilities))];
    this.tasks.flatMap((task) => task.needs).forEach((need) => {
      if (!this.abilities.includes(need)) this.abilities.push(need);
    });
    this.letters = shortNames(this.abilities);
  }

  /** The kind whose colour an ability has: the only one that offers it, or none. */
  kindOf(ability) {
    const kinds = new Set(
      this.robots.filter((robot) => robot.abilities.includes(ability)).map((one) => one.kindIndex),
    );
    return kinds.size === 1 ? [...kinds][0] : -1;
  }

  canHelp(robot, task) {
    return this.tasks[task].needs.some((need) => this.robots[robot].abilities.includes(need));
  }

  /** Whether robots have what a task needs of an ability: one of them, or together the amount. */
  isReached(task, need, robots) {
    const able = robots.filter((robot) => robot.abilities.includes(need)), { amounts } = this.tasks[task];
    if (!(need in amounts)) return able.length > 0;
    return able.reduce((sum, robot) => sum + (robot.amounts[need] ?? 1), 0) >= amounts[need] * (1 - 1e-9);
  }

  obstacle(episode, index) {
    const at = 2 * (episode * this.obstacles.length + index);
    return [this.places[at] * this.unit, this.places[at + 1] * this.unit];
  }
}

/** Abilities or needs for readers; an amount stands before its name. */
function withAmounts(names, amounts) {
  return names.map((name) => (name in amounts ? `${amounts[name]} ${name}` : name));
}

/** The shortest beginnings that tell some names apart. */
function shortNames(names) {
  const found = {};
  for (const name of names) {
    const letters = [...name];
    let length = 1;
    while (
      length < letters.length &&
      names.some((other) => other !== name && [...other].slice(0, length).join("") ===
        letters.slice(0, length).join(""))
    ) length++;
    const short = letters.slice(0, Math.min(length, 3)).join("");
    found[name] = short.charAt(0).toUpperCase() + short.slice(1);
  }
  return found;
}

/** Metres from a robot to the nearest victim that it can help; NaN: there is none. */
function distanceToVictim(run, episode, step, robot) {
  const [x, y] = run.place(episode, step, robot);
  let least = NaN;
  for (const victim of run.victims[episode]) {
    if (step < victim.from || step >= victim.to) continue;
    if (!run.worlds.canHelp(robot, victim.task)) continue;
    const away = Math.hypot(victim.x - x, victim.y - y);
    if (!(away >= least)) least = away;
  }
  return least;
}
