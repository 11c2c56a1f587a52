// The panel of patrol: its round, the routes, and teaching. One press is one call: the buttons are
// disabled for a while after it, and while the state of patrol is not live.
import { language, t } from "./i18n.js";
import { create, duration, fill } from "./panels.js";

const LOCKED_MS = 1000; // after a press: a second click is no second call
const RETRY_MS = 5000; // until an unanswered question for a route is asked again
const OVER = ["idle", "done"]; // no round is open
const $ = (id) => document.getElementById(id);
let page = null;
let patrol = null; // the newest state
let routes = []; // the list
let selected = ""; // by a click
let asked = {}; // { list, route }: the version and name of the last question, and its time
let lockedUntil = 0;
let mayAct = false;

const has = (action) => !!patrol?.actions.includes(action);
const isOpen = () => !!patrol?.state && !OVER.includes(patrol.state);

/** Forget all: a new connection shows nothing of the last one. */
export function forget() {
  [patrol, routes, asked] = [null, [], {}];
  $("patrol").classList.add("old");
  page.draw(null);
}

/** Show the state in a slow snapshot. */
export function show(given) {
  patrol = given;
  $("patrol").classList.remove("old");
  $("patrol").hidden = !patrol;
  if (!patrol) return;
  if (patrol.teaching) selected = patrol.teaching.route; // it is the one to start next
  ask("list", "");
  ask("route", shownRoute());
  showState();
  showRoutes();
  showTeaching();
  enable(mayAct);
}

/** Enable the buttons for who may drive. */
export function enable(isDriver, why = "") {
  mayAct = isDriver;
  const off = !mayAct || !patrol?.state || performance.now() < lockedUntil;
  for (const it of $("patrol").querySelectorAll("[data-call]")) if (it.disabled !== off) it.disabled = off;
  write("patrol-why", mayAct || !patrol?.state ? "" : t(why || "take_first"));
}

// The route of an open round, else the selected one, else that of the last round.
function shownRoute() {
  if (patrol.teaching || !patrol.state) return "";
  if (isOpen()) return patrol.route;
  const drivable = routes.filter((it) => !it.problem).map((it) => it.name);
  return [selected, patrol.route].find((it) => drivable.includes(it)) ?? drivable[0] ?? "";
}

function ask(what, name) {
  const last = asked[what];
  const isNew = last?.version !== patrol.version || last.name !== name;
  if (what === "route" && last?.name !== name) page.draw(null);
  if (what === "route" && !name) asked.route = { version: patrol.version, name };
  else if (isNew || (!last.done && performance.now() - last.at > RETRY_MS)) {
    asked[what] = { version: patrol.version, name, at: performance.now() };
    page.send(name ? { k: "routes", route: name } : { k: "routes" });
  }
}

/** Take the list of routes. */
export function list(message) {
  if (asked.list?.version !== message.version) return;
  asked.list.done = true;
  routes = message.routes;
  if (patrol) show(patrol);
}

/** Take the route that is drawn. */
export function route(message) {
  if (asked.route?.version !== message.version || asked.route.name !== message.name) return;
  asked.route.done = true;
  page.draw(message);
}

// --- the round ------------------------------------------------------------------------------

function showState() {
  for (const part of ["word", "text"]) {
    write(`patrol-${part}`, t(patrol[part]));
    $(`patrol-${part}`).hidden = !!patrol.teaching; // the last round is not its subject
  }
  $("patrol").dataset.state = patrol.state ?? "silent";
  const progress = patrol.length ? Math.min(1, patrol.progress / patrol.length) : 0;
  $("patrol-bar").hidden = !isOpen() || patrol.progress == null;
  $("patrol-bar").firstElementChild.style.width = `${100 * progress}%`;
  fill($("patrol-facts"), JSON.stringify([patrol, language]), () => facts().map((it) => create("li", it)));
  for (const it of document.querySelectorAll("[data-round]")) it.hidden = !has(it.dataset.round);
}

const metres = (value) => value.toFixed(value < 100 ? 1 : 0);

function facts() {
  const { progress, length, homeward, station, left, deviation, sigma, corridor, next } = patrol;
  const found = [];
  if (isOpen()) {
    if (progress != null) found.push(t(homeward ? "patrol_homeward" : "patrol_progress", metres(progress), metres(length)));
    if (station && patrol.state !== "staying") found.push(t("patrol_station", station));
    if (left != null) found.push(t(`left_${patrol.state}`, duration(left)));
    if (deviation != null) found.push(t("patrol_deviation", deviation.toFixed(2), (2 * sigma).toFixed(2), corridor.toFixed(2)));
  }
  if (next) found.push(t("patrol_next", next.route, next.schedule, clock(next.t)));
  return found;
}

const clock = (seconds) => new Date(seconds * 1000).toLocaleString(language, {
  weekday: "short", day: "numeric", month: "short", hour: "2-digit", minute: "2-digit", hourCycle: "h23",
});

function showRoutes() {
  $("routes").hidden = !has("start");
  const shown = shownRoute();
  write("round-start", t("round_start", shown));
  if (!shown) $("round-start").hidden = true;
  fill($("route-list"), JSON.stringify([routes, shown, language]), () => {
    if (!routes.length) return [create("p", t("no_routes"), { class: "hint" })];
    return routes.map((it) => routeButton(it, it.name === shown));
  });
}

function routeButton(of, isShown) {
  const it = create("button", of.name, { "aria-pressed": isShown });
  it.disabled = !!of.problem;
  it.onclick = () => { selected = of.name; show(patrol); };
  const about = of.problem ? t(of.problem) : t("route_about", metres(of.length), of.stations);
  it.append(create("small", about, of.problem ? { class: "bad" } : {}));
  return it;
}

// --- teaching -------------------------------------------------------------------------------

function showTeaching() {
  const { teaching } = patrol;
  $("teach").hidden = !!teaching || isOpen() || !patrol.state;
  $("teaching").hidden = !teaching;
  if (!teaching) return;
  write("teaching-text", t("teaching", teaching.route, metres(teaching.length), teaching.stations.join(", ")));
  write("teaching-reason", t(teaching.text));
}

/** Return the fields of a form, or null, with a notice, when one of them is not valid. */
function fields(ids) {
  const wrong = ids.map($).find((it) => !it.checkValidity());
  if (!wrong) return ids.map((id) => $(id).value.trim());
  page.toast(wrong.type === "number" ? "stay_invalid" : "name_invalid", "warning");
  wrong.focus();
  return null;
}

const TEACH = {
  begin() {
    const [name, station] = fields(["route-name", "home-name"]) ?? [];
    if (name) call({ k: "teach", action: "begin", route: name, station });
  },
  station() {
    const [station, stay] = fields(["station-name", "station-stay"]) ?? [];
    if (!station) return;
    call({ k: "teach", action: "station", station, stay: Number(stay) });
    $("station-name").value = "";
  },
  end: () => call({ k: "teach", action: "end" }),
  cancel: () => page.confirm("teach_cancel", t("teach_cancel_text"), () => call({ k: "teach", action: "cancel" })),
};

// --- calls ----------------------------------------------------------------------------------

function act(action) {
  if (action === "start") call({ k: "round", action, route: shownRoute() });
  else if (action === "abort") {
    page.confirm("round_abort", t("round_abort_text"), () => call({ k: "round", action }));
  } else call({ k: "round", action });
}

function call(message) {
  if (!mayAct) page.toast("take_first", "warning");
  else if (performance.now() >= lockedUntil) {
    lockedUntil = performance.now() + LOCKED_MS;
    page.send({ ...message, echo: page.echo(), name: page.name() });
    enable(mayAct);
  }
}

function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

export function begin(given) {
  page = given;
  for (const it of document.querySelectorAll("[data-round]")) it.onclick = () => act(it.dataset.round);
  for (const it of document.querySelectorAll("[data-teach]")) it.onclick = TEACH[it.dataset.teach];
}
