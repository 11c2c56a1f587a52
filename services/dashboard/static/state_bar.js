// The state bar and the chips of the header: verdict, reason, speed, connections, driver.
import { joined, t } from "./i18n.js";
import { rootText } from "./panels.js";

const TONES = { run: "clear", slow: "slow", stop: "stop", brake: "stop", inhibited: "stop" };
// Verdicts of the page, not of safety, with their sentences.
const WITHOUT_STATE = { lost: "no_dashboard", none: "root.safety", no_router: "root.router" };
const MOVING = ["run", "slow"];
export const QUIET = ["no_request", "neutral"]; // causes of a parked vehicle
const $ = (id) => document.getElementById(id);

/** Show a view of `dashboard.js`; its `fast` is the newest snapshot, null without a connection. */
export function show(view) {
  showState(view);
  showHead(view);
}

function showState(view) {
  const { fast } = view;
  const safety = fast?.safety;
  const worst = safety?.causes[0];
  const verdict = !fast ? "lost" : !fast.connected ? "no_router" : safety?.verdict ?? "none";
  const quiet = verdict === "stop" && QUIET.includes(worst?.name);
  set("verdict", t(`verdict.${verdict}`));
  const overruler = MOVING.includes(verdict) && view.isDriver ? fast.driver.other : null;
  $("state").dataset.tone = quiet ? "idle" : overruler ? "slow" : TONES[verdict] ?? "stop";
  $("state").dataset.verdict = verdict;
  document.title = `${t(`verdict.${verdict}`)} · ${view.robot} · T2`;
  const known = !(verdict in WITHOUT_STATE);
  const reason = known ? sentence(view) : joined([t("own_switch"), t(WITHOUT_STATE[verdict])]);
  set("sentence", reason);
  set("detail", known ? detail(view, worst) : t(`fault.${verdict}`));
  $("fault").hidden = known;
  if (!known) setText($("fault").lastElementChild, whatNext(view, verdict));
  set("speed", !fast?.measured ? "–" : fast.measured[0].toFixed(2));
  set("turn", !fast?.measured ? "–" : fast.measured[1].toFixed(2));
}

// Which address does not answer, and the command that finds out why.
function whatNext({ fast, router, doctor }, verdict) {
  const address = fast ? router : location.host;
  return joined([t(verdict === "none" ? "router_at" : "no_answer_at", address), t("next_step_at", doctor)]);
}

// The first missing part, who stopped the robot, the other latched causes, and what to do.
function detail({ fast, isDriver, doctor }, worst) {
  const { safety } = fast;
  const root = rootText(fast);
  const others = safety.causes.filter((it) => (root || it !== worst) && safety.latched.includes(it.name));
  return joined([
    root,
    safety.stopped_by ? t(safety.stopped_by) : "",
    others.length ? t("also_latched", joined(others.map((it) => t(it.text)))) : "",
    safety.latched.length && !isDriver && fast.driver.may ? t("take_to_reset") : "",
    root ? t("next_step", doctor) : "",
  ]);
}

/** Return the next step that safety accepts: while the bumper is pressed, a reset clears the other causes only. */
export function nextStep(fast) {
  const safety = fast?.connected ? fast.safety : null;
  if (!safety?.latched.length) return "";
  if (fast.bumper !== true || !safety.release || safety.latched.some((it) => it !== "contact")) return "reset";
  return isUsedUp(safety.release) ? "by_hand" : "release";
}

/** Return whether safety refuses a release in either direction until a reset. */
export const isUsedUp = (release) => release.left <= 0 || release.forbidden.length > 1;

const RESET_REFUSALS = { "": "reset.nothing", release: "next.move_off", by_hand: "next.by_hand" };

/** Return why safety would refuse a reset, as the name of a text; empty if it does not. */
export const resetRefusal = (fast) => (fast?.connected ? RESET_REFUSALS[nextStep(fast)] ?? "" : "call.not_connected");

function sentence({ fast, isDriver, withoutEffect }) {
  if (rootText(fast)) return t("root.may_move");
  if (withoutEffect && QUIET.includes(fast.safety.causes[0]?.name)) return withoutEffect;
  return t(isDriver && !fast.driver.other ? fast.safety.own_text : fast.safety.text);
}

function showHead(view) {
  const { fast, isDriver, viewer, keepsAlive, delay, limit } = view;
  const off = !fast?.connected; // without a router all values are old
  chip("link", off ? "" : t(`link.${fast.root.part === "bridge" ? "missing" : fast.link ?? "none"}`), fast?.link === "up" ? "clear" : "stop");
  chip("bumper", off || rootText(fast) ? "" : t(`bumper.${fast.bumper ?? "none"}`), fast?.bumper === false ? "clear" : "stop");
  chip("driver", off ? "" : driver(view), isDriver && !fast.driver.other ? "clear" : "slow");
  $("delay").hidden = !fast;
  set("delay-value", `${delay.toFixed(2)} s`);
  $("delay").dataset.tone = delay > limit ? "late" : "";
  const keeper = off || !keepsAlive ? "" : fast.keeper === viewer ? "keeps_alive" : "keeps_not_alive";
  chip("keeper", keeper && t(keeper), keeper === "keeps_alive" ? "clear" : "slow");
  const missing = view.missing.map((name) => t(`missing_${name}`)).join(", ");
  chip("missing", off || !fast.safety || !missing ? "" : t("missing", missing));
  chip("watching", off || !view.viewers ? "" : t("watching", view.viewers));
}

/** The viewer that has control, by its name or its number. */
export const driverName = (fast) => fast?.driver.name || t("viewer", fast?.driver.id ?? "");

// The name of a source of requests for people; one that the page does not know is shown as it is.
function sourceName(source) {
  const name = t(`source.${source}`);
  return name.startsWith("source.") ? source : name;
}

function driver(view) {
  const { fast, isDriver } = view;
  const { id, may, other, overruled } = fast.driver;
  if (!may) return t("view_only");
  if (isDriver && overruled) return t("taken_over", sourceName(other));
  if (other) return t("drives", sourceName(other));
  if (isDriver) return t("you_drive");
  if (id) return t("drives", driverName(fast));
  const source = fast.safety?.source;
  return source ? t("drives", sourceName(source)) : t("nobody_drives");
}

function chip(id, text, tone = "") {
  set(id, text);
  $(id).dataset.tone = tone;
}

const set = (id, text) => setText($(id), text);

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
