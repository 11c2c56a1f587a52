// Light or dark: as the system prefers, or as the viewer chose.
const root = document.documentElement;
let redraw = null;

export function begin(given) {
  redraw = given;
  const preferred = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  choose(localStorage.getItem("t2.theme") ?? preferred);
  document.getElementById("theme").onclick = () => choose(root.dataset.theme === "dark" ? "light" : "dark");
}

function choose(name) {
  root.dataset.theme = name;
  localStorage.setItem("t2.theme", name);
  redraw();
}
