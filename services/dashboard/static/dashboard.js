// The page: WebSocket, messages from the server, commands, and language.
import * as charts from "./charts.js";
import * as driving from "./driving.js";
import * as estop from "./estop.js";
import * as notices from "./notices.js";
import * as phrases from "./phrases.js";
import * as panels from "./panels.js";
import * as slots from "./slots.js";
import * as sonarView from "./sonar_view.js";
import * as stateBar from "./state_bar.js";
import * as theme from "./theme.js";
import * as trail from "./trail.js";

const { toast, confirm } = notices;

const LOST_MS = 1000; // without a snapshot
const RETRY_MS = 700;
const CONGESTED = 2048; // bytes that wait in the browser
const INVALID_MESSAGE = 1003; // close code of the server
const $ = (id) => document.getElementById(id);
const stored = (key, otherwise) => localStorage.getItem(`t2.${key}`) ?? otherwise;

let texts = {};
let language = stored("language", navigator.language.startsWith("zh") ? "zh" : "en");
let socket = null;
let fast = null; // the newest snapshots
let fastAt = -Infinity;
let aliveN = -2; // the snapshot that was last answered with a sign of life
let slow = null;
const EVENTS_MAX = 80;
let events = [];
let hello = null;
let robot = null; // the selected one
let drawn = -1; // number of the drawn snapshot

const t = (key) => texts[language][key] ?? key;
const lost = () => performance.now() - fastAt > LOST_MS;
const isDriver = () => !!fast && !!hello && fast.driver.id === hello.id && fast.driver.may && !lost();
const shown = () => hello?.robot ?? robot ?? $("page").dataset.robot;
// A hold is sent only while the socket is not congested: a burst of old answers is useless.
const send = (message) => {
  const open = socket?.readyState === WebSocket.OPEN
    && (message.k !== "hold" || socket.bufferedAmount < CONGESTED);
  if (open) socket.send(JSON.stringify(message));
  return open;
};

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
  const opened = (socket = new WebSocket(address));
  opened.onopen = look;
  opened.onmessage = (event) => handle(JSON.parse(event.data));
  opened.onclose = (event) => {
    if (opened !== socket) return;
    driving.letGo();
    fastAt = -Infinity;
    if (event.code === INVALID_MESSAGE) forget();
    setTimeout(reconnect, RETRY_MS);
  };
}

// A restarted dashboard may require a new token: a reload opens its token page.
async function reconnect() {
  const response = await fetch("/t2/dashboard.css", { cache: "no-store", signal: AbortSignal.timeout(LOST_MS) })
    .catch(() => null);
  if (response?.status === 401) location.reload();
  else connect();
}

// The stored robot or name made an invalid message: it would be refused again and again.
function forget() {
  for (const name of ["robot", "name"]) localStorage.removeItem(`t2.${name}`);
  $("name").value = "";
  robot = null;
}

function look() {
  send({ k: "look", robot: robot ?? $("page").dataset.robot, name: stored("name", "") });
}

function choose(name) {
  robot = name;
  if (robot === hello?.robot) return;
  hello = null;
  look();
}

// Once: later only the viewer changes the selected robot.
function selectStored() {
  const name = stored("robot", null);
  choose(slow.robots[name] && !isDriver() ? name : $("page").dataset.robot);
}

const HANDLERS = {
  hello(message) {
    hello = message;
    sonarView.build(message.vehicle);
    trail.size(message.vehicle);
    slots.show();
  },
  fast(message) {
    if (!hello) return;
    fast = message;
    fastAt = performance.now();
    // At most 10 a second. A hidden page, or one without a socket, is not alive.
    if (hello.keepalive && !document.hidden && Math.abs(message.n - aliveN) >= 2) {
      aliveN = message.n;
      send({ k: "alive", n: aliveN });
    }
    driving.answer(message.n, isDriver(), message.driver.hold, message.safety);
    estop.update(message.safety);
    charts.add(message, fastAt);
    trail.add(message);
  },
  slow(message) {
    slow = message;
    if (robot === null && hello) selectStored();
    panels.showSlow(message, t);
    showRobots();
  },
  events(message) {
    events = [...(message.all ? [] : events), ...message.lines].sort((a, b) => a.t - b.t).slice(-EVENTS_MAX);
    panels.showEvents(events, t, language);
  },
  path: (message) => trail.begin(message.points),
  notice: (message) => toast(message.text, message.level, message.about),
  taken: (message) => confirm("take_over", `${stateBar.viewerName(message.by, t)} ${t("take_over_from")}`,
    () => send({ k: "take", force: true })),
};
const handle = (message) => HANDLERS[message.k]?.(message);

// --- drawing ----------------------------------------------------------------------------------

const newest = () => (lost() ? null : fast);

/** What the state bar and the header show; `fast` is null without a connection. */
const view = () => ({
  fast: newest(), t, language, robot: shown(), isDriver: isDriver(), viewer: hello?.id,
  keepsAlive: !!hello?.keepalive, watching: Object.keys(slow?.viewers ?? {}).length,
});

function draw() {
  requestAnimationFrame(draw);
  const number = lost() ? "lost" : fast.n;
  if (number === drawn) return;
  drawn = number;
  document.body.classList.toggle("stale", lost());
  stateBar.show(view());
  driving.show(isDriver(), newest());
  notices.place();
  driving.showGear(lost() ? 1 : fast.driver.gear, isDriver());
  if (lost()) return;
  sonarView.draw(fast, t);
  panels.showCauses(fast.safety, t, language);
  trail.draw(fast.pose);
  charts.draw(t);
}

function showRobots() {
  const names = Object.keys(slow.robots);
  const list = $("robots");
  const wanted = names.map((name) => `${slow.robots[name] ? "●" : "○"} ${name}`);
  if ([...list.options].map((it) => it.text).join() !== wanted.join()) {
    list.replaceChildren(...names.map((name, i) => new Option(wanted[i], name)));
  }
  if (hello && document.activeElement !== list) list.value = hello.robot;
}

// --- language, commands ------------------------------------------------------------------

function showTexts() {
  document.documentElement.lang = language;
  for (const it of document.querySelectorAll("[data-t]")) it.textContent = t(it.dataset.t);
  for (const it of document.querySelectorAll("[data-t-placeholder]")) it.placeholder = t(it.dataset.tPlaceholder);
  for (const it of document.querySelectorAll("[data-t-title]")) it.title = t(it.dataset.tTitle);
  if (slow) panels.showSlow(slow, t);
  panels.showEvents(events, t, language);
  drawn = -1;
}

function stop() {
  driving.letGo();
  estop.request();
}

function reset() {
  if (!isDriver()) toast(fast?.driver.may === false ? "view_only_why" : "take_first");
  else if (stateBar.resetRefusal(newest())) toast(stateBar.resetRefusal(newest()), "warning");
  else send({ k: "reset", n: seen() });
}

// The drawn snapshot: each command names the snapshot that the operator saw.
const seen = () => (typeof drawn === "number" && drawn >= 0 ? drawn : 0);

function lamp() {
  const value = (name) => Number($(`lamp-${name}`).value);
  send({ k: "lamp", to: {
    channel: value("channel"), mode: value("mode"), on_lightness: value("lightness"),
    on_time: value("on_time"), off_time: value("off_time"), speed: value("speed_unit"),
  } });
}

function toggle(name) {
  const on = slow?.switches?.[name] === true;
  const apply = () => send({ k: "switch", to: { [name]: !on }, n: seen() });
  if (on) confirm(name, t("switch_off"), apply);
  else apply();
}

function begin() {
  texts = JSON.parse($("texts").textContent);
  phrases.begin(JSON.parse($("phrases").textContent));
  const on = (id, call) => { $(id).onclick = call; };
  on("estop", stop);
  on("lamp", lamp);
  on("take", () => send({ k: "take", force: false }));
  on("leave", () => { driving.letGo(); send({ k: "leave" }); });
  on("reset", reset);
  theme.begin(() => { drawn = -1; });
  $("language").onclick = () => {
    language = language === "en" ? "zh" : "en";
    localStorage.setItem("t2.language", language);
    showTexts();
  };
  $("name").value = stored("name", "");
  $("name").onchange = () => { localStorage.setItem("t2.name", $("name").value); look(); };
  $("robots").onchange = () => { localStorage.setItem("t2.robot", $("robots").value); $("robots").blur(); choose($("robots").value); };
  for (const name of ["ultrasonic_brake", "bumper_brake"]) $(name).onclick = () => toggle(name);
  notices.begin({ t, language: () => language });
  driving.begin({ send, estop: stop, reset, toast, t, language: () => language, gears: () => hello?.gears ?? [] });
  estop.begin({ send, lost, toast, robot: shown, mayDrive: () => fast?.driver.may !== false });
  slots.begin({ t, robot: shown, isDriver });
  trail.begin([]);
  trail.listen();
  showTexts();
  connect();
  draw();
}

begin();
