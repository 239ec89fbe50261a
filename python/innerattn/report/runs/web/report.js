// Draws the plots of the page.

startTheme();
const plots = JSON.parse(document.getElementById("plots").textContent);
[...document.querySelectorAll(".plot")].forEach((box, index) => drawPlot(box, plots[index]));
document.documentElement.dataset.drawn = "true";
