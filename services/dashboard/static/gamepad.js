// Gamepads. The one whose deadman is pressed drives, while it is alive; the others change nothing.
//
// A gamepad that freezes keeps its last reading for ever. A thumb on a deflected stick is never
// still: the last digits of its axes change many times a second. The axes and buttons count, and not
// the timestamp: some browsers advance it with each poll, others never do.
const DEADZONE = 0.12; // of the stick's range
const DEADMAN = 4; // left shoulder, in the browser's standard mapping
const STICKS = { linear: 1, angular: 2 }; // left stick up and down, right stick left and right
const SILENCE_MS = 2000; // as GAMEPAD_SILENCE_S of teleop
const PROMPT_MS = SILENCE_MS / 2;
let known = new Map(); // by index and id: { reading, changedAt, seenUp, isFrozen, centered }

export const shaped = (raw) => {
  if (!(Math.abs(raw) > DEADZONE)) return 0; // NaN, too
  return Math.sign(raw) * Math.min(1, (Math.abs(raw) - DEADZONE) / (1 - DEADZONE));
};

/** Require that each deadman is seen up before it counts again. */
export function drop() {
  for (const it of known.values()) it.seenUp = false;
}

/** Return the connected gamepads; a browser may have none, or forbid them. */
export function connected() {
  try {
    return Array.from(navigator.getGamepads()).filter((it) => it?.connected);
  } catch {
    return [];
  }
}

/**
 * Return the reading of these gamepads at a time in ms: { push, name, isUsable, state }.
 *
 * `push` is null unless a gamepad drives. `state` is "still" when its stick should move soon, and
 * "frozen" after it did not, until its deadman was up.
 */
export function read(pads, now) {
  // Only the standard mapping defines the axes: elsewhere a trigger at rest may be a full turn.
  const usable = pads.filter((it) => it.mapping === "standard");
  const before = known;
  known = new Map();
  const seen = usable.map((pad) => {
    const slot = `${pad.index} ${pad.id}`;
    const state = update(before.get(slot), pad, now);
    known.set(slot, state);
    return { pad, state };
  });
  const driving = seen.find(({ pad, state }) => isDown(pad) && state.seenUp);
  const frozen = seen.find(({ state }) => state.isFrozen);
  const named = driving?.pad ?? frozen?.pad ?? usable[0] ?? pads[0];
  const isStill = driving && driving.state.isDeflected && now - driving.state.changedAt > PROMPT_MS;
  return {
    push: driving ? driving.state.push : null,
    name: named?.id ?? "",
    isUsable: usable.length > 0,
    state: driving ? (isStill ? "still" : "") : frozen ? "frozen" : "",
  };
}

const isDown = (pad) => !!pad.buttons[DEADMAN]?.pressed;

function update(last, pad, now) {
  const reading = JSON.stringify([[...pad.axes], Array.from(pad.buttons, (it) => [it.pressed, it.value])]);
  const it = last ?? { centered: new Set(), seenUp: false, isFrozen: false };
  if (it.reading !== reading) Object.assign(it, { reading, changedAt: now });
  // A deadman that is down when the gamepad is found, or was let go by the page, must come up first.
  if (!isDown(pad)) Object.assign(it, { seenUp: true, isFrozen: false });
  // An axis counts once it was seen near its centre: one that rests elsewhere is no stick.
  const axis = (index) => {
    const value = pad.axes[index];
    if (Math.abs(value) <= DEADZONE) it.centered.add(index);
    return it.centered.has(index) ? shaped(-value) : 0;
  };
  it.push = { x: axis(STICKS.linear), y: axis(STICKS.angular) };
  it.isDeflected = it.push.x !== 0 || it.push.y !== 0;
  if (it.seenUp && isDown(pad) && it.isDeflected && now - it.changedAt > SILENCE_MS) {
    Object.assign(it, { seenUp: false, isFrozen: true });
  }
  return it;
}
