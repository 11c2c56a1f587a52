// Charts of requested, allowed and measured motion over the last 30 s.
import { t } from "./i18n.js";

const SPAN_MS = 30000;
const LINES = ["requested", "allowed", "measured"];
const samples = [];

export function add(snapshot, at) {
  const { requested, allowed, measured } = snapshot;
  samples.push({ at, requested, allowed, measured });
  while (samples.length && at - samples[0].at > SPAN_MS) samples.shift();
}

export function fitted(canvas) {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [wide, high] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

export function draw() {
  const css = getComputedStyle(document.documentElement);
  chart("chart-speed", 0, 0.5, t("chart.speed"), css);
  chart("chart-turn", 1, 0.5, t("chart.turn"), css);
}

function chart(id, axis, least, title, css) {
  const [pen, width, height] = fitted(document.getElementById(id));
  const end = samples.at(-1)?.at ?? 0;
  const most = samples.reduce((top, one) =>
    LINES.reduce((high, line) => Math.max(high, Math.abs(one[line]?.[axis] ?? 0)), top), least) * 1.1;
  const x = (at) => width - ((end - at) / SPAN_MS) * width;
  const y = (value) => height / 2 - (value / most) * (height / 2 - 18); // the title stands above
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = css.getPropertyValue("--quiet");
  pen.strokeStyle = css.getPropertyValue("--line");
  pen.lineWidth = 1;
  for (const value of [-most / 1.1, 0, most / 1.1]) {
    pen.beginPath();
    pen.moveTo(0, y(value));
    pen.lineTo(width, y(value));
    pen.stroke();
    pen.fillText(value.toFixed(1), 2, y(value) - 3);
  }
  pen.textAlign = "center";
  pen.fillText(title, width / 2, 12);
  pen.textAlign = "start";
  for (const line of LINES) {
    pen.strokeStyle = css.getPropertyValue(`--${line}`);
    pen.lineWidth = line === "measured" ? 2.5 : 2;
    pen.beginPath();
    let down = false;
    for (const one of samples) {
      const value = one[line]?.[axis];
      if (value == null) down = false;
      else if (down) pen.lineTo(x(one.at), y(value));
      else {
        pen.moveTo(x(one.at), y(value));
        down = true;
      }
    }
    pen.stroke();
  }
}
