// The emergency stop: sent by WebSocket and by POST, and repeated until a snapshot shows it latched.
// The WebSocket may be broken without an error, and a POST may hang.
const REPEAT_MS = 400;
const TIMEOUT_MS = 3000;
const POST_MS = 1000;
const MIN_AGE_MS = 300; // an earlier snapshot may be older than the request
let page = null;
let pending = null; // { since, barred }

export function begin(given) {
  page = given;
  setInterval(repeat, REPEAT_MS);
}

export function request() {
  const barred = page.barred(); // why this page may not drive, and perhaps not stop
  if (!pending && barred === "view_only_stop") page.toast(barred, "error");
  else if (page.off()) page.toast("estop_not_sent", "error");
  else if (!pending) page.toast("estop_asked", "warning");
  pending = { since: performance.now(), barred };
  sendStop();
}

export function update(safety) {
  const isEarly = !pending || performance.now() - pending.since < MIN_AGE_MS;
  if (!isEarly && safety?.latched.includes("estop")) pending = null;
}

function repeat() {
  if (!pending) return;
  if (performance.now() - pending.since < TIMEOUT_MS) sendStop();
  else {
    page.toast(pending.barred ? "estop_denied" : "estop_unconfirmed", "error");
    pending = null;
  }
}

function sendStop() {
  page.send({ k: "estop", name: page.name() });
  const failed = () => { if (page.off()) page.toast("estop_not_sent", "error"); };
  // With keepalive it is sent even if the page is being closed.
  fetch(`/estop/${page.robot}?name=${encodeURIComponent(page.name())}`, { method: "POST", keepalive: true, signal: AbortSignal.timeout(POST_MS) })
    .then((response) => {
      if (response.status === 404) page.toast("estop_unknown", "error");
      else if (!response.ok) failed();
    }, failed);
}
