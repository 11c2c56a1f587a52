// The page: WebSocket, messages from the server, commands, and language.
import * as charts from "./charts.js";
import * as driving from "./driving.js";
import * as estop from "./estop.js";
import * as notices from "./notices.js";
import * as phrases from "./phrases.js";
import * as panels from "./panels.js";
import * as sonarView from "./sonar_view.js";
import * as stateBar from "./state_bar.js";
import * as trail from "./trail.js";

const { toast, confirm } = notices;

const LOST_MS = 1000; // without a snapshot
const RETRY_MS = 700;
const CONGESTED = 2048; // bytes that wait in the browser
const $ = (id) => document.getElementById(id);
const stored = (key, otherwise) => localStorage.getItem(`t2.${key}`) ?? otherwise;

let texts = {};
let language = stored("language", navigator.language.startsWith("zh") ? "zh" : "en");
let socket = null;
let fast = null; // the newest snapshots
let fastAt = -Infinity;
let aliveEcho = -2; // the heartbeat that was last answered with a sign of life
let slow = null;
const EVENTS_MAX = 80;
let events = [];
let hello = null;
let drawn; // the drawn snapshot; null without a connection

// A text of the catalogue; values take the places of its `{}`.
const t = (key, ...values) => values.reduce((text, it) => text.replace("{}", () => it), texts[language][key] ?? key);
const lost = () => performance.now() - fastAt > LOST_MS;
const isDriver = () => !!fast && !!hello && fast.driver.id === hello.id && fast.driver.may && !lost();
const name = () => $("name").value.trim();
const off = () => lost() || !fast.connected;
const { robot, router, doctor } = $("page").dataset;
// The heartbeat of safety in a snapshot: its age is the age of what the operator saw.
const echoOf = (snapshot) => snapshot?.safety?.heartbeat ?? 0;
// A hold is sent only while the socket is not congested: a burst of old answers is useless.
const send = (message) => {
  const open = socket?.readyState === WebSocket.OPEN
    && (message.k !== "hold" || socket.bufferedAmount < CONGESTED);
  if (open) socket.send(JSON.stringify(message));
  return open;
};

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live?robot=${robot}`;
  const opened = (socket = new WebSocket(address));
  opened.onmessage = (event) => handle(JSON.parse(event.data));
  opened.onclose = () => {
    if (opened !== socket) return;
    driving.letGo();
    fastAt = -Infinity;
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

const HANDLERS = {
  hello(message) {
    hello = message;
    events = [];
    sonarView.build(message.vehicle);
    trail.size(message.vehicle);
  },
  fast(message) {
    if (!hello) return;
    fast = message;
    fastAt = performance.now();
    // At most 10 a second. A hidden page, or one without a socket, is not alive.
    if (hello.keepalive && !document.hidden && Math.abs(echoOf(fast) - aliveEcho) >= 2) {
      aliveEcho = echoOf(fast);
      send({ k: "alive", echo: aliveEcho });
    }
    driving.answer(echoOf(fast), isDriver(), message.driver.hold, message.safety);
    estop.update(message.safety);
    charts.add(message, fastAt);
    trail.add(message);
  },
  slow(message) {
    slow = message;
    panels.showSlow(message, t);
    showRobots();
  },
  events(message) {
    events = [...events, ...message.lines].sort((a, b) => a.t - b.t).slice(-EVENTS_MAX);
    panels.showEvents(events, t, language);
  },
  notice: (message) => toast(message.text, message.level, message.about),
  taken: () => confirm("take_over", t("take_over_from", stateBar.driverName(fast, t)),
    () => send({ k: "take", force: true, name: name() })),
};
const handle = (message) => HANDLERS[message.k]?.(message);

// --- drawing ----------------------------------------------------------------------------------

const newest = () => (lost() ? null : fast);

/** What the state bar and the header show; `fast` is null without a connection. */
const view = () => ({
  fast: newest(), t, language, robot, router, doctor, isDriver: isDriver(), viewer: hello?.id,
  keepsAlive: !!hello?.keepalive, viewers: slow?.viewers ?? 0,
});

function draw() {
  requestAnimationFrame(draw);
  if (newest() === drawn) return;
  drawn = newest();
  document.body.classList.toggle("stale", off());
  stateBar.show(view());
  driving.show(isDriver(), newest());
  notices.place();
  driving.showGear(lost() ? 1 : fast.driver.gear, isDriver());
  if (lost()) return;
  sonarView.draw(fast, t);
  panels.showCauses(fast, t, language);
  trail.draw(fast.pose);
  charts.draw(t);
}

// The page of another robot is another page: a link.
function showRobots() {
  const names = Object.keys(slow.robots).sort();
  const stamp = JSON.stringify(slow.robots);
  if ($("robots").dataset.stamp === stamp) return;
  $("robots").dataset.stamp = stamp;
  $("robots").querySelector("nav").replaceChildren(...names.map((name) => {
    const link = document.createElement("a");
    Object.assign(link, { href: `/?robot=${name}`, textContent: `${slow.robots[name] ? "●" : "○"} ${name}` });
    return link;
  }));
}

// --- language, commands ------------------------------------------------------------------

function showTexts() {
  document.documentElement.lang = language;
  for (const it of document.querySelectorAll("[data-t]")) it.textContent = t(it.dataset.t);
  if (slow) panels.showSlow(slow, t);
  panels.showEvents(events, t, language);
  drawn = undefined;
}

function stop() {
  driving.letGo();
  estop.request();
}

function reset() {
  if (!isDriver()) toast(driving.viewOnly(fast) || "take_first");
  else if (stateBar.resetRefusal(newest())) toast(stateBar.resetRefusal(newest()), "warning");
  else send({ k: "reset", echo: echoOf(drawn), name: name() });
}

function showCamera(url) {
  if (!url) return;
  const [image, note] = $("camera").querySelectorAll("img, p");
  $("camera").hidden = false;
  image.onerror = () => { image.hidden = true; note.hidden = false; };
  image.src = url;
}

function begin() {
  texts = JSON.parse($("texts").textContent);
  phrases.begin(JSON.parse($("phrases").textContent));
  const on = (id, call) => { $(id).onclick = call; };
  on("estop", stop);
  $("name").value = stored("name", "");
  $("name").onchange = () => localStorage.setItem("t2.name", name());
  on("take", () => send({ k: "take", force: false, name: name() }));
  on("leave", () => { driving.letGo(); send({ k: "leave" }); });
  on("reset", reset);
  $("language").onclick = () => {
    language = language === "en" ? "zh" : "en";
    localStorage.setItem("t2.language", language);
    showTexts();
  };
  notices.begin({ t, language: () => language });
  driving.begin({ send, estop: stop, reset, toast, t, language: () => language, gears: () => hello?.gears ?? [] });
  estop.begin({ send, off, toast, robot, name, barred: () => driving.viewOnly(fast) });
  showCamera($("page").dataset.camera.replaceAll("{robot}", robot));
  trail.begin();
  showTexts();
  connect();
  draw();
}

begin();
