// The slots of the page: a camera, another page in a frame, and the recordings of this host.
const RETRY_MS = 5000; // after an error of the camera
let page = null;
let retry = 0; // the timer of the camera's next attempt

export function begin(given) {
  page = given;
  const image = document.querySelector("#camera img");
  image.onload = () => visible(true);
  image.onerror = () => {
    visible(false);
    clearTimeout(retry);
    retry = setTimeout(connect, RETRY_MS);
  };
  for (const name of ["camera", "embed", "recordings"])
    document.getElementById(name).hidden = !document.getElementById("page").dataset[name];
  document.getElementById("recordings").addEventListener("toggle", list);
  for (const event of ["blur", "focus"]) window.addEventListener(event, () => setTimeout(watchFocus));
}

// Another robot is shown: a picture of the one before must not stay.
export function show() {
  if (address("camera") && document.querySelector("#camera img").getAttribute("src") !== address("camera")) connect();
  const frame = document.querySelector("#embed iframe");
  if (address("embed") && frame.getAttribute("src") !== address("embed")) frame.src = address("embed");
}

function connect() {
  clearTimeout(retry);
  visible(false);
  const image = document.querySelector("#camera img");
  image.removeAttribute("src");
  image.src = address("camera");
}

// Keys that are typed into the frame do not reach the page, and with them the emergency stop.
function watchFocus() {
  const frame = document.querySelector("#embed iframe");
  if (document.activeElement === frame && page.isDriver()) {
    frame.blur();
    window.focus();
  }
  document.querySelector("#embed p").hidden = document.activeElement !== frame;
}

function address(name) {
  const url = document.getElementById("page").dataset[name];
  return url && url.replaceAll("{robot}", encodeURIComponent(page.robot()));
}

function visible(is) {
  document.querySelector("#camera img").hidden = !is;
  document.querySelector("#camera p").hidden = is;
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
