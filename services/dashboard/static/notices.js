// Notices, and questions before a consequence.
import { translated } from "./phrases.js";

const ERROR_MS = 20000;
const NOTICE_MS = 5000;
const $ = (id) => document.getElementById(id);
let page = null;

export function begin(given) {
  page = given;
}

// A text is a key of the catalogue, or a sentence of a service; `about` is the key of its result.
function noticeText(text, about) {
  const { t, language } = page;
  if (t(text) !== text || language() === "en") return t(text);
  const details = translated(text, language());
  const result = about && t(`event.${about}`);
  return result && result !== details ? `${result} ${details}` : details;
}

export function toast(text, level = "info", about = "") {
  const it = document.createElement("div");
  it.dataset.level = level;
  it.textContent = noticeText(text, about);
  for (const old of [...$("toasts").children]) if (old.textContent === it.textContent) old.remove();
  $("toasts").append(it);
  setTimeout(() => it.remove(), level === "error" ? ERROR_MS : NOTICE_MS);
}

// Not modal: the emergency stop must remain one tap away.
export function confirm(title, text, yes) {
  $("question-title").textContent = page.t(title);
  $("question-text").textContent = text;
  $("question").show();
  $("question-yes").onclick = () => { $("question").close(); yes(); };
  $("question-no").onclick = () => $("question").close();
}
