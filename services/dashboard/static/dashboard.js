// The page's life: the socket, what it brings, and the words around it.
import * as around from "./around.js";
import * as charts from "./charts.js";
import * as hands from "./hands.js";
import * as lists from "./lists.js";
import * as stop from "./stop.js";
import * as trail from "./trail.js";

const LOST_MS = 1000; // without a picture
const RETRY_MS = 700;
const CONGESTED = 2048; // bytes that wait in the browser
const NOT_A_WORD = 1003; // with which the server closes
const TONES = { run: "clear", slow: "slow", stop: "stop", brake: "stop", inhibited: "stop" };
const QUIET = ["no_request", "neutral"]; // causes of a vehicle that is merely parked
const $ = (id) => document.getElementById(id);
const stored = (key, otherwise) => localStorage.getItem(`t2.${key}`) ?? otherwise;

let texts = {};
let language = stored("language", navigator.language.startsWith("zh") ? "zh" : "en");
let socket = null;
let now = null;
let nowAt = -Infinity;
let rest = null;
let events = [];
let hello = null;
let robot = null; // that was chosen; the remembered one only while it is alive
let drawn = -1;

const t = (key) => texts[language][key] ?? key;
const lost = () => performance.now() - nowAt > LOST_MS;
const mine = () => !!now && !!hello && now.hands.id === hello.id && !lost();
const shown = () => hello?.robot ?? robot ?? $("page").dataset.robot;
// What is held is sent only while the socket takes it: a burst of old answers is useless.
const send = (word) => {
  const open = socket?.readyState === WebSocket.OPEN && (word.k !== "hold" || socket.bufferedAmount < CONGESTED);
  if (open) socket.send(JSON.stringify(word));
  return open;
};

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
  const fresh = (socket = new WebSocket(address));
  fresh.onopen = look;
  fresh.onmessage = (event) => take(JSON.parse(event.data));
  fresh.onclose = (event) => {
    if (fresh !== socket) return;
    hands.letGo();
    nowAt = -Infinity;
    if (event.code === NOT_A_WORD) forget();
    setTimeout(again, RETRY_MS);
  };
}

// A dashboard that began anew may want a new token: only its door can ask for that.
async function again() {
  const door = await fetch("/t2/dashboard.css", { cache: "no-store", signal: AbortSignal.timeout(LOST_MS) })
    .catch(() => null);
  if (door?.status === 401) location.reload();
  else connect();
}

// What was remembered made no word: it would be refused again and again.
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

// Once: later on, nobody but the viewer may change what is looked at.
function recall() {
  const remembered = stored("robot", null);
  choose(rest.robots[remembered] && !mine() ? remembered : $("page").dataset.robot);
}

const TAKERS = {
  hello(word) {
    hello = word;
    around.build(word.vehicle);
    trail.size(word.vehicle);
  },
  now(word) {
    if (!hello) return;
    now = word;
    nowAt = performance.now();
    hands.answer(word.n, mine(), word.hands.grip, word.safety);
    stop.saw(word.safety);
    charts.add(word, nowAt);
    trail.add(word);
  },
  rest(word) {
    rest = word;
    if (robot === null && hello) recall();
    lists.showRest(word, t);
    showRobots();
  },
  events(word) {
    events = word.lines;
    lists.showEvents(events, t);
  },
  path: (word) => trail.begin(word.points),
  told: (word) => toast(word.text, word.level),
  ask: (word) => confirm("take_over", `${called(word.who)} ${t("take_over_from")}`,
    () => send({ k: "take", force: true })),
};
const take = (word) => TAKERS[word.k]?.(word);

// --- what is always on the screen ---------------------------------------------------------------

function draw() {
  requestAnimationFrame(draw);
  const stamp = lost() ? "lost" : now.n;
  if (stamp === drawn) return;
  drawn = stamp;
  document.body.classList.toggle("stale", lost());
  showState();
  showHead();
  hands.show(mine(), lost() ? "free" : now.hands.grip);
  hands.showGear(lost() ? 1 : now.hands.gear, mine());
  if (lost()) return;
  around.draw(now, t);
  lists.showWhy(now.safety, t);
  trail.draw(now.pose);
  charts.draw(t);
}

function showState() {
  const safety = lost() ? null : now.safety;
  const worst = safety?.causes[0];
  const verdict = lost() ? "lost" : safety?.verdict ?? "none";
  const quiet = verdict === "stop" && QUIET.includes(worst?.name);
  set("verdict", t(`verdict.${verdict}`));
  $("state").dataset.tone = quiet ? "idle" : TONES[verdict] ?? "stop";
  $("state").dataset.verdict = verdict;
  set("sentence", lost() ? t("text.lost") : safety ? sentence(safety, worst)
    : t(now.connected ? "text.none" : "text.no_router"));
  const own = safety && language !== "en" && worst ? worst.text : "";
  const how = safety?.latched.length && !mine() ? t("take_to_reset") : "";
  set("detail", `${own} ${how}`.trim());
  set("speed", lost() || !now.measured ? "–" : now.measured[0].toFixed(2));
  set("turn", lost() || !now.measured ? "–" : now.measured[1].toFixed(2));
  $("reset").classList.toggle("due", !!safety?.latched.length);
}

function sentence(safety, worst) {
  if (language === "en") return safety.text;
  if (!worst) return t("text.run");
  const key = `cause.${worst.name}`;
  return (t(key) === key ? worst.text : t(key)) + (safety.latched.includes(worst.name) ? t("reset_due") : "");
}

function showHead() {
  const off = lost();
  chip("link", off ? "" : t(`link.${now.link ?? "none"}`), now?.link === "up" ? "clear" : "stop");
  chip("bumper", off ? "" : t(`bumper.${now.bumper ?? "none"}`), now?.bumper === false ? "clear" : "stop");
  chip("driver", off ? "" : driver(), mine() ? "clear" : "slow");
  const count = Object.keys(rest?.viewers ?? {}).length;
  chip("watching", off || !count ? "" : `${count} ${t("watching")}`);
}

// Who gave no name has a number.
const called = (name) => (/^\d*$/.test(name) ? `${t("viewer")} ${name}`.trim() : name);

function driver() {
  if (mine()) return t("you_drive");
  const { id, name } = now.hands;
  if (id) return `${called(name)} ${t("drives")}`;
  const source = now.safety?.source;
  return source ? `${source} ${t("drives")}` : t("nobody_drives");
}

function chip(id, text, tone = "") {
  set(id, text);
  $(id).dataset.tone = tone;
}

function set(id, text) {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
}

function showRobots() {
  const names = Object.keys(rest.robots);
  const list = $("robots");
  const wanted = names.map((name) => `${rest.robots[name] ? "●" : "○"} ${name}`);
  if ([...list.options].map((it) => it.text).join() !== wanted.join()) {
    list.replaceChildren(...names.map((name, i) => new Option(wanted[i], name)));
  }
  if (hello && document.activeElement !== list) list.value = hello.robot;
}

// --- words, looks, questions --------------------------------------------------------------------

function speak() {
  document.documentElement.lang = language;
  for (const it of document.querySelectorAll("[data-t]")) it.textContent = t(it.dataset.t);
  for (const it of document.querySelectorAll("[data-t-placeholder]")) it.placeholder = t(it.dataset.tPlaceholder);
  for (const it of document.querySelectorAll("[data-t-title]")) it.title = t(it.dataset.tTitle);
  if (rest) lists.showRest(rest, t);
  lists.showEvents(events, t);
  drawn = -1;
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("t2.theme", name);
  drawn = -1;
}

function toast(text, level = "info") {
  const it = document.createElement("div");
  it.dataset.level = level;
  it.textContent = t(text);
  for (const old of [...$("toasts").children]) if (old.textContent === it.textContent) old.remove();
  $("toasts").append(it);
  setTimeout(() => it.remove(), level === "error" ? 20000 : 5000);
}

// Never modal: the emergency stop stays one tap away.
function confirm(title, text, yes) {
  set("question-title", t(title));
  set("question-text", text);
  $("question").show();
  $("question-yes").onclick = () => { $("question").close(); yes(); };
  $("question-no").onclick = () => $("question").close();
}

function estop() {
  hands.letGo();
  stop.ask();
}

// The picture on the screen: each command names the picture that the operator saw.
const seen = () => (typeof drawn === "number" && drawn >= 0 ? drawn : 0);

function lamp() {
  const value = (name) => Number($(`lamp-${name}`).value);
  send({ k: "lamp", to: {
    channel: value("channel"), mode: value("mode"), on_lightness: value("lightness"),
    on_time: value("on_time"), off_time: value("off_time"), speed: value("speed_unit"),
  } });
}

function toggle(name) {
  const on = rest?.switches?.[name] === true;
  const ask = () => send({ k: "switch", to: { [name]: !on }, n: seen() });
  if (on) confirm(name, t("switch_off"), ask);
  else ask();
}

function begin() {
  texts = JSON.parse($("texts").textContent);
  const on = (id, call) => { $(id).onclick = call; };
  on("estop", estop);
  on("lamp", lamp);
  on("take", () => send({ k: "take", force: false }));
  on("leave", () => { hands.letGo(); send({ k: "leave" }); });
  on("reset", () => send({ k: "reset", n: seen() }));
  const light = matchMedia("(prefers-color-scheme: light)").matches;
  theme(stored("theme", light ? "light" : "dark"));
  $("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  $("language").onclick = () => {
    language = language === "en" ? "zh" : "en";
    localStorage.setItem("t2.language", language);
    speak();
  };
  $("name").value = stored("name", "");
  $("name").onchange = () => { localStorage.setItem("t2.name", $("name").value); look(); };
  $("robots").onchange = () => { localStorage.setItem("t2.robot", $("robots").value); $("robots").blur(); choose($("robots").value); };
  for (const name of ["ultrasonic_brake", "bumper_brake"]) $(name).onclick = () => toggle(name);
  hands.begin({ send, estop, toast, t, gears: () => hello?.gears ?? [] });
  stop.begin({ send, lost, toast, robot: shown });
  trail.begin([]);
  trail.listen();
  speak();
  connect();
  draw();
}

begin();
