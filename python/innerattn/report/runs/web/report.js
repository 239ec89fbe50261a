// Draws the plots of the page.

const boxes = [...document.querySelectorAll(".plot")];
const plots = JSON.parse(document.getElementById("plots").textContent);

function draw() {
  return Promise.all(boxes.map((box, index) => drawPlot(box, plots[index])));
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
draw().then(() => (document.documentElement.dataset.drawn = "true"));
