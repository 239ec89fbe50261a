// Asks for the state of a study every few seconds and shows it.

const EVERY_MS = 3000;

function running(run) {
  const bar = element("progress", { max: "1", value: String(run.share), "aria-label": `${run.name}: trained` });
  const number = (text) => element("td", { class: "number" }, text);
  return element("tr", {},
    element("th", { scope: "row" }, run.name), element("td", {}, bar), number(run.left ?? "–"),
    number(run.rescues === null ? "–" : run.rescues.toFixed(2)));
}

function show(state) {
  const { done, claimed, planned, failed } = state.counts;
  $("title").textContent = document.title = state.title;
  const all = state.search ? `at most ${state.runs}` : state.runs;
  const parts = [`${done} of ${all} runs are done`, `${claimed} running`, `${planned} waiting`];
  if (failed) parts.push(`${failed} failed`);
  const left = state.left === null ? "" : ` ${state.search ? "At most" : "About"} ${state.left} more.`;
  const news = `${parts.join(", ")}.${left}`;
  if ($("news").textContent !== news) $("news").textContent = news;
  $("done").value = state.runs ? (done + failed) / state.runs : 0;
  $("verdicts").replaceChildren(...state.verdicts.map((text) => element("li", {}, text)));
  $("verdicts-part").hidden = !done || !state.verdicts.length;
  $("heads").replaceChildren(...state.heads.map((head) => element("th", { scope: "col" }, head)));
  $("scores").replaceChildren(...state.rows.map((cells) => element("tr", {},
    ...cells.map((cell) => element("td", {}, cell)))));
  $("scores-part").hidden = !state.rows.length;
  $("running").replaceChildren(...state.running.map(running));
  $("failed").replaceChildren(...state.failed.map((run) => element("li", {}, `${run.name}: ${run.why}`)));
  $("failed-part").hidden = !state.failed.length;
}

async function refresh() {
  try {
    const answer = await fetch("state");
    const text = await answer.text();
    if (!answer.ok) throw new Error(text);
    show(JSON.parse(text));
  } catch (error) {
    $("news").textContent = `No news: ${error.message}. Is innerattn watch still running?`;
  }
  document.documentElement.dataset.drawn = "true";
  setTimeout(refresh, EVERY_MS);
}

startTheme();
refresh();
