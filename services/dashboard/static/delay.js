// The delay of the link: how old a state of safety is when the dashboard has this page's answer to it.
const PERIOD_MS = 90; // between two questions: every other snapshot
const SPAN_MS = 1000; // the greatest delay of this time counts
let asked = []; // times of questions that are not answered
let askedAt = -Infinity;
let samples = []; // { at, delay }

export function begin() {
  asked = [];
  samples = [];
}

/** Return the time to send with a question that is due; null otherwise. */
export function ask(at) {
  if (at - askedAt < PERIOD_MS) return null;
  askedAt = at;
  asked.push(at);
  return at;
}

/** Note an answer: the time that it repeats, and the age in s, null for a state that is not known. */
export function answered({ at, age }, now) {
  asked = asked.filter((it) => it > at);
  samples = samples.filter((it) => now - it.at < SPAN_MS);
  samples.push({ at: now, delay: age ?? (now - at) / 1000 });
}

/** Return the delay in s; at least the time since the oldest question without an answer. */
export function now(at) {
  const recent = samples.filter((it) => at - it.at < SPAN_MS).map((it) => it.delay);
  return Math.max(0, ...recent, asked.length ? (at - asked[0]) / 1000 : 0);
}
