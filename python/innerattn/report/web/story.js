// What happens in an episode, in words.

function listed(names) {
  return names.length < 2 ? names.join("") :
    `${names.slice(0, -1).join(", ")} and ${names[names.length - 1]}`;
}

function counted(count, what) {
  return `${count} ${what}${count === 1 ? "" : "s"}`;
}

function percent(share) {
  return `${Math.round(100 * share)} %`;
}

function faultText(worlds, fault) {
  const { name, unit } = worlds.fault_kinds[fault.kind];
  const words = name.replaceAll("_", " ");
  if (unit) return `${words} ${fault.value.toFixed(2)} ${unit}`;
  return name === "unavailable" && fault.value >= 1 ? words : `${words} ${percent(fault.value)}`;
}

const LEAST_SPELL = 2; // steps in a row; less is hard to see

/** Times in which a robot is blocked for some steps in a row, as {robot, start, end}. */
function blockedSpells(run, episode) {
  const spells = [];
  for (let robot = 0; robot < run.size; robot++) {
    for (let step = 0, start = -1; step <= run.lengths[episode]; step++) {
      const now = step < run.lengths[episode] && run.isBlocked(episode, step, robot);
      if (now && start < 0) start = step;
      if (!now && start >= 0) {
        if (step - start >= LEAST_SPELL) spells.push({ robot, start, end: step });
        start = -1;
      }
    }
  }
  return spells;
}

function rescueEvent(worlds, { step, task, helpers }) {
  const names = helpers.map((robot) => worlds.robots[robot].name);
  const verb = helpers.length === 1 ? "rescues" : "rescue";
  return {
    step, type: "rescue", robots: helpers,
    text: `${listed(names)} ${verb} a victim of ${worlds.tasks[task].name}`,
  };
}

function lostEvent(worlds, { step, task }) {
  return { step, type: "lost", robots: [], text: `a victim of ${worlds.tasks[task].name} is lost` };
}

function handoffEvent(worlds, { robot, before, after, second }) {
  const name = (one) => worlds.robots[one].name;
  return {
    step: second, type: "handoff", robots: [robot],
    text: `handoff: ${name(robot)} worked with ${name(before)} before, now with ${name(after)}`,
  };
}

/** A spare robot comes into the arena, or leaves it. */
function comingEvent(worlds, step, robot, comes) {
  const text = `${worlds.robots[robot].name} ${comes ? "joins" : "leaves"}`;
  return { step, type: comes ? "joining" : "leaving", robots: [robot], text };
}

function faultEvent(worlds, fault) {
  const { start, robot } = fault;
  return {
    step: start, type: "fault", robots: [robot],
    text: `fault: ${worlds.robots[robot].name}, ${faultText(worlds, fault)}`,
  };
}

/** Everything worth a mark on the scrubber: {step, type, text, robots}, in the order of time. */
function eventsOf(run, episode) {
  const { worlds } = run, name = (robot) => worlds.robots[robot].name, events = [];
  for (const one of run.rescues[episode]) events.push(rescueEvent(worlds, one));
  for (const one of run.lost[episode]) events.push(lostEvent(worlds, one));
  for (const one of run.handoffs[episode]) events.push(handoffEvent(worlds, one));
  for (const one of run.faults[episode]) {
    events.push(faultEvent(worlds, one));
    if (one.end < run.lengths[episode]) {
      events.push({
        step: one.end, type: "recovery", robots: [one.robot],
        text: `end of a fault: ${name(one.robot)}, ${faultText(worlds, one)}`,
      });
    }
  }
  for (const one of blockedSpells(run, episode)) {
    events.push({
      step: one.start, type: "blocked", robots: [one.robot],
      text: `${name(one.robot)} is blocked for ${counted(one.end - one.start, "step")}`,
    });
  }
  const order = ["fault", "recovery", "rescue", "lost", "handoff", "blocked"];
  return events.sort(
    (a, b) => a.step - b.step || order.indexOf(a.type) - order.indexOf(b.type),
  );
}

/** How many moments of an episode are worth a look; a handoff or a fault counts like ten blocks. */
function interest(run, episode) {
  return 10 * (run.handoffs[episode].length + run.faults[episode].length) +
    blockedSpells(run, episode).length;
}

const SORTS = {
  interesting: { label: "most interesting first", of: (_, e, run) => interest(run, e) },
  rescues: { label: "most rescues first", of: (_, e, run) => rescueCount(run, e) },
  difference: { label: "largest difference first", of: (runs, e) => spread(runs, e), pairs: true },
  number: { label: "by number", of: (_, e) => -e },
};

function rescueCount(run, episode) {
  return run.rescues[episode].length;
}

function spread(runs, episode) {
  const counts = runs.map((run) => rescueCount(run, episode));
  return Math.max(...counts) - Math.min(...counts);
}

/** Numbers of all episodes, sorted by what happens in those of one run. */
function sortedEpisodes(runs, sort, chosen) {
  const keys = Array.from({ length: chosen.episodes }, (_, e) => SORTS[sort].of(runs, e, chosen));
  return keys.map((_, e) => e).sort((a, b) => keys[b] - keys[a] || a - b);
}

function episodeText(runs, episode) {
  const number = runs[0].worlds.first_episode + episode;
  const counts = (of, what) => {
    const found = runs.map((run) => of(run)[episode].length);
    return found.length > 1 ? `${found.join(" : ")} ${what}s` : counted(found[0], what);
  };
  const parts = [`Episode ${number}`, counts((run) => run.rescues, "rescue")];
  if (runs.some((run) => run.handoffs[episode].length)) parts.push(counts((run) => run.handoffs, "handoff"));
  if (runs.some((run) => run.faults[episode].length)) parts.push(counts((run) => run.faults, "fault"));
  return parts.join(" · ");
}

/** The weight between the chosen robot and another: what it gives, or what it receives. */
function chosenWeight(run, episode, step, look, other) {
  const [from, to] = look.received ? [other, look.robot] : [look.robot, other];
  return run.weight(episode, step, look.head, from, to);
}

/** Whom the chosen robot attends to most, or who attends most to it; "" without attention. */
function attentionText(run, episode, step, look) {
  if (!run.attention) return "";
  const others = run.worlds.robots.filter((one) => one.index !== look.robot);
  const weights = others.map((one) => chosenWeight(run, episode, step, look, one.index));
  const best = weights.indexOf(Math.max(...weights)), { name } = run.worlds.robots[look.robot];
  if (!look.received) return `${name} attends most to ${others[best].name} (${percent(weights[best])}).`;
  const out = run.isAway(episode, step, look.robot) ? ", which is out" : "";
  return `Of all teammates ${others[best].name} attends most to ${name}${out} ` +
    `(${percent(weights[best])}; even: ${percent(1 / others.length)}).`;
}
