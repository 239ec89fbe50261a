// What a page shows, in a few sentences.

const MOST_TASKS = 3;

function aboutText(worlds, attends, areTwo) {
  const { tasks } = worlds, robots = worlds.robots.filter((one) => !one.is_spare);
  const needs = tasks.map(({ name, needs: all, amounts }) => `${listed(withAmounts(all, amounts))} (${name})`);
  const which = tasks.length > MOST_TASKS ? "" : `: ${needs.join(" or ")}`;
  const says = [
    `${counted(robots.length, "robot")} ${robots.length > 1 ? "rescue" : "rescues"} victims. A victim is rescued ` +
      `when robots that offer what it needs are beside it at the same time${which}.`,
    "Each robot acts by itself. Drag one, break one, and watch what the others do." +
      (robots.length < worlds.robots.length ? " Add one, and it joins the work." : ""),
  ];
  if (areTwo) {
    says.push("Both arenas begin alike and keep the same time; only who drives the robots differs. " +
      "What you do in one happens in both, unless you switch that off.");
  }
  if (attends) {
    says.push("Lines from the chosen robot show attention: how much its critic, which judged the team in " +
      "training, looks at each teammate.");
  }
  return says.join(" ");
}
