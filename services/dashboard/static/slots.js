// The slots of the page: a camera, another page in a frame, and the recordings of this host.
const RETRY_MS = 5000; // after an error, and until a slot without an answer is reported
let page = null;
let retry = 0; // the timer of the camera's next attempt
let probe = 0; // the timer of the frame's next attempt
let wanted = ""; // the address of the frame

export function begin(given) {
  page = given;
  const image = document.querySelector("#camera img");
  image.onload = () => { clearTimeout(retry); note("camera", ""); };
  image.onerror = () => {
    clearTimeout(retry);
    note("camera", "camera_lost");
    retry = setTimeout(connect, RETRY_MS);
  };
  for (const name of ["camera", "embed", "recordings"])
    document.getElementById(name).hidden = !document.getElementById("page").dataset[name];
  document.getElementById("recordings").addEventListener("toggle", list);
  for (const event of ["blur", "focus"]) window.addEventListener(event, () => setTimeout(watchFocus));
}

// Another robot is shown: a picture of the one before must not stay.
export function show() {
  if (address("camera") && document.querySelector("#camera img").getAttribute("src") !== address("camera")) {
    note("camera", "camera_waiting");
    connect();
  }
  if (address("embed") && wanted !== address("embed")) {
    wanted = address("embed");
    note("embed", "embed_waiting");
    open();
  }
}

function connect() {
  clearTimeout(retry);
  const image = document.querySelector("#camera img");
  image.removeAttribute("src");
  image.src = address("camera");
  retry = setTimeout(() => note("camera", "camera_lost"), RETRY_MS); // it accepts and sends nothing
}

// A frame reports no error: the browser would show a page of its own. Any answer counts.
async function open() {
  clearTimeout(probe);
  const url = wanted;
  const stop = new AbortController();
  const limit = setTimeout(() => stop.abort(), RETRY_MS);
  const answers = await fetch(url, { mode: "no-cors", cache: "no-store", signal: stop.signal })
    .then(() => true, () => false);
  clearTimeout(limit);
  stop.abort(); // the content is not read
  if (url !== wanted) return;
  if (answers) document.querySelector("#embed iframe").src = url;
  else probe = setTimeout(open, RETRY_MS);
  note("embed", answers ? "" : "embed_lost");
}

// Keys that are typed into the frame do not reach the page, and with them the emergency stop.
function watchFocus() {
  const frame = document.querySelector("#embed iframe");
  if (document.activeElement === frame && page.isDriver()) {
    frame.blur();
    window.focus();
  }
  document.querySelector("#embed .bad").hidden = document.activeElement !== frame;
}

function address(name) {
  const url = document.getElementById("page").dataset[name];
  return url && url.replaceAll("{robot}", encodeURIComponent(page.robot()));
}

// Show a text instead of the content of a slot; the content without a text.
function note(slot, text) {
  const line = document.querySelector(`#${slot} .note`);
  document.querySelector(`#${slot} img, #${slot} iframe`).hidden = !!text;
  line.hidden = !text;
  line.dataset.t = text;
  line.textContent = text && page.t(text);
}

async function list(event) {
  if (!event.target.open) return;
  const table = event.target.querySelector("table");
  const response = await fetch("/recordings/").catch(() => null);
  const found = response?.ok ? await response.json() : [];
  table.replaceChildren(...found.map(row));
  if (!found.length) table.textContent = page.t(response?.ok ? "no_recordings" : "recordings_refused");
}

function row(recording) {
  const tr = document.createElement("tr");
  tr.append(cell(link(recording.name, recording.name)), cell(`${(recording.size / 1e6).toFixed(1)} MB`),
    cell(new Date(recording.changed * 1000).toLocaleString()),
    cell(recording.report ? link(recording.report, page.t("report")) : `t2 report ${recording.name}`));
  return tr;
}

function cell(content) {
  const td = document.createElement("td");
  td.append(content);
  return td;
}

function link(name, text) {
  const a = document.createElement("a");
  Object.assign(a, { href: `/recordings/${name}`, textContent: text, target: "_blank", rel: "noopener" });
  return a;
}
