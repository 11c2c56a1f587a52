// The page: WebSocket, messages from the server, commands, and language.
import * as alarm from "./alarm.js";
import * as camera from "./camera.js";
import * as charts from "./charts.js";
import * as delay from "./delay.js";
import * as driving from "./driving.js";
import * as i18n from "./i18n.js";
import { t } from "./i18n.js";
import * as movedButtons from "./moved_buttons.js";
import * as notices from "./notices.js";
import * as panels from "./panels.js";
import * as patrol from "./patrol.js";
import * as sonarView from "./sonar_view.js";
import * as stateBar from "./state_bar.js";
import { store, stored } from "./storage.js";
import * as trail from "./trail.js";
import * as wakeLock from "./wake_lock.js";

const { toast, confirm } = notices;

const LOST_MS = 1000; // without a snapshot
const RETRY_MS = 700;
const ALARM_MS = 200;
const EXPECTED = ["odom", "recorder"]; // services whose absence nothing else shows
const CONGESTED = 2048; // bytes that wait in the browser
const PLOTTED = 2; // snapshots per drawing of trajectory and charts
const $ = (id) => document.getElementById(id);
const estop = window.T2Estop;

let socket = null;
let fast = null; // the newest snapshots
let fastAt = -Infinity;
let slow = null;
const EVENTS_MAX = 200;
let events = [];
let hello = null;
let showChange = () => {}; // that this page shows another robot than before
let drawn; // the drawn snapshot; null without a connection
let drawings = 0;

const lost = () => performance.now() - fastAt > LOST_MS;
const isDriver = () => !!fast && !!hello && fast.driver.id === hello.id && fast.driver.may && !lost();
const name = () => $("name").value.trim();
// An emergency stop goes two ways: with one name it is one event.
const who = () => name() || (hello ? `viewer ${hello.id}` : "");
const take = (force) => send({ k: "take", force, name: name() });
const off = () => lost() || !fast.connected;
const cut = () => !lost() && !fast.connected; // the dashboard is there, without a router
const { robot, router, doctor } = $("page").dataset;
// The heartbeat of safety in a snapshot: its age is the age of what the operator saw.
const echoOf = (snapshot) => snapshot?.safety?.heartbeat ?? 0;
// A hold is sent only while the socket is not congested: a burst of old answers is useless.
const alarmed = () => hello && alarm.update(newest(), performance.now());
const send = (message) => {
  const open = socket?.readyState === WebSocket.OPEN
    && (message.k !== "hold" || socket.bufferedAmount < CONGESTED);
  if (open) socket.send(JSON.stringify(message));
  return open;
};

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live?robot=${robot}`;
  const opened = (socket = new WebSocket(address));
  opened.binaryType = "arraybuffer"; // the pictures
  opened.onmessage = ({ data }) => (typeof data === "string" ? handle(JSON.parse(data)) : camera.receive(data));
  opened.onclose = () => {
    if (opened !== socket) return;
    driving.letGo();
    fastAt = -Infinity;
    setTimeout(reconnect, RETRY_MS);
  };
}

// A restarted dashboard may require a new token: a reload opens its token page.
async function reconnect() {
  const control = new AbortController();
  const timer = setTimeout(() => control.abort(), LOST_MS);
  const response = await fetch("/t2/dashboard.css", { cache: "no-store", signal: control.signal }).catch(() => null);
  clearTimeout(timer);
  if (response?.status === 401 && !estop.isOpen()) location.reload(); // a stop that is open offers it
  else connect();
}

const HANDLERS = {
  hello(message) {
    hello = message;
    delay.begin();
    patrol.forget();
    camera.forget();
    events = [];
    sonarView.build(message.vehicle);
    trail.size(message.vehicle);
    trail.lay(message.floor_plan);
  },
  fast(message) {
    if (!hello) return;
    fast = message;
    fastAt = performance.now();
    if (!document.hidden) { // a hidden page, or one without a socket, is not alive
      const at = delay.ask(fastAt);
      if (at !== null) send({ k: "alive", echo: echoOf(fast), at });
    }
    driving.answer(camera.echo(echoOf(fast)), isDriver(), message.driver.hold, message.safety);
    estop.update(message.safety);
    alarmed();
    charts.add(message, fastAt);
    trail.add(message);
  },
  alive: (message) => delay.answered(message, performance.now()),
  slow(message) {
    slow = message;
    panels.showSlow(message);
    trail.locate(message.map);
    patrol.show(message.patrol);
    camera.list(message.cameras);
    showRobots();
  },
  events(message) {
    events = [...(message.all ? [] : events), ...message.lines].slice(-EVENTS_MAX); // in the order of their arrival
    panels.showEvents(events);
  },
  routes: (message) => patrol.list(message),
  route: (message) => patrol.route(message),
  notice: (message) => toast(message.text, message.level),
  taken: () => confirm("take_over", t("take_over_from", stateBar.driverName(fast)),
    () => take(true)),
};
const handle = (message) => HANDLERS[message.k]?.(message);

// --- drawing ----------------------------------------------------------------------------------

const delayNow = () => ({ delay: delay.now(performance.now()), limit: hello?.hold_s ?? 0 });
const newest = () => (lost() ? null : fast);

/** What the state bar and the header show; `fast` is null without a connection. */
const view = () => ({
  fast: newest(), robot, router, doctor, isDriver: isDriver(), viewer: hello?.id,
  ...delayNow(), keepsAlive: !!hello?.keepalive, viewers: slow?.viewers ?? 0,
  withoutEffect: isDriver() ? driving.withoutEffect(fast.driver) : "",
  missing: slow ? EXPECTED.filter((name) => !slow.instances[name]) : [],
});

function draw() {
  requestAnimationFrame(draw);
  camera.show(isDriver() && !off(), newest()?.driver);
  if (newest() === drawn) return;
  drawn = newest();
  document.body.classList.toggle("stale", off());
  stateBar.show(view());
  driving.show(isDriver(), newest());
  patrol.enable(isDriver() && !off(), driving.viewOnly(newest()));
  notices.place();
  $("awake").hidden = !wakeLock.update(isDriver() || (!!hello?.keepalive && newest()?.keeper === hello.id));
  driving.showGear(lost() ? 1 : fast.driver.gear, isDriver());
  if (lost()) return;
  sonarView.draw(fast);
  panels.showCauses(fast);
  drawings += 1;
  if (drawings % PLOTTED) return;
  trail.draw(fast.pose);
  charts.draw();
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
  document.documentElement.lang = i18n.language;
  for (const it of document.querySelectorAll("[data-t]")) it.textContent = t(it.dataset.t);
  showChange();
  if (slow) {
    panels.showSlow(slow);
    patrol.show(slow.patrol);
  }
  panels.showEvents(events);
  drawn = undefined;
}

function reset() {
  if (!isDriver()) toast(driving.viewOnly(fast) || "take_first");
  else if (stateBar.resetRefusal(newest())) toast(stateBar.resetRefusal(newest()), "warning");
  else if (delayNow().delay > hello.call_s) {
    toast(t("hold.slow", delayNow().delay.toFixed(2), hello.call_s.toFixed(2)), "warning"); // safety refuses it
  } else send({ k: "reset", echo: echoOf(drawn), name: name() });
}

// The robot belongs to this page: a reload keeps it, and a change is never silent.
function showRobot() {
  const before = stored("robot", robot, "sessionStorage");
  store("robot", robot, "sessionStorage");
  const address = new URL(location.href);
  address.searchParams.set("robot", robot);
  history.replaceState(null, "", address);
  if (before === robot) return;
  $("robot-changed").hidden = false;
  $("robot-changed").onclick = () => { $("robot-changed").hidden = true; };
  showChange = () => { $("robot-changed-text").textContent = t("robot_changed", robot, before); };
}

function begin() {
  i18n.begin(stored("language", ""));
  const on = (id, call) => { $(id).onclick = call; };
  $("name").value = stored("name", "");
  $("name").onchange = () => {
    store("name", name());
    if (isDriver()) take(false);
  };
  on("take", () => take(false));
  on("leave", () => { driving.letGo(); send({ k: "leave" }); });
  on("reset", reset);
  $("language").onclick = () => {
    store("language", i18n.change());
    showTexts();
  };
  notices.begin();
  alarm.begin($("sound"), stored("sound", "on"), (value) => store("sound", value));
  setInterval(alarmed, ALARM_MS);
  movedButtons.begin(() => toast("buttons_moved", "warning"));
  driving.begin({ send, reset, toast, isStopKeystroke: estop.isKeystroke, delay: delayNow, picture: camera.refusal, gears: () => hello?.gears ?? [] });
  const stopToast = (text) => toast(text, text === "estop_asked" ? "warning" : "error");
  estop.begin({ send, off, cut, toast: stopToast, name: who, t, pressed: driving.letGo, barred: () => driving.viewOnly(fast) });
  camera.begin({ send, delay: delayNow, setSight: (value) => send({ k: "sight", in_sight: value, name: name() }) });
  trail.begin();
  patrol.begin({ send, toast, confirm, name, echo: () => echoOf(drawn), draw: trail.follow });
  showRobot();
  showTexts();
  connect();
  draw();
}

begin();
