// Notices, and questions before a consequence.
import { capital, combined, translated } from "./phrases.js";

const ERROR_MS = 20000;
const NOTICE_MS = 5000;
const MOST = 2; // at a time: more would cover the page
const $ = (id) => document.getElementById(id);
let page = null;

export function begin(given) {
  page = given;
  for (const event of ["scroll", "resize"]) addEventListener(event, place);
}

// A text is a key of the catalogue, or a sentence of a service; `about` is the key of its result.
function noticeText(text, about) {
  const { t, language } = page;
  if (t(text) !== text || language() === "en") return capital(t(text));
  return combined(about && t(`event.${about}`), translated(text, language())).join("");
}

export function toast(text, level = "info", about = "") {
  const it = document.createElement("div");
  it.dataset.level = level;
  it.textContent = noticeText(text, about);
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

// Not modal: the emergency stop must remain one tap away.
export function confirm(title, text, yes) {
  $("question-title").textContent = page.t(title);
  $("question-text").textContent = text;
  $("question").setAttribute("open", ""); // as show() of newer browsers
  $("question-yes").onclick = () => { $("question").removeAttribute("open"); yes(); };
  $("question-no").onclick = () => $("question").removeAttribute("open");
}
