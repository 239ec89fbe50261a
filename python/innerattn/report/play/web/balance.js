// How evenly robots share the rescues of a world that goes on: see innerattn.measures.sharing.imbalance.

class Balance {
  /** Of some robots alone. */
  constructor({ tasks }, robots) {
    const offering = (ability) => robots.filter(({ abilities }) => abilities.includes(ability)).length;
    const isShared = (ability) => offering(ability) > 1; // there is a choice of whom to send
    this.tasks = tasks.map(({ needs, amounts }) => {
      const shared = needs.filter(isShared), isSum = Object.keys(amounts).length > 0;
      const able = robots.filter(({ abilities }) => abilities.some((one) => shared.includes(one)));
      // Of a list of needs, the helpers stand in the order of needs.
      return { counts: new Map(able.map(({ index }) => [index, 0])), isChoice: (at) => isSum || isShared(needs[at]) };
    });
    this.clear();
  }

  clear() {
    for (const { counts } of this.tasks) for (const robot of counts.keys()) counts.set(robot, 0);
  }

  add(rescues) {
    for (const { task, helpers } of rescues) {
      const { counts, isChoice } = this.tasks[task];
      helpers.forEach((robot, at) => {
        if (isChoice(at) && counts.has(robot)) counts.set(robot, counts.get(robot) + 1);
      });
    }
  }

  /** Whether each task is one that exactly two robots share. */
  get isDefined() {
    return this.tasks.every(({ counts }) => counts.size === 2);
  }

  /** The distance of the first robot's share from 0.5, a mean over tasks; NaN before each has a rescue. */
  get imbalance() {
    const shares = this.tasks.map(({ counts }) => {
      const [first, second] = counts.values();
      return Math.abs(first / (first + second) - 0.5);
    });
    return shares.reduce((sum, one) => sum + one, 0) / shares.length;
  }
}
