// The panels of text: causes, limits, drivers, switches, services, events.
import { capital, combined, gap, translated } from "./phrases.js";

const $ = (id) => document.getElementById(id);
const BITS = ["over_current", "over_voltage", "encoder", "under_voltage", "overload"];

function create(tag, text = "", attributes = {}) {
  const it = document.createElement(tag);
  it.textContent = text;
  for (const [name, value] of Object.entries(attributes)) it.setAttribute(name, value);
  return it;
}

// Redrawn only when the content changes, for text selections and screen readers.
function fill(element, stamp, make) {
  if (element.dataset.stamp === stamp) return;
  element.dataset.stamp = stamp;
  element.replaceChildren(...make());
}

export function duration(seconds) {
  if (seconds == null) return "–";
  if (seconds < 100) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  if (seconds < 6000) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

const LIMITS = {
  limit: (it) => it.effect === "slow",
  limit_stop: (it) => it.effect === "stop" && !it.silent,
  limit_silent: (it) => it.effect === "stop" && it.silent,
};

/** Return the text of a cause; a limit with its sources and their own reasons. */
export function causeText(cause, safety, t) {
  const known = t(`cause.${cause.name}`) !== `cause.${cause.name}`; // a newer safety may have other causes
  const by = (safety.limit_sources ?? []).filter(LIMITS[cause.name] ?? (() => false));
  if (!by.length) return known ? t(`cause.${cause.name}`) : cause.text;
  return t(`limited.${cause.name}`, by.map((it) => it.source + (it.reason && ` (${it.reason})`)).join(" · "));
}

/** Return what is missing between safety and the wheels; empty if nothing is. */
export const rootText = ({ root }, t) => (["", "router", "safety"].includes(root.part) ? "" : t(`root.${root.part}`));

function rootLine({ root, safety }, t, language) {
  const line = create("li", t(`root.${root.part}`), { "data-action": "stop", "data-cause": root.part });
  const following = safety.causes.filter((it) => root.folded.includes(it.name)).map((it) => translated(it.text, language));
  if (following.length) line.append(create("small", t("follows", following.join(gap(language)))));
  return line;
}

export function showCauses(fast, t, language) {
  const { safety, root } = fast;
  const causes = (safety?.causes ?? []).filter((it) => !root.folded.includes(it.name));
  const shown = causes.map((it) => [it, it.age < 10 ? it.age?.toFixed(1) : Math.floor(it.age)]);
  const roots = rootText(fast, t) ? [rootLine(fast, t, language)] : [];
  const stamp = JSON.stringify([roots.map((it) => it.textContent), shown.map(([it, age]) => [it.name, it.text, age]), safety?.latched, t("why")]);
  if (!causes.length && !roots.length) {
    fill($("causes"), stamp, () => [create("li", t(safety ? "no_causes" : "unknown"))]);
  } else fill($("causes"), stamp, () => [...roots, ...shown.map(([it]) => {
    const text = causeText(it, safety, t);
    const line = create("li", text, { "data-action": it.action, "data-cause": it.name });
    const latched = safety.latched.includes(it.name) ? ` · ${t("latched")}` : "";
    const details = translated(it.text, language);
    const same = LIMITS[it.name] || details === text;
    const more = same ? "" : `${details} · `;
    line.append(create("small", more + t("since", duration(it.age)) + latched));
    return line;
  })]);
  const limits = safety?.limits;
  fill($("limits"), JSON.stringify([limits, t("why")]), () => [
    ["forward", limits?.forward, "m/s"], ["backward", limits?.backward, "m/s"],
    ["turning", limits?.angular, "rad/s"],
  ].map(([name, value, unit]) => {
    const cell = create("div");
    cell.append(create("b", value == null ? "–" : value.toFixed(2)), create("small", `${t(name)} ${unit}`));
    return cell;
  }));
}

export function showSlow(slow, t) {
  showDrivers(slow, t);
  for (const name of ["ultrasonic_brake", "bumper_brake"]) {
    const on = slow.switches?.[name];
    $(name).textContent = t(name, on === true ? t("on") : on === false ? t("off") : t("unknown"));
    $(name).dataset.on = String(on);
  }
  $("services").replaceChildren(
    row("th", ["service", "alive", "version", "uptime", "lateness", "memory"].map((it) => [t(it)])),
    ...Object.entries(slow.instances).map(([name, instances]) => service(name, instances, slow.health[name], t)),
  );
}

function row(tag, cells) {
  const line = create("tr");
  line.append(...cells.map(([text, kind]) => create(tag, text, kind ? { class: kind } : {})));
  return line;
}

function service(name, instances, health, t) {
  const state = instances ? (health ? "alive" : "silent") : "gone";
  const line = row("td", [
    [name], [t(state) + (instances > 1 ? ` ×${instances}` : ""), state === "alive" ? "" : "bad"],
    ...(health ? [[health.version], [duration(health.uptime)], [`${(health.lateness * 1000).toFixed(0)} ms`],
      [`${(health.rss / 1e6).toFixed(0)} MB`]] : []),
  ]);
  line.dataset.service = name;
  line.dataset.state = state;
  const counters = Object.entries(health?.counters ?? {}).filter(([, count]) => count).map((it) => it.join(" "));
  if (counters.length) line.firstChild.append(create("small", counters.join(", ")));
  return line;
}

function showDrivers(slow, t) {
  const stamp = JSON.stringify([slow.left, slow.right, t("left")].map((it) => [it?.bits ?? it, it?.faults]));
  fill($("drivers"), stamp, () => ["left", "right"].flatMap((side) => {
    const driver = slow[side];
    const cell = create("div");
    cell.append(create("b", t(side)), driver ? (driver.bits ? "" : t("no_fault")) : t("unknown"));
    const faults = driver ? bits(driver.bits) : [];
    return [cell, ...faults.map((bit) => create("div",
      t("bit", t(side), bit, t(`fault.${BITS[bit] ?? "reserved"}`)), { class: "bad", "data-bit": bit }))];
  }));
}

const bits = (all) => [...Array(32).keys()].filter((bit) => Math.floor(all / 2 ** bit) % 2);

// The kind of an event, in English by its name; its own text follows, as it has the figures.
function eventTexts({ service, name, text }, t, language) {
  const keys = [`event.${service}.${name}`, `event.${name}`];
  const key = keys.find((it) => t(it) !== it); // a newer service may have other events
  const kind = language === "en" ? name.split("_").join(" ").replace("estop", "emergency stop") : t(key ?? "");
  const [title, details] = combined(kind, translated(text, language));
  return [capital(title) + (details && language === "en" ? ": " : ""), details];
}

export function showEvents(events, t, language) {
  const lines = [...events].reverse().map((it) => {
    const line = create("li", "", { "data-level": it.level, "data-name": it.name });
    const clock = new Date(it.t * 1000).toLocaleTimeString([], { hour12: false });
    const [title, details] = eventTexts(it, t, language);
    const body = create("b", title);
    if (details) body.append(create("small", details));
    line.append(create("time", clock), create("span", it.service), body);
    return line;
  });
  $("events").replaceChildren(...(lines.length ? lines : [create("li", t("no_events"))]));
}
