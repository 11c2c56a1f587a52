// The panels of text: causes, limits, drivers, switches, services, events.
import { joined, t } from "./i18n.js";

const $ = (id) => document.getElementById(id);
const BITS = ["over_current", "over_voltage", "encoder", "under_voltage", "overload"];

export function create(tag, text = "", attributes = {}) {
  const it = document.createElement(tag);
  it.textContent = text;
  for (const [name, value] of Object.entries(attributes)) it.setAttribute(name, value);
  return it;
}

// Redrawn only when the content changes, for text selections and screen readers.
export function fill(element, stamp, make) {
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

/** Return what is missing between safety and the wheels; empty if nothing is. */
export const rootText = ({ root }) => (["", "router", "safety"].includes(root.part) ? "" : t(`root.${root.part}`));

function rootLine({ root, safety }) {
  const line = create("li", t(`root.${root.part}`), { "data-action": "stop", "data-cause": root.part });
  const following = safety.causes.filter((it) => root.folded.includes(it.name)).map((it) => t(it.text));
  if (following.length) line.append(create("small", t("follows", joined(following))));
  return line;
}

export function showCauses(fast) {
  const { safety, root } = fast;
  const causes = (safety?.causes ?? []).filter((it) => !root.folded.includes(it.name));
  const shown = causes.map((it) => [it, it.age < 10 ? it.age?.toFixed(1) : Math.floor(it.age)]);
  const roots = rootText(fast) ? [rootLine(fast)] : [];
  const stamp = JSON.stringify([roots.map((it) => it.textContent), shown.map(([it, age]) => [it.name, t(it.text), age]), safety?.latched, t("why")]);
  if (!causes.length && !roots.length) {
    fill($("causes"), stamp, () => [create("li", t(safety ? "no_causes" : "unknown"))]);
  } else fill($("causes"), stamp, () => [...roots, ...shown.map(([it]) => {
    const line = create("li", t(it.text), { "data-action": it.action, "data-cause": it.name });
    const latched = safety.latched.includes(it.name) ? ` · ${t("latched")}` : "";
    line.append(create("small", t("since", duration(it.age)) + latched));
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

export function showSlow(slow) {
  showDrivers(slow);
  showMap(slow.map);
  for (const name of ["ultrasonic_brake", "bumper_brake"]) {
    const on = slow.switches?.[name];
    $(name).textContent = t(name, on === true ? t("on") : on === false ? t("off") : t("unknown"));
    $(name).dataset.on = String(on);
  }
  $("services").replaceChildren(
    row("th", ["service", "alive", "version", "uptime", "lateness", "memory"].map((it) => [t(it)])),
    ...Object.entries(slow.instances).map(([name, instances]) => service(name, instances, slow.health[name])),
  );
}

function row(tag, cells) {
  const line = create("tr");
  line.append(...cells.map(([text, kind]) => create(tag, text, kind ? { class: kind } : {})));
  return line;
}

function service(name, instances, health) {
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

/** Show the pose in the map under the trajectory, with the ellipse of its uncertainty. */
function showMap(map) {
  const degrees = (angle) => Math.round(angle * 180 / Math.PI);
  const at = map?.pose && t("map_at", map.pose[0].toFixed(2), map.pose[1].toFixed(2), degrees(map.pose[2]));
  const text = joined([t(map?.text), at, map?.ellipse && t("map_ellipse")]);
  if ($("map").textContent !== text) $("map").textContent = text;
  $("map").dataset.state = map?.state ?? "";
}

function showDrivers(slow) {
  const stamp = JSON.stringify([slow.left, slow.right, t("left")].map((it) => [it?.bits ?? it, it?.faults]));
  fill($("drivers"), stamp, () => ["left", "right"].flatMap((side) => {
    const driver = slow[side];
    const cell = create("div");
    cell.append(create("b", t(side)), driver ? (driver.bits ? "" : t("no_fault")) : t("unknown"));
    const faults = driver ? bits(driver.bits) : [];
    return [cell, ...faults.map((bit) => create("div",
      t("bit", bit, t(`fault.${BITS[bit] ?? "reserved"}`)), { class: "bad", "data-bit": bit }))];
  }));
}

const bits = (all) => [...Array(32).keys()].filter((bit) => Math.floor(all / 2 ** bit) % 2);

export function showEvents(events) {
  const lines = [...events].reverse().map((it) => {
    const line = create("li", "", { "data-level": it.level, "data-name": it.name });
    const clock = new Date(it.t * 1000).toLocaleTimeString([], { hour12: false });
    line.append(create("time", clock), create("span", t(it.service)), create("b", t(it.text)));
    return line;
  });
  $("events").replaceChildren(...(lines.length ? lines : [create("li", t("no_events"))]));
}
