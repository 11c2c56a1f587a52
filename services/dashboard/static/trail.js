// The trajectory on a grid, in odom: x to the right, y up, metres; and what is in the map: a route, and the
// floor plan.
import { fitted } from "./charts.js";

const SPACING = 0.05; // m between two stored points
const KEPT = 20000;
const [NEAR, FAR] = [300, 0.2]; // pixels per metre
let points = [];
let vehicle = { length: 1.1, width: 0.7 };
let scale = 40;
let center = [0, 0];
let epoch = null;
let pose = null;
let route = null; // of patrol
let plan = null; // { image, toMap, stamp }: the floor plan, and what turns its pixels into metres of the map
let frame = null; // of odom in the map: x, y, heading; null while the vehicle is not placed
let uncertainty = null; // of the pose in the map: half axes, m, and the direction of the first, rad

export const size = (given) => { vehicle = given; };

export const locate = (map) => {
  uncertainty = map?.ellipse;
  frame = map?.state === "placed" ? map.odom : null;
};

export const follow = (given) => { route = given; };

/** Load the floor plan, by two of its points: pixels from the top left, and x and y in the map. */
export function lay(points) {
  const stamp = JSON.stringify(points);
  if (plan?.stamp === stamp) return;
  plan = null;
  if (!points[0].length) return;
  // Complex numbers: metres = first + factor * pixels, where v counts upwards.
  const [[u0, v0, x0, y0], [u1, v1, x1, y1]] = points;
  const [du, dv, dx, dy] = [u1 - u0, v0 - v1, x1 - x0, y1 - y0];
  const length = du * du + dv * dv;
  const [re, im] = [(dx * du + dy * dv) / length, (dy * du - dx * dv) / length];
  const toMap = ([u, v]) => [
    x0 + re * (u - u0) - im * (v0 - v), y0 + im * (u - u0) + re * (v0 - v),
  ];
  plan = { image: new Image(), toMap, stamp };
  plan.image.src = "/floor-plan";
}

export function add(snapshot) {
  if (!snapshot.pose) return;
  if (epoch !== null && snapshot.epoch !== epoch) points = [];
  epoch = snapshot.epoch;
  const last = points.at(-1);
  if (last && Math.hypot(snapshot.pose[0] - last[0], snapshot.pose[1] - last[1]) < SPACING) return;
  points.push([snapshot.pose[0], snapshot.pose[1]]);
  if (points.length > KEPT) points.shift();
}

export function draw(given) {
  pose = given;
  if (pose) center = [pose[0], pose[1]];
  const canvas = document.getElementById("trail");
  const [pen, width, height] = fitted(canvas);
  const css = getComputedStyle(document.documentElement);
  const color = (name) => css.getPropertyValue(`--${name}`);
  const screen = ([x, y]) => [width / 2 + (x - center[0]) * scale, height / 2 - (y - center[1]) * scale];
  if (plan?.image.naturalWidth && frame) floor(pen, screen);
  grid(pen, width, height, screen, color);
  if (route && frame) corridor(pen, screen, color);
  pen.strokeStyle = color("measured");
  pen.lineWidth = 3;
  pen.lineJoin = "round";
  pen.beginPath();
  points.forEach((point, i) => pen[i ? "lineTo" : "moveTo"](...screen(point)));
  if (pose && points.length) pen.lineTo(...screen(pose));
  pen.stroke();
  if (pose) body(pen, screen(pose), pose[2], color);
  if (pose && uncertainty) ellipse(pen, screen(pose), color);
  if (route && frame) stations(pen, screen, color);
}

// From the axes of the map into those of odom.
function inOdom([x, y]) {
  const [dx, dy] = [x - frame[0], y - frame[1]];
  const [cos, sin] = [Math.cos(frame[2]), Math.sin(frame[2])];
  return [cos * dx + sin * dy, cos * dy - sin * dx];
}

/** Draw the floor plan, by where its corners are on the screen. */
function floor(pen, screen) {
  const { naturalWidth: w, naturalHeight: h } = plan.image;
  const [[x, y], [right, rightY], [low, lowY]] = [[0, 0], [w, 0], [0, h]].map((it) => screen(inOdom(plan.toMap(it))));
  pen.save();
  pen.globalAlpha = 0.5;
  pen.transform((right - x) / w, (rightY - y) / w, (low - x) / h, (lowY - y) / h, x, y);
  pen.drawImage(plan.image, 0, 0);
  pen.restore();
}

/** Draw the line of the route on a band, its corridor. */
function corridor(pen, screen, color) {
  pen.strokeStyle = color("clear");
  pen.lineJoin = pen.lineCap = "round";
  pen.beginPath();
  route.points.forEach((point, i) => pen[i ? "lineTo" : "moveTo"](...screen(inOdom(point))));
  for (const [wide, alpha] of [[2 * route.corridor * scale, 0.2], [1.5, 1]]) {
    pen.lineWidth = wide;
    pen.globalAlpha = alpha;
    pen.stroke();
  }
  pen.lineCap = "butt";
}

function stations(pen, screen, color) {
  pen.font = "600 13px system-ui, sans-serif";
  pen.lineWidth = 3;
  pen.strokeStyle = color("field");
  for (const [name, ...at] of route.stations) {
    const [x, y] = screen(inOdom(at));
    pen.fillStyle = color("clear");
    pen.beginPath();
    pen.arc(x, y, 5, 0, 2 * Math.PI);
    pen.fill();
    pen.fillStyle = color("text");
    pen.strokeText(name, x + 9, y - 7);
    pen.fillText(name, x + 9, y - 7);
  }
}

function ellipse(pen, [x, y], color) {
  const [axis, other, direction] = uncertainty;
  pen.strokeStyle = color("allowed");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.ellipse(x, y, axis * scale, other * scale, -direction, 0, 2 * Math.PI);
  pen.stroke();
}

function step() {
  const least = 50 / scale; // m for at least 50 pixels
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((n) => n * power).find((it) => it >= least);
}

function grid(pen, width, height, screen, color) {
  const every = step();
  const text = (value) => (every < 1 ? value.toFixed(1) : value.toFixed(0));
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.strokeStyle = color("line");
  pen.fillStyle = color("quiet");
  const [left, low] = [center[0] - width / 2 / scale, center[1] - height / 2 / scale];
  for (let x = Math.ceil(left / every) * every; x < left + width / scale; x += every) {
    line(pen, screen([x, 0])[0], 0, screen([x, 0])[0], height);
    pen.fillText(text(x), screen([x, 0])[0] + 3, height - 4);
  }
  for (let y = Math.ceil(low / every) * every; y < low + height / scale; y += every) {
    line(pen, 0, screen([0, y])[1], width, screen([0, y])[1]);
    if (screen([0, y])[1] < height - 16) pen.fillText(`${text(y)} m`, 3, screen([0, y])[1] - 3); // above those of x
  }
}

function line(pen, ...[x0, y0, x1, y1]) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function body(pen, [x, y], heading, color) {
  const [long, wide] = [Math.max(vehicle.length * scale, 18), Math.max(vehicle.width * scale, 11)];
  pen.save();
  pen.translate(x, y);
  pen.rotate(-heading);
  pen.fillStyle = color("body");
  pen.fillRect(-long / 2, -wide / 2, long, wide);
  pen.fillStyle = color("measured");
  pen.beginPath();
  pen.moveTo(long / 2 - 2, 0);
  pen.lineTo(long / 6, wide / 3);
  pen.lineTo(long / 6, -wide / 3);
  pen.fill();
  pen.restore();
}

const zoom = (factor) => { scale = Math.max(FAR, Math.min(NEAR, scale * factor)); draw(pose); };

export function begin() {
  document.getElementById("zoom-in").onclick = () => zoom(1.4);
  document.getElementById("zoom-out").onclick = () => zoom(1 / 1.4);
}
