// The camera's stream.
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
  if (!document.getElementById("page").dataset.camera) return;
  document.getElementById("camera").hidden = false;
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
