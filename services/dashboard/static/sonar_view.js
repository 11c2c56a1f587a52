// The sonar view: the vehicle from above in metres, x up and y to the left.
import { t } from "./i18n.js";

const NS = "http://www.w3.org/2000/svg";
const REACH = 1.9; // m of a sector at most, so that all fit
const CREEPING = 0.02; // m/s; a slower wheel is drawn straight
const WHEELBASE = 0.64; // of the length, as drawn
const HALF = 0.36; // rad, half of a sector as drawn
const parts = { sectors: [], labels: [], wheels: [], body: null, mounts: [] };

const at = (x, y) => `${(-y).toFixed(3)} ${(-x).toFixed(3)}`;

function create(parent, tag, attributes) {
  const it = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) it.setAttribute(name, value);
  parent.append(it);
  return it;
}

const NAMES = ["left", "front_left", "front", "front_right", "right", "rear_right", "rear", "rear_left"];

// In the manual's order: counted clockwise from the left.
function mounts({ length, width, sonars }) {
  const [front, left] = [length / 2, width / 2];
  const degrees = [90, 45, 0, -45, -90, -135, 180, 135];
  const places = [[0, left], [front, left], [front, 0], [front, -left],
    [0, -left], [-front, -left], [-front, 0], [-front, left]];
  return places.map(([x, y], i) => sonars[NAMES[i]] ?? { x, y, yaw: (degrees[i] * Math.PI) / 180 });
}

export function build(vehicle) {
  const svg = document.getElementById("sonar-view");
  svg.replaceChildren();
  parts.mounts = mounts(vehicle);
  parts.sectors = parts.mounts.map(() => create(svg, "path", { class: "sector" }));
  const { length, width, track } = vehicle;
  const wheelbase = WHEELBASE * length;
  parts.wheels = [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([x, y]) => {
    const place = create(svg, "g", { transform: `translate(${at((x * wheelbase) / 2, (y * track) / 2)})` });
    const part = create(place, "rect", { class: "wheel", x: -0.055, y: -0.15, width: 0.11, height: 0.3, rx: 0.03 });
    return { part, x: (x * wheelbase) / 2, y: (y * track) / 2 };
  });
  parts.body = create(svg, "rect", {
    class: "body", x: -width / 2, y: -length / 2, width, height: length, rx: 0.1, "fill-opacity": 0.55,
  });
  const tip = length / 2 - 0.08;
  create(svg, "path", { class: "nose", d: `M${at(tip, 0)}L${at(tip - 0.2, 0.13)}L${at(tip - 0.2, -0.13)}Z` });
  parts.labels = parts.mounts.map(() => create(svg, "text", {}));
}

function sector({ x, y, yaw }, reach) {
  const end = (angle) => at(x + reach * Math.cos(angle), y + reach * Math.sin(angle));
  // Counter-clockwise as seen from above, y to the left: the flag is 0 on the screen.
  return `M${at(x, y)}L${end(yaw - HALF)}A${reach} ${reach} 0 0 0 ${end(yaw + HALF)}Z`;
}

// The board reports no wheel angles: those at which all wheels roll, in degrees clockwise.
function turned({ x, y }, { measured }) {
  const [linear, angular] = measured ?? [0, 0];
  const [ahead, aside] = [linear - angular * y, angular * x];
  return Math.hypot(ahead, aside) < CREEPING ? 0 : ((-Math.atan(aside / ahead) * 180) / Math.PI).toFixed(1);
}

function label(range, tone) {
  if (range != null) return range.toFixed(2);
  return { fault: t("fault"), stop: t("near"), clear: "" }[tone] ?? "?";
}

export function draw(snapshot) {
  snapshot.tones.forEach((tone, i) => {
    const range = snapshot.ranges[i];
    const reach = Math.max(0.25, Math.min(range ?? (tone === "stop" ? 0.25 : REACH), REACH));
    const mount = parts.mounts[i];
    parts.sectors[i].setAttribute("d", sector(mount, reach));
    parts.sectors[i].dataset.tone = tone;
    const far = Math.max(0.5, reach * 0.72);
    parts.labels[i].setAttribute("x", (-mount.y - far * Math.sin(mount.yaw)).toFixed(3));
    parts.labels[i].setAttribute("y", (-mount.x - far * Math.cos(mount.yaw)).toFixed(3));
    parts.labels[i].textContent = label(range, tone);
  });
  parts.wheels.forEach((wheel) => wheel.part.setAttribute("transform", `rotate(${turned(wheel, snapshot)})`));
  parts.body.dataset.pressed = snapshot.bumper === true;
}
