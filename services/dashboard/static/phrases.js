// Sentences of the services, which are in English, in the language of the page.
const SENTENCES = /([.!?]) (?=[A-Za-z])/g; // what separates two of them; not every browser can look behind
let words = {}; // English sentence or word: translation
let patterns = []; // [expression, translation] of sentences with placeholders

const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");

/** Take the table of phrases: English with `{}` for names and figures, and the translation. */
export function begin(table) {
  words = Object.assign(Object.create(null), table);
  patterns = Object.entries(table).filter(([english]) => english.includes("{}")).map(([english, other]) =>
    [new RegExp(`^${english.split("{}").map(escaped).join("(.+?)")}$`), other]);
}

/** Return a text in the language of the page; an unknown sentence stays in English. */
export function translated(text, language) {
  if (language === "en" || !text) return text;
  if (text in words) return words[text]; // one of several sentences
  return text.replace(SENTENCES, "$1\n").split("\n").map((it) => phrase(it) ?? ` ${it} `).join("").trim();
}

const core = (text) => text.toLowerCase().replace(/[。.]$/, "");

/** Return a title and its details, or one of them where it has the other. */
export function combined(title, details) {
  if (core(details).includes(core(title))) return [details];
  return core(title).includes(core(details)) ? [title] : [title, details];
}

export const capital = (text) => text.slice(0, 1).toUpperCase() + text.slice(1);

/** What separates two sentences. */
export const gap = (language) => (language === "en" ? " " : "");

// Null for an unknown sentence. A placeholder holds a figure, a name, a list of names, or a phrase.
function phrase(text) {
  if (text in words) return words[text];
  for (const [expression, other] of patterns) {
    const found = expression.exec(text)?.slice(1);
    if (found) return other.replace(/\{\}/g, () => argument(found.shift()));
  }
  return null;
}

const argument = (text) => phrase(text) ?? text.split(", ").map((it) => words[it] ?? it).join("，");
