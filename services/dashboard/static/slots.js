// The slots of the page: a camera, and the recordings of this host.
const RETRY_MS = 5000; // after an error, and until a camera without an answer is reported
let page = null;
let retry = 0; // the timer of the camera's next attempt

export function begin(given) {
  page = given;
  const image = document.querySelector("#camera img");
  image.onload = () => { clearTimeout(retry); note(""); };
  image.onerror = () => {
    clearTimeout(retry);
    note("camera_lost");
    retry = setTimeout(connect, RETRY_MS);
  };
  for (const name of ["camera", "recordings"])
    document.getElementById(name).hidden = !document.getElementById("page").dataset[name];
  document.getElementById("recordings").addEventListener("toggle", list);
  if (document.getElementById("camera").hidden) return;
  note("camera_waiting");
  connect();
}

function connect() {
  clearTimeout(retry);
  const image = document.querySelector("#camera img");
  image.removeAttribute("src");
  image.src = document.getElementById("page").dataset.camera.replaceAll("{robot}", page.robot);
  retry = setTimeout(() => note("camera_lost"), RETRY_MS); // it accepts and sends nothing
}

// Show a text instead of the image; the image without a text.
function note(text) {
  const line = document.querySelector("#camera .note");
  document.querySelector("#camera img").hidden = !!text;
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
