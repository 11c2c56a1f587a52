// Input of the driver: stick, keystrokes, gamepad, release. Only held controls drive. Every loss of
// input lets go of them: blur, another tab, a lost socket, a lost touch, a lost gamepad. A hold is sent only
// as the answer to a snapshot, with the heartbeat of safety that it answers (camera.js), which bounds its age.
import * as gamepads from "./gamepad.js";
import { joined, t } from "./i18n.js";
import { duration } from "./panels.js";
import { isUsedUp, nextStep, resetRefusal } from "./state_bar.js";

const KEYSTROKES = {
  KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0],
  KeyA: [0, 1], ArrowLeft: [0, 1], KeyD: [0, -1], ArrowRight: [0, -1],
};
const RELEASE_KEYSTROKES = { KeyF: "forward", KeyB: "backward" };
const REPEATS_MS = 1000; // without a repeat of a keystroke that repeated: the system has lost the key-up
const $ = (id) => document.getElementById(id);
const down = new Set();
let page = null;
let stick = null; // { pointer, push }
let releasing = null; // "forward" or "backward": off a pressed bumper
let release = null; // safety's report on it, during a contact
let mustReset = false; // another cause is latched beside the contact: safety refuses a release
let driving = false; // whether this viewer has the driver lock
let another = null; // another source that drives
let barred = ""; // why this page may not drive
let refused = null; // { code, reason }: a held keystroke, and why it is refused
let pad = { push: null, state: "" }; // what the gamepads say
let repeats = null; // { code, at }: the held keystroke that repeats, and its last repeat
let isHeld = false; // a control, at the last snapshot
let sent = false; // whether the server has a hold from here

const clamped = (value) => Math.max(-1, Math.min(1, value));

function held() {
  if (document.hidden) return null; // a gamepad sends to hidden pages, too
  if (releasing) return { x: 0, y: 0, release: releasing };
  if (stick) return { x: stick.push[0], y: stick.push[1] };
  if (down.size) {
    const pushes = [...down].map((code) => KEYSTROKES[code]);
    return { x: clamped(pushes.reduce((sum, it) => sum + it[0], 0)), y: clamped(pushes.reduce((sum, it) => sum + it[1], 0)) };
  }
  return pad.push;
}

function readGamepads() {
  if (!driving) gamepads.drop();
  pad = gamepads.read(gamepads.connected(), performance.now());
  write("gamepad", pad.name && t(pad.isUsable ? "gamepad" : "gamepad_unusable", pad.name));
}

export function answer(echo, isDriver, hold, safety) {
  release = safety?.release ?? null;
  mustReset = safety?.latched.some((it) => it !== "contact") ?? false;
  // The bumper was pressed during the release: this direction is forbidden.
  if ((driving && !isDriver) || (releasing && refusal(releasing))) letGo();
  driving = isDriver;
  readGamepads();
  if (!driving) return;
  if (repeats && performance.now() - repeats.at > REPEATS_MS) letGo(); // its key-up was lost
  const controls = held();
  isHeld = !!controls;
  if (controls) sent = page.send({ k: "hold", echo, ...controls });
  // After a lapse the server requires that the controls are let go before the next hold.
  else if (sent || hold !== "free") free();
}

function free() {
  sent = false;
  page.send({ k: "free" });
}

export function letGo() {
  down.clear();
  stick = null;
  releasing = refused = repeats = null;
  gamepads.drop();
  isHeld = false;
  if (driving) free();
  knob(0, 0);
}

function knob(x, y) {
  const it = $("knob");
  if (it) it.style.transform = `translate(calc(-50% + ${-y * 78}%), calc(-50% + ${-x * 78}%))`;
}

/** Return why this page may not drive, as the name of a text; empty if it may, or if that is unknown. */
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
  write("view-only", barred && t(barred));
  $("estop").classList.toggle("unable", barred === "view_only_stop");
  panel.dataset.hold = hold;
  panel.dataset.pad = isDriver ? pad.state : "";
  write("hold", holdText(isDriver, driver, !!fast?.safety?.latched.length || !!fast?.root.part));
  disable($("leave"), !isDriver);
  const off = !fast || !!fast.root.part; // nothing can drive
  disable($("take"), isDriver || off);
  disable($("reset"), !isDriver || !!noReset);
  $("reset").title = noReset ? t(noReset) : "";
  $("stick").classList.toggle("disabled", off);
  $("reset").classList.toggle("due", next === "reset");
  $("release").classList.toggle("due", next === "release" || next === "by_hand");
  showRelease(isDriver, releasing ? fast?.safety?.release_refusal : null);
}

function holdText(isDriver, driver, isStopped) {
  if (isDriver && driver.overruled) return t("hold.overruled");
  if (refused) return t(refused.reason);
  if (!isDriver) return "";
  const late = lateText(driver);
  if (late) return late;
  if (pad.state) return t(`hold.${pad.state}`);
  if (driver.hold === "held" && isStopped && !releasing) return t("hold.stopped");
  return t(driver.hold === "free" && isHeld ? "hold.waiting" : `hold.${driver.hold}`);
}

// Why a hold is too late for the robot, by the picture or by the link; empty if it is not.
function lateText(driver) {
  const noPicture = page.picture();
  if (noPicture) return noPicture;
  const { delay, limit } = page.delay();
  const isSlow = driver.hold !== "held" && (isHeld || driver.hold === "lapsed") && delay > limit;
  return isSlow ? t("hold.slow", delay.toFixed(2), limit.toFixed(2)) : "";
}

/** Return why what the driver holds moves nothing; empty if nothing is held, or if it is not known. */
export const withoutEffect = (driver) => (isHeld && driver.hold !== "held" ? lateText(driver) : "");

// Why safety refuses a release in this direction now, as the name of a text; empty if it does not.
function refusal(direction) {
  if (!release) return "release.no_contact";
  if (isUsedUp(release)) return "next.by_hand";
  if (release.forbidden.includes(direction)) return `release.forbidden_${direction}`;
  return mustReset ? "next.reset_first" : "";
}

function showRelease(isDriver, answer) {
  $("release").hidden = !release;
  const reasons = new Set([t(answer)]);
  for (const direction of ["forward", "backward"]) {
    const refused = refusal(direction);
    if (refused) reasons.add(t(refused));
    const it = $(`release-${direction}`);
    disable(it, !isDriver || !!refused);
    it.title = refused ? t(refused) : "";
    it.classList.toggle("free", release?.believed_free === direction);
  }
  if (!release) return;
  write("release-free", isUsedUp(release) ? "" : believed());
  write("release-left", t("release_left", metres(release.left)));
  write("release-forbidden", joined([...reasons]));
}

// The direction that safety believes free, with the last motion, its distance and its age.
function believed() {
  const { believed_free: free, travelled, age } = release;
  if (!free) return t("release_unknown");
  return t(`believed_${free}`, metres(Math.abs(travelled)), duration(age));
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

function refuse(code, reason) {
  page.toast(reason, "warning");
  if (code) refused = { code, reason };
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
    return [gamepads.shaped(x), gamepads.shaped(y)];
  };
  it.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    if (stick || event.button > 0 || !ready()) return;
    it.setPointerCapture(event.pointerId);
    stick = { pointer: event.pointerId, push: pushed(event) };
  });
  it.addEventListener("pointermove", (event) => {
    if (stick?.pointer !== event.pointerId) return;
    if (event.buttons) stick.push = pushed(event);
    else letGo(); // the end of the press was lost
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    it.addEventListener(end, (event) => { if (stick?.pointer === event.pointerId) letGo(); });
  }
  it.addEventListener("contextmenu", (event) => event.preventDefault());
}

// Two directions at once let go.
function holdRelease(direction, code = "") {
  if (!ready(code)) return;
  const reason = refusal(direction);
  if (reason) refuse(code, reason);
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

// The place of a keystroke, whatever the layout; by its letter where no place is reported.
function placeOf(event) {
  const letter = (event.key ?? "").normalize("NFKC"); // a form that is filled in sends none
  if (event.code) return event.code;
  if (letter === " ") return "Space";
  if (/^[a-z]$/i.test(letter)) return `Key${letter.toUpperCase()}`;
  return /^[1-5]$/.test(letter) ? `Digit${letter}` : letter;
}

// A keystroke of another script, or of an input method, that means nothing here; any other one is left alone.
const isForeign = (event) => ["Process", "Unidentified", "Dead"].includes(event.key)
  || (event.key.length === 1 && !/[ -~]/.test(event.key.normalize("NFKC")));

function refuseKeystroke(event) {
  if (event.repeat || !event.key) return;
  if (isForeign(event)) page.toast("keystroke_foreign", "warning");
  else if (event.key.length === 1) page.toast(t("keystroke_unknown", event.key), "warning");
}

function keyDown(event) {
  const place = placeOf(event);
  if (place === "Space" && !typing(event)) {
    event.preventDefault(); // it would press the focused button, too
    event.stopPropagation();
    letGo();
    if ((!driving || another) && !event.repeat) page.toast("space_is_no_estop", "warning");
    return;
  }
  if (typing(event) && ["Enter", "Escape"].includes(event.code) && !event.isComposing) event.target.blur();
  if (modified(event)) letGo();
  if (typing(event) || modified(event) || page.isStopKeystroke(event)) return;
  repeats = event.repeat && down.has(place) ? { code: place, at: performance.now() } : null;
  if (place === "KeyR") {
    if (!event.repeat) page.reset();
  } else if (KEYSTROKES[place]) {
    event.preventDefault();
    // A repeat is no press: after the controls were let go, the key must come up first.
    if (!event.repeat && ready(place)) down.add(place);
  } else if (RELEASE_KEYSTROKES[place]) {
    if (!event.repeat) holdRelease(RELEASE_KEYSTROKES[place], place);
  } else if (/^Digit[1-5]$/.test(place)) page.send({ k: "gear", gear: Number(place.slice(-1)) });
  else refuseKeystroke(event);
}

function keyUp(event) {
  const place = placeOf(event);
  if (place === "Space" && !typing(event)) {
    event.preventDefault();
    event.stopPropagation();
  }
  if (modified(event)) letGo();
  repeats = null;
  if (refused?.code === place) refused = null;
  if (releasing && RELEASE_KEYSTROKES[place] === releasing) letGo();
  if (down.delete(place) && !down.size) letGo();
}

export function begin(given) {
  page = given;
  listenToStick();
  for (const direction of Object.values(RELEASE_KEYSTROKES)) listenToRelease(direction);
  addEventListener("keydown", keyDown, true);
  addEventListener("keyup", keyUp, true);
  for (const name of ["blur", "pagehide", "gamepaddisconnected", "dragstart"]) addEventListener(name, letGo);
  document.addEventListener("freeze", letGo);
  // An open menu swallows the key-up; the stick opens none.
  addEventListener("contextmenu", (event) => { if (!event.defaultPrevented) letGo(); });
  document.addEventListener("visibilitychange", () => { if (document.hidden) letGo(); });
  for (const it of document.querySelectorAll("[data-gear]")) {
    it.onclick = () => page.send({ k: "gear", gear: Number(it.dataset.gear) });
  }
}
