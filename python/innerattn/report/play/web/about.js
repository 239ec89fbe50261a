// What a page shows, in a few sentences.

const MOST_TASKS = 3;

function aboutText(worlds, attends) {
  const { robots, tasks } = worlds;
  const needs = tasks.map(({ name, needs: all, amounts }) => `${listed(withAmounts(all, amounts))} (${name})`);
  const which = tasks.length > MOST_TASKS ? "" : `: ${needs.join(" or ")}`;
  const says = [
    `${counted(robots.length, "robot")} ${robots.length > 1 ? "rescue" : "rescues"} victims. A victim is rescued ` +
      `when robots that offer what it needs are beside it at the same time${which}.`,
    "Each robot acts by itself. Drag one, break one, and watch what the others do.",
  ];
  if (attends) {
    says.push("Lines from the chosen robot show attention: how much its critic, which judged the team in " +
      "training, looks at each teammate.");
  }
  return says.join(" ");
}
