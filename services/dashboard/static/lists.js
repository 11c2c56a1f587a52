// What is read and not steered by: causes, limits, drivers, switches, services, streams, events.
const $ = (id) => document.getElementById(id);
const BITS = ["over_current", "over_voltage", "encoder", "under_voltage", "overload"];
const SILENT_AGE = 3; // s

function made(tag, text = "", attributes = {}) {
  const it = document.createElement(tag);
  it.textContent = text;
  for (const [name, value] of Object.entries(attributes)) it.setAttribute(name, value);
  return it;
}

// Redrawn only when they say something else: selections and screen readers live longer.
function fill(element, stamp, make) {
  if (element.dataset.stamp === stamp) return;
  element.dataset.stamp = stamp;
  element.replaceChildren(...make());
}

export function lasting(seconds) {
  if (seconds == null) return "–";
  if (seconds < 100) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  if (seconds < 6000) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

export function showWhy(safety, t) {
  const causes = safety?.causes ?? [];
  const shown = causes.map((it) => [it, it.age < 10 ? it.age?.toFixed(1) : Math.floor(it.age)]);
  const stamp = JSON.stringify([shown.map(([it, age]) => [it.name, it.text, age]), safety?.latched, t("why")]);
  if (!causes.length) {
    fill($("causes"), stamp, () => [made("li", t(safety ? "no_causes" : "unknown"))]);
  } else fill($("causes"), stamp, () => shown.map(([it]) => {
    const known = t(`cause.${it.name}`) !== `cause.${it.name}`; // a newer safety may have more
    const line = made("li", known ? t(`cause.${it.name}`) : it.text, { "data-action": it.action, "data-cause": it.name });
    const latched = safety.latched.includes(it.name) ? ` · ${t("latched")}` : "";
    const more = !known || it.text === t(`cause.${it.name}`) ? "" : `${it.text} · `;
    line.append(made("small", `${more}${t("since")} ${lasting(it.age)}${latched}`));
    return line;
  }));
  const limits = safety?.limits;
  fill($("limits"), JSON.stringify([limits, t("why")]), () => [
    ["forward", limits?.forward, "m/s"], ["backward", limits?.backward, "m/s"],
    ["turning", limits?.angular, "rad/s"],
  ].map(([name, value, unit]) => {
    const cell = made("div");
    cell.append(made("b", value == null ? "–" : value.toFixed(2)), made("small", `${t(name)} ${unit}`));
    return cell;
  }));
}

export function showRest(rest, t) {
  showDrivers(rest, t);
  for (const name of ["ultrasonic_brake", "bumper_brake"]) {
    const on = rest.switches?.[name];
    $(name).textContent = `${t(name)}: ${on === true ? t("on") : on === false ? t("off") : t("unknown")}`;
    $(name).dataset.on = String(on);
  }
  $("services").replaceChildren(
    row("th", ["service", "alive", "version", "uptime", "lateness", "memory"].map((it) => [t(it)])),
    ...rest.services.map((it) => service(it, t)),
  );
  $("streams").replaceChildren(
    row("th", [[t("key")], [t("rate"), "number"], [t("age"), "number"]]),
    ...rest.streams.map((it) => row("td", [
      [it.key], [it.rate.toFixed(1), "number"],
      [lasting(it.age), it.age > SILENT_AGE ? "number bad" : "number"],
    ])),
  );
}

function row(tag, cells) {
  const line = made("tr");
  line.append(...cells.map(([text, kind]) => made(tag, text, kind ? { class: kind } : {})));
  return line;
}

function service(it, t) {
  const heard = it.uptime != null;
  const state = it.instances ? (heard ? "alive" : "silent") : "gone";
  const line = row("td", [
    [it.name], [t(state) + (it.instances > 1 ? ` ×${it.instances}` : ""), state === "alive" ? "" : "bad"],
    [it.version], [heard ? lasting(it.uptime) : ""],
    [heard ? `${(it.lateness * 1000).toFixed(0)} ms` : ""], [heard ? `${(it.rss / 1e6).toFixed(0)} MB` : ""],
  ]);
  line.dataset.service = it.name;
  line.dataset.state = state;
  const troubles = Object.entries(it.troubles).map(([name, count]) => `${name} ${count}`);
  if (troubles.length) line.firstChild.append(made("small", troubles.join(", ")));
  return line;
}

function showDrivers(rest, t) {
  const stamp = JSON.stringify([rest.left, rest.right, t("left")].map((it) => [it?.bits ?? it, it?.faults]));
  fill($("drivers"), stamp, () => ["left", "right"].flatMap((side) => {
    const driver = rest[side];
    const cell = made("div");
    cell.append(made("b", t(side)), driver ? (driver.bits ? "" : t("no_fault")) : t("unknown"));
    const faults = driver ? bits(driver.bits) : [];
    return [cell, ...faults.map((bit) => made("div",
      `${t(side)}, ${t("bit")} ${bit}: ${t(`fault.${BITS[bit] ?? "reserved"}`)}`, { class: "bad", "data-bit": bit }))];
  }));
}

const bits = (all) => [...Array(32).keys()].filter((bit) => Math.floor(all / 2 ** bit) % 2);

export function showEvents(events, t) {
  const lines = [...events].reverse().map((it) => {
    const line = made("li", "", { "data-level": it.level, "data-name": it.name });
    const clock = new Date(it.t * 1000).toLocaleTimeString([], { hour12: false });
    line.append(made("time", clock), made("span", it.service), made("b", it.text));
    return line;
  });
  $("events").replaceChildren(...(lines.length ? lines : [made("li", t("no_events"))]));
}
