// How evenly robots share the rescues of a world that goes on: see innerattn.measures.sharing.imbalance.

class Balance {
  /** Of some robots alone. */
  constructor({ tasks }, robots) {
    const withAbility = (ability) => robots.filter(({ abilities }) => abilities.includes(ability));
    this.needs = tasks.flatMap(({ needs, amounts }, task) => {
      const isSum = Object.keys(amounts).length > 0;
      const shared = [...new Set(needs)].filter((ability) => withAbility(ability).length > 1);
      return shared.map((ability) => ({
        task,
        counts: new Map(withAbility(ability).map(({ index }) => [index, 0])),
        // Of a list of needs, the helpers stand in the order of needs.
        isChoice: (at) => isSum || needs[at] === ability,
      }));
    });
  }

  add(rescues) {
    for (const { task, helpers } of rescues) {
      for (const { counts, isChoice } of this.needs.filter((need) => need.task === task)) {
        helpers.forEach((robot, at) => {
          if (isChoice(at) && counts.has(robot)) counts.set(robot, counts.get(robot) + 1);
        });
      }
    }
  }

  /** Whether there is a need that several robots can meet. */
  get isDefined() {
    return this.needs.length > 0;
  }

  /** Half the sum of the distances of shares from even ones, a mean over needs; NaN before each has a rescue. */
  get imbalance() {
    const distances = this.needs.map(({ counts }) => {
      const each = [...counts.values()], total = each.reduce((sum, one) => sum + one, 0);
      return each.reduce((sum, one) => sum + Math.abs(one / total - 1 / each.length), 0) / 2;
    });
    return distances.reduce((sum, one) => sum + one, 0) / distances.length;
  }
}
