// The picture of a camera. While the driver does not see the vehicle, a hold answers the picture that is on
// the screen, with the heartbeat of safety that it carries: a picture that is frozen, late or cut off cannot
// drive. The age on the screen is that of this heartbeat.
import { t } from "./i18n.js";

const $ = (id) => document.getElementById(id);
const HEADER_LENGTH = 2; // bytes, at the end: the length of the header before it
let page = null; // what dashboard.js offers
let cameras = []; // { name, state, text }
let chosen = ""; // the name of the camera that is shown
let shown = null; // { camera, boot, seq, heartbeat, age, at, delay }: the picture on the screen
let decoding = false;
let broken = 0; // pictures in a row that this browser cannot decode
let inSight = false; // the driver sees the vehicle
let asked = false; // for the next picture

export function begin(given) {
  page = given;
  $("sight").onclick = () => page.setSight(!inSight);
}

/** Forget the pictures of an earlier connection. */
export function forget() {
  shown = null;
  asked = false;
  broken = 0;
}

/** Take the list of cameras, from the slow snapshot. */
export function list(given) {
  cameras = given;
  if (!cameras.some((it) => it.name === chosen)) choose(cameras[0]?.name ?? "");
  $("camera").hidden = !cameras.length;
  const stamp = cameras.map((it) => it.name).join(" ");
  if ($("cameras").dataset.stamp !== stamp) {
    $("cameras").dataset.stamp = stamp;
    $("cameras").replaceChildren(...(cameras.length > 1 ? cameras : []).map(({ name }) => {
      const it = document.createElement("button");
      it.textContent = name;
      it.onclick = () => choose(name);
      return it;
    }));
  }
  ask();
}

function choose(name) {
  if (name === chosen) return;
  chosen = name;
  forget();
  $("picture").getContext("2d").clearRect(0, 0, $("picture").width, $("picture").height);
}

// A hidden page shows no picture, and asks for none.
function ask() {
  if (asked || decoding || !chosen || document.hidden) return;
  asked = page.send({ k: "watch", camera: chosen });
}

/** Take a picture: a JPEG, its header, and the length of that. */
export async function receive(buffer) {
  const bytes = new Uint8Array(buffer);
  const end = bytes.length - HEADER_LENGTH;
  const start = end - (bytes[end] * 256 + bytes[end + 1]);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(start, end)));
  const at = performance.now();
  const { delay } = page.delay();
  asked = false;
  if (header.camera !== chosen || isOlder(header)) return ask();
  decoding = true;
  const image = await createImageBitmap(new Blob([bytes.subarray(0, start)], { type: "image/jpeg" })).catch(() => null);
  broken = image ? 0 : broken + 1;
  if (!image) return done();
  // What is drawn here is on the screen: a page that is not painted has no new picture.
  requestAnimationFrame(() => {
    if (header.camera === chosen) draw(image, { ...header, at, delay });
    image.close();
    done();
  });
}

function done() {
  decoding = false;
  ask();
}

const isOlder = ({ boot, seq }) => shown && shown.boot === boot && seq <= shown.seq;

function draw(image, header) {
  const it = $("picture");
  if (it.width !== image.width || it.height !== image.height) [it.width, it.height] = [image.width, image.height];
  it.getContext("2d").drawImage(image, 0, 0);
  it.dataset.seq = header.seq;
  shown = header;
}

/** Whether holds answer the picture: there is a camera, and the driver does not see the vehicle. */
const isRemote = () => cameras.length > 0 && !inSight;

/** Return the heartbeat that a hold answers: that of the picture on the screen, or of the snapshot. */
export const echo = (snapshots) => (isRemote() ? shown?.heartbeat ?? 0 : snapshots);

// The age of the picture in s: when its heartbeat arrived at the dashboard, the delay of the link then, and
// the time on the screen. Infinity without a heartbeat.
function age(now) {
  if (!shown || shown.heartbeat === null || shown.age === null) return Infinity;
  return shown.age + shown.delay + (now - shown.at) / 1000;
}

/** Return why the picture cannot drive; empty if it can, or if the driver sees the vehicle. */
export function refusal() {
  if (!isRemote()) return "";
  const { delay, limit } = page.delay();
  const old = age(performance.now());
  if (old <= limit) return "";
  if (!Number.isFinite(old)) return t("picture_none");
  const figure = (Math.ceil(old * 10) / 10).toFixed(1);
  return delay > limit / 2 ? t("picture_late_link", figure, delay.toFixed(1)) : t("picture_late", figure);
}

/** Show age, state and mode; `isDriver` may change the mode. */
export function show(isDriver, driver) {
  inSight = !!driver?.in_sight;
  if (!cameras.length) return;
  const old = age(performance.now());
  const late = old > page.delay().limit;
  $("camera").dataset.late = late;
  $("camera").dataset.sight = inSight;
  // Rounded away from the limit: one figure is not both fine and too old.
  const figure = Number.isFinite(old) ? t("picture_age", (Math.floor(old * 10) / 10).toFixed(1)) : t("picture_none_short");
  write("picture-age", late && isRemote() ? refusal() : figure);
  const camera = cameras.find((it) => it.name === chosen);
  write("picture-text", broken > 2 ? t("picture_broken") : camera?.state === "up" || !late ? "" : t(camera?.text));
  write("sight", t(inSight ? "sight_on" : "sight_off"));
  $("sight").hidden = !isDriver;
  ask();
}

function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}
