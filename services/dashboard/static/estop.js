// The emergency stop. It needs only what every browser has: a classic script in ECMAScript 5, loaded
// first, which works without the rest of the page.
//
// A stop is sent by WebSocket and by POST, and repeated until a snapshot shows it latched: a
// WebSocket may be broken without an error, and a POST may hang. What is not confirmed within KEPT_MS
// is never sent later: the page says so until somebody acknowledges it, also after a reload.
//
// state      leads to                                             shown
// pending    confirmed: removed; KEPT_MS: late                    not sent yet; not confirmed
// late       acknowledged: removed; pressed again: pending        was not sent; was not confirmed
// handed     confirmed, acknowledged: removed                     sent where no snapshot shows it
(function () {
  "use strict";
  var REPEAT_MS = 400;
  var POST_MS = 1000;
  var MIN_AGE_MS = 300; // an earlier snapshot may be older than the request
  var UNCONFIRMED_MS = 3000;
  var KEPT_MS = 30000;
  var STORE = "t2.estop."; // and the robot: time of day, state, sent
  var PATTERN = /^(\d{1,15}) (pending|late|handed) (true|false)$/;
  // A letter that looks like E is E, wherever it is: Cyrillic, Greek.
  var LETTERS_E = "e\u0435\u03b5";
  var stops = Object.create(null); // by robot: { since, wall, state, sent, status, barred }
  var viaXhr = false;
  var press = { type: "", at: -Infinity };
  var page = null; // what dashboard.js offers

  function now() {
    return window.performance && performance.now ? performance.now() : new Date().getTime();
  }

  function element(id) {
    return document.getElementById(id);
  }

  function robotShown() {
    return element("page").getAttribute("data-robot");
  }

  // --- texts ------------------------------------------------------------------------------------

  function text(name) {
    if (page) return page.t.apply(null, arguments);
    var language = /^zh/.test(navigator.language || "") ? "zh" : "en";
    var found = texts()[language][name] || name;
    for (var i = 1; i < arguments.length; i += 1) found = found.replace("{}", arguments[i]);
    return found;
  }

  function texts() {
    try {
      return JSON.parse(element("texts").textContent);
    } catch (error) {
      return { en: {}, zh: {} };
    }
  }

  // The rest of the page may fail in an old browser; a stop must not.
  function ask(method, argument, otherwise) {
    try {
      return page ? page[method](argument) : otherwise;
    } catch (error) {
      return otherwise;
    }
  }

  function name() {
    return ask("name", null, "");
  }

  // --- storage: it may be blocked -----------------------------------------------------------------

  function store(robot) {
    var it = stops[robot];
    try {
      if (it) localStorage.setItem(STORE + robot, it.wall + " " + it.state + " " + it.sent);
      else localStorage.removeItem(STORE + robot);
    } catch (error) { /* then a reload forgets it */ }
  }

  function restore() {
    try {
      for (var i = 0; i < localStorage.length; i += 1) {
        var item = localStorage.key(i);
        var found = item.indexOf(STORE) === 0 && PATTERN.exec(localStorage.getItem(item));
        if (found) restoreOne(item.slice(STORE.length), Number(found[1]), found[2], found[3] === "true");
      }
    } catch (error) { /* nothing is stored */ }
  }

  function restoreOne(robot, wall, state, sent) {
    var age = new Date().getTime() - wall;
    var young = age >= 0 && age < KEPT_MS;
    if (state === "pending" && !young) state = "late";
    stops[robot] = { since: now() - age, wall: wall, state: state, sent: sent };
  }

  // --- sending ----------------------------------------------------------------------------------

  function request() {
    var robot = robotShown();
    var barred = ask("barred", null, ""); // why this page may not drive, and perhaps not stop
    var first = !stops[robot] || stops[robot].state !== "pending";
    stops[robot] = { since: now(), wall: new Date().getTime(), state: "pending", sent: false, barred: barred };
    if (!barred) store(robot);
    send(robot);
    ask("pressed");
    if (barred === "view_only_stop") ask("toast", barred);
    else if (first && !ask("off", null, true)) ask("toast", "estop_asked");
    show();
  }

  function remove(robot) {
    delete stops[robot];
    store(robot);
    show();
  }

  function send(robot) {
    var it = stops[robot];
    var age = Math.round((now() - it.since) / 100) / 10;
    if (robot === robotShown()) ask("send", { k: "estop", name: name(), age: age });
    var query = "?name=" + encodeURIComponent(name()) + "&age=" + age;
    post("/estop/" + encodeURIComponent(robot) + query, function (status) {
      if (stops[robot] !== it || it.state !== "pending") return;
      it.status = status;
      if (status !== 200) return show();
      if (!isCut()) it.sent = true;
      if (robot !== robotShown() || !page) it.state = "handed"; // no snapshot of it comes here
      store(robot);
      show();
    });
  }

  // With keepalive it is sent even if the page is being closed. After a failure the other way is tried.
  function post(url, done) {
    var failed = function () { viaXhr = !viaXhr; done(0); };
    if (!viaXhr && window.fetch && window.AbortController) {
      try {
        var control = new AbortController();
        var timer = setTimeout(function () { control.abort(); }, POST_MS);
        var options = { method: "POST", credentials: "same-origin", keepalive: true, signal: control.signal };
        fetch(url, options).then(function (response) {
          clearTimeout(timer);
          done(response.status);
        }, failed);
        return;
      } catch (error) { /* a browser with a part of it */ }
    }
    var xhr = new XMLHttpRequest();
    xhr.open("POST", url, true);
    xhr.timeout = POST_MS;
    xhr.onload = function () { done(xhr.status); };
    xhr.onerror = xhr.ontimeout = failed;
    xhr.send();
  }

  function repeat() {
    for (var robot in stops) {
      var it = stops[robot];
      if (it.state !== "pending") continue;
      var age = now() - it.since;
      if (it.barred && age >= UNCONFIRMED_MS) {
        remove(robot);
        ask("toast", "event.estop_denied");
      } else if (age >= KEPT_MS) {
        it.state = "late";
        store(robot);
      } else send(robot);
    }
    show();
  }

  function update(safety) {
    var it = stops[robotShown()];
    var isOpen = it && it.state !== "late" && now() - it.since >= MIN_AGE_MS;
    if (isOpen && safety && safety.latched.indexOf("estop") >= 0) remove(robotShown());
  }

  // --- what the screen shows ----------------------------------------------------------------------

  // Whether the dashboard has no connection to the robot.
  function isCut() {
    return ask("cut", null, false);
  }

  function message(robot, it) {
    var at = new Date(it.wall).toTimeString().slice(0, 8);
    if (it.state === "handed") return text("estop_handed", robot);
    if (it.state === "late") return text(it.sent ? "estop_late_unconfirmed" : "estop_late", at, robot);
    var age = now() - it.since;
    if (it.status === 401) return text("estop_login");
    if (it.status === 404) return text("estop_unknown");
    var cut = it.status === 200 ? isCut() : it.status !== undefined;
    if (cut) return text("estop_not_sent", Math.ceil((KEPT_MS - age) / 1000));
    return age > UNCONFIRMED_MS ? text("event.estop_unconfirmed") : "";
  }

  function show() {
    var box = element("unsent");
    if (!box) return; // the document is still loading
    var lines = [];
    for (var robot in stops) {
      var it = stops[robot];
      var line = message(robot, it);
      if (line) lines.push({ text: line, button: button(robot, it) });
    }
    if (page === false) lines.push({ text: text("page_incomplete"), button: null });
    var stamp = JSON.stringify(lines.map(function (each) { return [each.text, each.button && each.button.label]; }));
    if (box.getAttribute("data-stamp") === stamp) return;
    box.setAttribute("data-stamp", stamp);
    while (box.firstChild) box.removeChild(box.firstChild);
    for (var i = 0; i < lines.length; i += 1) draw(box, lines[i]);
  }

  function button(robot, it) {
    if (it.state !== "pending") return { label: text("acknowledge"), act: function () { remove(robot); } };
    if (it.status === 401) return { label: text("log_in"), act: function () { location.reload(); } };
    return null;
  }

  function draw(box, line) {
    var row = document.createElement("p");
    row.appendChild(document.createTextNode(line.text));
    if (line.button) {
      var it = document.createElement("button");
      it.appendChild(document.createTextNode(line.button.label));
      it.onclick = line.button.act;
      row.appendChild(it);
    }
    box.appendChild(row);
  }

  // --- input ------------------------------------------------------------------------------------

  function isTyping(event) {
    return /^(INPUT|TEXTAREA|SELECT)$/.test((event.target && event.target.tagName) || "");
  }

  function isKeystroke(event) {
    if (isTyping(event) || event.ctrlKey || event.altKey || event.metaKey) return false;
    var letter = String(event.key || "");
    if (letter.normalize) letter = letter.normalize("NFKC"); // full width
    letter = letter.toLowerCase();
    if (letter.length === 1 && LETTERS_E.indexOf(letter) >= 0) return true;
    // Its place, whatever the layout or an input method makes of it; without one Cyrillic has it at U.
    return event.code ? event.code === "KeyE" : letter === "\u0443" || (!event.key && event.keyCode === 69);
  }

  // At the first event of a press: while a finger is on the stick, the tap of another makes no click.
  function pressed(event) {
    var it = event.target;
    while (it && it.id !== "estop") it = it.parentNode;
    var isSame = event.type !== press.type && now() - press.at < 1000;
    if (!it || isSame) return;
    press = { type: event.type, at: now() };
    request();
  }

  ["pointerdown", "touchstart", "mousedown", "click"].forEach(function (type) {
    document.addEventListener(type, pressed, true);
  });
  document.addEventListener("keydown", function (event) {
    if (isKeystroke(event) && !event.repeat) request();
  }, true);
  // A script that this browser cannot run, or that did not arrive, leaves the page without its rest.
  window.addEventListener("load", function () {
    if (!page) page = false;
    show();
  });
  restore();
  setInterval(repeat, REPEAT_MS);

  window.T2Estop = {
    isKeystroke: isKeystroke,
    update: update,
    isOpen: function () { return !!stops[robotShown()]; },
    begin: function (given) { page = given; show(); },
  };
})();
