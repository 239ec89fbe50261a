// What a page shows, in a few sentences.

const MOST_TASKS = 3;

/** What else there is to know of some worlds, a sentence each. */
function rules({ tasks, has_services, has_deadlines, stations, depots }, robots) {
  const waiting = tasks.filter(({ after }) => after.length).map(({ name, after }) => `${name} for ${listed(after)}`);
  const some = (what) => robots.some((one) => one[what]);
  const who = (what) => (robots.every((one) => one[what]) ? "Robots" : "Some robots");
  return [
    [tasks.some(({ amounts }) => Object.keys(amounts).length), "What the robots there offer is added up."],
    [has_services, "Help takes time: robots stay until the arc around the victim is closed."],
    [waiting.length, `Dashed victims wait: ${listed(waiting)}.`],
    [has_deadlines, "A victim is lost when the seconds below it are over."],
    [some("has_battery"), `${who("has_battery")} run on batteries${stations.length ? ", which stations charge" : ""}.`],
    [some("load"), `${who("load")} use up what they carry${depots.length ? "; depots give more" : ""}.`],
    [some("sight"), `${who("sight")} see only a part of the arena: the pale area around the chosen one.`],
    [some("has_wheels"), "Robots with a nose are on wheels: they turn before they drive on."],
  ].filter(([holds]) => holds).map(([, says]) => says);
}

function aboutText(worlds, attends, areTwo) {
  const { tasks } = worlds, robots = worlds.robots.filter((one) => !one.is_spare);
  const needs = tasks.map(({ name, needs: all, amounts }) => `${listed(withAmounts(all, amounts))} (${name})`);
  const which = tasks.length > MOST_TASKS ? "" : `: ${needs.join(" or ")}`;
  const says = [
    `${counted(robots.length, "robot")} ${robots.length > 1 ? "rescue" : "rescues"} victims. A victim is rescued ` +
      `when robots that offer what it needs are beside it at the same time${which}.`,
    ...rules(worlds, robots),
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
