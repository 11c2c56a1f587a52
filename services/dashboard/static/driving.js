// Input of the driver: stick, keys, gamepad, release. Only held controls drive. Every loss of input
// releases them: blur, another tab, a lost socket, a lost touch, a lost gamepad. A hold is sent only
// as the answer to a snapshot, with its heartbeat of safety, which bounds the age of the hold.
import { gap, translated } from "./phrases.js";
import { duration } from "./panels.js";
import { isUsedUp, nextStep, resetRefusal } from "./state_bar.js";

const DEADZONE = 0.12; // of the stick's range
const DEADMAN = 4; // left shoulder, in the browser's standard mapping
const STICKS = { linear: 1, angular: 2 }; // left stick up and down, right stick left and right
const KEYS = {
  KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0],
  KeyA: [0, 1], ArrowLeft: [0, 1], KeyD: [0, -1], ArrowRight: [0, -1],
};
const RELEASE_KEYS = { KeyF: "forward", KeyB: "backward" };
const $ = (id) => document.getElementById(id);
const down = new Set();
const seenUp = new Set(); // gamepads whose deadman was seen up
let page = null;
let stick = null; // { pointer, push }
let releasing = null; // "forward" or "backward": off a pressed bumper
let release = null; // safety's report on it, during a contact
let mustReset = false; // another cause is latched beside the contact: safety refuses a release
let driving = false; // whether this viewer has the driver lock
let another = null; // another source that drives
let barred = ""; // why this page may not drive
let refused = null; // { code, key }: a key that is held, and why it is refused
let sent = false; // whether the server has a hold from here

const shaped = (raw) => {
  if (Math.abs(raw) <= DEADZONE) return 0;
  return Math.sign(raw) * Math.min(1, (Math.abs(raw) - DEADZONE) / (1 - DEADZONE));
};
const clamped = (value) => Math.max(-1, Math.min(1, value));

function held() {
  if (releasing) return { x: 0, y: 0, release: releasing };
  if (stick) return { x: stick.push[0], y: stick.push[1] };
  if (down.size) {
    const pushes = [...down].map((code) => KEYS[code]);
    return { x: clamped(pushes.reduce((sum, it) => sum + it[0], 0)), y: clamped(pushes.reduce((sum, it) => sum + it[1], 0)) };
  }
  return gamepad();
}

// Only the browser's standard mapping defines the axes: on another gamepad a trigger at rest may be
// a full turn. The gamepad whose deadman is pressed counts, if several are connected.
function gamepad() {
  const pads = [...(navigator.getGamepads?.() ?? [])].filter((it) => it?.connected);
  const usable = pads.filter((it) => it.mapping === "standard");
  const pressed = usable.filter((it) => it.buttons[DEADMAN]?.pressed);
  // A deadman that is down when the gamepad is found, or after a release, must be released first.
  for (const it of usable) if (!pressed.includes(it)) seenUp.add(it.index);
  for (const index of seenUp) if (!usable.some((it) => it.index === index)) seenUp.delete(index);
  const pad = pressed.find((it) => seenUp.has(it.index));
  const named = pad ?? usable[0] ?? pads[0];
  const key = usable.length ? "gamepad" : "gamepad_unusable";
  $("gamepad").textContent = named ? page.t(key, named.id) : "";
  if (!pad) return null;
  return { x: shaped(-(pad.axes[STICKS.linear] ?? 0)), y: shaped(-(pad.axes[STICKS.angular] ?? 0)) };
}

export function answer(echo, isDriver, hold, safety) {
  release = safety?.release ?? null;
  mustReset = safety?.latched.some((it) => it !== "contact") ?? false;
  // The bumper was pressed during the release: this direction is forbidden.
  if ((driving && !isDriver) || (releasing && refusal(releasing))) letGo();
  driving = isDriver;
  if (!driving) return;
  const controls = held();
  if (controls) sent = page.send({ k: "hold", echo, ...controls });
  // After a lapse the server requires a release before the next hold.
  else if (sent || hold !== "free") free();
}

function free() {
  sent = false;
  page.send({ k: "free" });
}

export function letGo() {
  down.clear();
  stick = null;
  releasing = refused = null;
  seenUp.clear();
  if (driving) free();
  knob(0, 0);
}

function knob(x, y) {
  const it = $("knob");
  if (it) it.style.transform = `translate(calc(-50% + ${-y * 78}%), calc(-50% + ${-x * 78}%))`;
}

/** Return why this page may not drive, as a key; empty if it may, or if that is unknown. */
export const viewOnly = (fast) => {
  if (fast?.driver.may !== false) return "";
  return fast.driver.may_stop ? "view_only_why" : "view_only_stop";
};

/** Update the driving panel; `fast` is null without a connection. */
export function show(isDriver, fast) {
  const driver = fast?.driver ?? null;
  const next = nextStep(fast);
  const noReset = resetRefusal(fast);
  another = driver?.other ?? null;
  const panel = document.querySelector(".driving");
  const hold = driver?.hold ?? "free";
  panel.classList.toggle("is-driver", isDriver);
  barred = viewOnly(fast);
  panel.classList.toggle("view-only", !!barred);
  write("view-only", barred && page.t(barred));
  $("estop").classList.toggle("unable", barred === "view_only_stop");
  panel.dataset.hold = hold;
  const isLost = isDriver && (driver.overruled || hold === "expired");
  write("hold", refused && !isLost ? page.t(refused.key) : !isDriver ? "" : driver.overruled ? page.t("hold.overruled") : page.t(`hold.${hold}`));
  disable($("leave"), !isDriver);
  const off = !fast || !!fast.root.part; // nothing can drive
  disable($("take"), isDriver || off);
  disable($("reset"), !isDriver || !!noReset);
  $("reset").title = noReset ? page.t(noReset) : "";
  $("stick").classList.toggle("disabled", off);
  $("reset").classList.toggle("due", next === "reset");
  $("release").classList.toggle("due", next === "release" || next === "by_hand");
  showRelease(isDriver, releasing ? fast?.safety?.release_refusal : "");
}

// Why safety refuses a release in this direction now, as a key; empty if it does not.
function refusal(direction) {
  if (!release) return "release_no_contact";
  if (isUsedUp(release)) return "release_by_hand";
  if (release.forbidden.includes(direction)) return `release_forbidden_${direction}`;
  return mustReset ? "release_reset_first" : "";
}

function showRelease(isDriver, answer) {
  $("release").hidden = !release;
  const reasons = new Set(answer ? [translated(answer, page.language())] : []);
  for (const direction of ["forward", "backward"]) {
    const refused = refusal(direction);
    if (refused) reasons.add(page.t(refused));
    const it = $(`release-${direction}`);
    disable(it, !isDriver || !!refused);
    it.title = refused ? page.t(refused) : "";
    it.classList.toggle("free", release?.believed_free === direction);
  }
  if (!release) return;
  write("release-free", isUsedUp(release) ? "" : believed());
  write("release-left", page.t("release_left", metres(release.left)));
  write("release-forbidden", [...reasons].join(gap(page.language())));
}

// The direction that safety believes free, with the last motion, its distance and its age.
function believed() {
  const { believed_free: free, travelled, age } = release;
  if (!free) return page.t("release_unknown");
  return page.t(`believed_${free}`, metres(Math.abs(travelled)), duration(age));
}

const metres = (value) => (Number.isFinite(value) ? `${value.toFixed(2)} m` : "– m");

function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

function disable(button, disabled) {
  if (button.disabled !== disabled) button.disabled = disabled;
  button.classList.toggle("disabled", disabled);
}

export function showGear(gear, isDriver) {
  for (const it of document.querySelectorAll("[data-gear]")) {
    it.classList.toggle("lit", isDriver && Number(it.dataset.gear) === gear);
    it.disabled = !isDriver;
  }
  const top = page.gears()[gear - 1];
  $("top").textContent = top && isDriver ? `${top.toFixed(2)} m/s` : "";
}

// --- input events -----------------------------------------------------------------------------

const ready = (code = "") => {
  if (!driving) refuse(code, barred || "take_first");
  return driving;
};

function refuse(code, key) {
  page.toast(key, "warning");
  if (code) refused = { code, key };
}

function listenToStick() {
  const it = $("stick");
  const pushed = (event) => {
    const box = it.getBoundingClientRect();
    const radius = box.width / 2;
    let x = (box.top + radius - event.clientY) / radius;
    let y = (box.left + radius - event.clientX) / radius;
    const length = Math.hypot(x, y);
    if (length > 1) [x, y] = [x / length, y / length];
    knob(x, y);
    return [shaped(x), shaped(y)];
  };
  it.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    if (stick || event.button > 0 || !ready()) return;
    it.setPointerCapture(event.pointerId);
    stick = { pointer: event.pointerId, push: pushed(event) };
  });
  it.addEventListener("pointermove", (event) => {
    if (stick?.pointer === event.pointerId) stick.push = pushed(event);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    it.addEventListener(end, (event) => { if (stick?.pointer === event.pointerId) letGo(); });
  }
  it.addEventListener("contextmenu", (event) => event.preventDefault());
}

// Two directions at once release.
function holdRelease(direction, code = "") {
  if (!ready(code)) return;
  const key = refusal(direction);
  if (key) refuse(code, key);
  else if (releasing && releasing !== direction) letGo();
  else releasing = direction;
}

function listenToRelease(direction) {
  const it = $(`release-${direction}`);
  it.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    it.setPointerCapture(event.pointerId);
    holdRelease(direction);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    it.addEventListener(end, () => { if (releasing === direction) letGo(); });
  }
  it.addEventListener("contextmenu", (event) => event.preventDefault());
}

// While one of these is held, systems and browsers swallow the key-up of other keys.
const MODIFIERS = ["Meta", "Control", "Alt"];
const modified = (event) =>
  event.ctrlKey || event.altKey || event.metaKey || MODIFIERS.includes(event.key);
const typing = (event) => event.target.matches?.("input");
const spacing = (event) => event.code === "Space" && !typing(event);

function keyDown(event) {
  if (spacing(event)) {
    event.preventDefault(); // it would press the focused button, too
    event.stopPropagation();
    letGo();
    if ((!driving || another) && !event.repeat) page.toast("estop_key", "warning");
  }
  if (typing(event) && ["Enter", "Escape"].includes(event.code)) event.target.blur();
  if (modified(event)) letGo();
  if (typing(event) || modified(event)) return;
  if (event.code === "KeyE" && !event.repeat) page.estop();
  else if (event.code === "KeyR" && !event.repeat) page.reset();
  else if (KEYS[event.code]) {
    event.preventDefault();
    // A repeat is no press: after a release the key must come up first.
    if (!event.repeat && ready(event.code)) down.add(event.code);
  } else if (RELEASE_KEYS[event.code] && !event.repeat) holdRelease(RELEASE_KEYS[event.code], event.code);
  else if (/^Digit[1-5]$/.test(event.code)) page.send({ k: "gear", gear: Number(event.code.at(-1)) });
}

function keyUp(event) {
  if (spacing(event)) {
    event.preventDefault();
    event.stopPropagation();
  }
  if (modified(event)) letGo();
  if (refused?.code === event.code) refused = null;
  if (releasing && RELEASE_KEYS[event.code] === releasing) letGo();
  if (down.delete(event.code) && !down.size) letGo();
}

// On pointerdown: while a finger is on the stick, the tap of another finger makes no click.
function listenToStop() {
  addEventListener("pointerdown", (event) => { if (event.target.closest?.("#estop")) page.estop(); }, true);
}

export function begin(given) {
  page = given;
  listenToStop();
  listenToStick();
  for (const direction of Object.values(RELEASE_KEYS)) listenToRelease(direction);
  addEventListener("keydown", keyDown, true);
  addEventListener("keyup", keyUp, true);
  for (const name of ["blur", "pagehide", "gamepaddisconnected", "dragstart"]) addEventListener(name, letGo);
  // An open menu swallows the key-up; the stick opens none.
  addEventListener("contextmenu", (event) => { if (!event.defaultPrevented) letGo(); });
  document.addEventListener("visibilitychange", () => { if (document.hidden) letGo(); });
  for (const it of document.querySelectorAll("[data-gear]")) {
    it.onclick = () => page.send({ k: "gear", gear: Number(it.dataset.gear) });
  }
}
