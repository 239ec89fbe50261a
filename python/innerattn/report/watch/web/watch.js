// Asks for the state every few seconds and shows it.

const EVERY_MS = 2000;
const SILENT_S = 60;
const shown = { run: 0, checkpoint: null };
let state = { runs: [], plots: [] };

function clock(seconds) {
  if (seconds === null) return "–";
  const whole = Math.round(seconds), two = (value) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

function count(value) {
  return value === null ? "–" : Math.round(value).toLocaleString("en");
}

function row(run, index) {
  const number = (text) => element("td", { class: "number" }, text);
  const share = Math.min(run.env_steps / run.total_env_steps, 1);
  const bar = element("progress", { max: "1", value: String(share), "aria-label": `${run.name}: done` });
  const silent = run.state === "running" && run.silent_s > SILENT_S;
  const newest = element("td");
  if (run.checkpoint === null) newest.append("none yet");
  else {
    const button = element("button", { type: "button", "aria-pressed": String(index === shown.run) },
      `after ${count(run.checkpoint)}`);
    button.addEventListener("click", () => choose(index));
    newest.append(button);
  }
  return element("tr", {},
    element("th", { scope: "row" }, run.name),
    element("td", {}, silent ? `running, silent for ${clock(run.silent_s)}` : run.state),
    element("td", {}, bar),
    number(count(run.env_steps)), number(count(run.env_steps_per_s)), number(clock(run.seconds_left)),
    number(run.rescues === null ? "–" : run.rescues.toFixed(2)), newest);
}

function choose(index) {
  shown.run = index;
  shown.checkpoint = null;
  showEpisodes();
  $("runs").replaceChildren(...state.runs.map(row));
}

/** Loads the replay of the chosen run when its checkpoint is another one. */
function showEpisodes() {
  const run = state.runs[shown.run];
  if (!run || run.checkpoint === null || run.checkpoint === shown.checkpoint) return;
  shown.checkpoint = run.checkpoint;
  $("which").textContent = `Playing ${run.name} after ${count(run.checkpoint)} env-steps.`;
  $("episodes").onload = () => {
    $("which").textContent = `${run.name} after ${count(run.checkpoint)} env-steps.`;
  };
  $("episodes").hidden = false;
  $("episodes").src = `episodes/${shown.run}?after=${run.checkpoint}`;
}

function showRuns() {
  const focused = [...$("runs").querySelectorAll("button")].indexOf(document.activeElement);
  $("runs").replaceChildren(...state.runs.map(row));
  if (focused >= 0) $("runs").querySelectorAll("button")[focused]?.focus();
}

function showPlots() {
  while ($("plots").children.length < state.plots.length) {
    $("plots").append(element("div", { class: "plot" }));
  }
  state.plots.forEach((plot, index) => drawPlot($("plots").children[index], plot));
}

async function refresh() {
  try {
    const answer = await fetch("state");
    const text = await answer.text();
    if (!answer.ok) throw new Error(text);
    state = JSON.parse(text);
    const first = state.runs.findIndex((run) => run.checkpoint !== null);
    if (shown.checkpoint === null && first >= 0 && state.runs[shown.run].checkpoint === null) {
      shown.run = first;
    }
    showRuns();
    showEpisodes();
    showPlots();
    const running = state.runs.filter((run) => run.state === "running").length;
    const news = running ? `${running} of ${state.runs.length} running.` : "All trainings have ended.";
    if ($("news").textContent !== news) $("news").textContent = news;
  } catch (error) {
    $("news").textContent = `No news: ${error.message}. Is innerattn watch still running?`;
  }
  document.documentElement.dataset.drawn = "true";
  setTimeout(refresh, EVERY_MS);
}

startTheme();
refresh();
