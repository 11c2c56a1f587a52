// Sound and vibration: the vehicle has stopped by itself, a reset is due, the connection is lost, and
// driving is possible again. A browser allows sound after the first press on the page, and calls a
// hidden page rarely: it hears of a lost connection late.
import { QUIET } from "./state_bar.js";

const GAP_MS = 2000; // between two equal signals: at a wall safety stops and goes on often
const GAIN = 0.15;
// By state: tones in Hz and s, one after another; the vibration has their lengths.
const SIGNALS = {
  lost: [[330, 0.15], [330, 0.15], [330, 0.15]],
  latched: [[440, 0.3], [330, 0.5]],
  stopped: [[440, 0.2]],
  ready: [[880, 0.12]],
};
let isOn = true;
let audio = null;
let before = ""; // the state
let last = {}; // when each signal was given

/** Return the state that a person must hear of; `fast` is null without a connection. */
function stateOf(fast) {
  const safety = fast?.connected ? fast.safety : null;
  if (!safety) return "lost";
  if (safety.latched.length) return "latched";
  const stops = safety.causes.filter((it) => it.action !== "slow" && !QUIET.includes(it.name));
  return stops.length ? "stopped" : "ready";
}

/** Signal a change of the state; one that comes too soon after an equal one is signalled later. */
export function update(fast, now) {
  const state = stateOf(fast);
  if (state === before || now - (last[state] ?? -Infinity) < GAP_MS) return;
  const isFirst = !before; // a page that opens is silent
  before = state;
  if (!isOn || isFirst) return;
  last[state] = now;
  navigator.vibrate?.(SIGNALS[state].flatMap(([, seconds]) => [1000 * seconds, 60]));
  play(SIGNALS[state]);
}

function play(tones) {
  if (audio?.state !== "running") return;
  let at = audio.currentTime;
  for (const [frequency, seconds] of tones) {
    const [tone, volume] = [audio.createOscillator(), audio.createGain()];
    volume.gain.value = GAIN;
    tone.frequency.value = frequency;
    tone.connect(volume).connect(audio.destination);
    tone.start(at);
    tone.stop(at + seconds);
    at += seconds + 0.06;
  }
}

/** Follow a checkbox, and remember it. */
export function begin(box, stored, store) {
  isOn = box.checked = stored !== "off";
  box.onchange = () => {
    isOn = box.checked;
    store(isOn ? "on" : "off");
  };
  for (const press of ["pointerdown", "pointerup", "keydown"]) addEventListener(press, unlock);
}

// A press of a finger allows sound at its end, and a call or a locked screen takes the sound away.
function unlock() {
  if (!window.AudioContext) return;
  audio ??= new AudioContext();
  if (audio.state !== "running") audio.resume().catch(() => {});
}
