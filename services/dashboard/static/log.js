// The page of the shift log: rows of the recorder, the newest first, by days of this viewer's time zone.
import * as i18n from "./i18n.js";
import { t } from "./i18n.js";
import { create } from "./panels.js";
import { store, stored } from "./storage.js";

const RETRY_MS = 3000;
const EVER = 1; // s since 1970
const LOCALES = { en: "en-GB", zh: "zh-CN" };
const SHORT = { month: "short", day: "numeric" };
const DAY = { weekday: "long", year: "numeric", month: "long", day: "numeric" };
const $ = (id) => document.getElementById(id);
const { robot } = $("log-page").dataset;

let lines = [];
let before = ""; // of the next page; empty: there is none
let problem = null;
let read = false; // an answer has arrived

async function load() {
  $("log-older").disabled = true;
  const query = new URLSearchParams({ robot, ...(before && { before }) });
  const response = await fetch(`/log/rows?${query}`).catch(() => null);
  if (response?.status === 401) location.reload(); // its token page
  const view = response?.ok ? await response.json().catch(() => null) : null;
  problem = view ? view.problem : "no_dashboard";
  if (problem) setTimeout(load, RETRY_MS);
  else {
    lines = [...lines, ...view.lines];
    before = view.before;
    read = true;
  }
  show();
}

const day = (seconds, form = DAY) => new Date(seconds * 1000).toLocaleDateString(LOCALES[i18n.language], form);
const at = (it) => (it.begin < EVER ? it.end : it.begin); // the log begins with the time before its first line
const clock = (seconds) => new Date(seconds * 1000).toLocaleTimeString([], { hour12: false });

function row(it) {
  const line = create("li", "", { "data-kind": it.kind, "data-level": it.level });
  const other = it.end !== null && day(it.end) !== day(it.begin) ? `${day(it.end, SHORT)} ` : "";
  const end = it.end === null ? "" : ` – ${other}${clock(it.end)}`;
  const text = create("p", t(it.text));
  if (it.recording) text.append(create("small", it.recording));
  const time = it.begin < EVER ? t("log_until", clock(it.end)) : clock(it.begin) + end;
  line.append(create("time", time), create("b", t(it.word)), text);
  return line;
}

function show() {
  document.documentElement.lang = i18n.language;
  for (const it of document.querySelectorAll("[data-t]")) it.textContent = t(it.dataset.t);
  const days = new Map();
  for (const it of lines) days.set(day(at(it)), [...(days.get(day(at(it))) ?? []), row(it)]);
  $("log").replaceChildren(...[...days].flatMap(([name, rows]) => {
    const list = create("ol");
    list.append(...rows);
    return [create("h2", name), list];
  }));
  $("log-problem").textContent = problem ? t(problem) : read ? "" : t("log_loading");
  $("log-older").hidden = !before;
  $("log-older").disabled = !!problem;
}

i18n.begin(stored("language", ""));
$("language").onclick = () => {
  store("language", i18n.change());
  show();
};
$("log-older").onclick = load;
show();
load();
