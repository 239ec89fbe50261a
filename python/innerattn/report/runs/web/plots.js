// Draws plots in the colours of the reader's theme.

function layout(plot) {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const shown = plot.traces.flatMap((one) => one.y).concat(Object.values(plot.levels));
  const known = shown.filter((value) => value !== null);
  const [least, most] = [Math.min(0, ...known), Math.max(...known)];
  const narrow = window.innerWidth < 700;
  const axis = (text) => ({
    title: { text, standoff: 8 }, gridcolor: colour("line"), zerolinecolor: colour("line"),
    linecolor: colour("quiet"), automargin: true,
  });
  const level = ([text, y]) => ({
    type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y,
    line: { color: colour("quiet"), width: 1, dash: "dash" },
    label: { text, textposition: "end", yanchor: "bottom", font: { size: 12, color: colour("quiet") } },
  });
  return {
    title: { text: plot.title, x: 0, xanchor: "left", font: { size: 16 } },
    font: { family: "system-ui, sans-serif", size: 13, color: colour("ink") },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 55, r: 20, t: 40, b: 45 }, hovermode: "closest",
    xaxis: axis(plot.x), yaxis: { ...axis(plot.y), range: [1.08 * least, 1.12 * most] },
    shapes: Object.entries(plot.levels).map(level),
    legend: narrow ? { orientation: "h", y: -0.25 } : { x: 1.02, y: 1 },
    hoverlabel: { bgcolor: colour("card"), font: { color: colour("ink") } },
  };
}

function drawPlot(box, plot) {
  return Plotly.react(box, plot.traces, layout(plot), { responsive: true, displayModeBar: false });
}
