// The emergency stop: asked by both ways, again and again, until a picture shows it latched.
// The socket may have just broken without knowing, and a request of its own may hang.
const AGAIN_MS = 400;
const PATIENCE_MS = 3000;
const POST_MS = 1000;
const ON_ITS_WAY_MS = 300; // a picture this soon may be older than the wish
let page = null;
let wish = null; // { robot, since }

export function begin(given) {
  page = given;
  setInterval(again, AGAIN_MS);
}

export function ask() {
  if (!wish) page.toast("estop_asked", "warning");
  wish = { robot: page.robot(), since: performance.now() };
  insist();
}

export function saw(safety) {
  const young = !wish || performance.now() - wish.since < ON_ITS_WAY_MS;
  if (!young && wish.robot === page.robot() && safety?.latched.includes("estop")) wish = null;
}

function again() {
  if (!wish) return;
  if (performance.now() - wish.since < PATIENCE_MS) insist();
  else {
    wish = null;
    page.toast("estop_unconfirmed", "error");
  }
}

function insist() {
  page.send({ k: "estop", robot: wish.robot });
  const failed = () => { if (page.lost()) page.toast("estop_unconfirmed", "error"); };
  // With keepalive it goes out even if the page is closed this moment.
  fetch(`/estop/${encodeURIComponent(wish.robot)}`, { method: "POST", keepalive: true, signal: AbortSignal.timeout(POST_MS) })
    .then((answer) => {
      if (answer.status === 404) page.toast("estop_unknown", "error");
      else if (!answer.ok) failed();
    }, failed);
}
