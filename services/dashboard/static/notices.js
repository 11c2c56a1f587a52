// Notices, and questions before a consequence.
import { t } from "./i18n.js";

const ERROR_MS = 20000;
const NOTICE_MS = 5000;
const MOST = 2; // at a time: more would cover the page
const $ = (id) => document.getElementById(id);

export function begin() {
  for (const event of ["scroll", "resize"]) addEventListener(event, place);
}

/** Show a text for a while; as for `t`, it is a name in the table or a text in both languages. */
export function toast(text, level = "info") {
  const it = document.createElement("div");
  it.dataset.level = level;
  it.textContent = t(text);
  for (const old of [...$("toasts").children]) if (old.textContent === it.textContent) old.remove();
  $("toasts").append(it);
  while ($("toasts").childElementCount > MOST) $("toasts").firstChild.remove();
  place();
  setTimeout(() => it.remove(), level === "error" ? ERROR_MS : NOTICE_MS);
}

/** Place the notices at the bottom, or over the sonar view where they would cover the driving panel. */
export function place() {
  const it = $("toasts");
  if (!it.childElementCount) return;
  it.removeAttribute("style");
  const panel = document.querySelector(".driving").getBoundingClientRect();
  const covers = [...it.children].map((each) => each.getBoundingClientRect()).some((box) =>
    box.right > panel.left && box.left < panel.right && box.bottom > panel.top && box.top < panel.bottom);
  if (!covers) return;
  const sonar = $("sonar-view").getBoundingClientRect();
  // Upwards from its lower edge: below it may be the release.
  const bottom = Math.min(innerHeight - sonar.bottom, innerHeight - it.offsetHeight);
  Object.assign(it.style, {
    left: `${sonar.left}px`, right: `${document.documentElement.clientWidth - sonar.right}px`, bottom: `${bottom}px`,
  });
}

// Not modal: the emergency stop must remain one tap away. Enter says no.
export function confirm(title, text, yes) {
  $("question-title").textContent = t(title);
  $("question-text").textContent = text;
  $("question").setAttribute("open", ""); // as show() of newer browsers
  $("question-yes").onclick = () => { $("question").removeAttribute("open"); yes(); };
  $("question-no").onclick = () => $("question").removeAttribute("open");
  $("question-no").focus();
}
