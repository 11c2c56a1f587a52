// The language of the page, and the texts of the server in it.
const GAP = { en: " ", zh: "" }; // between two sentences
const $ = (id) => document.getElementById(id);

let table = {}; // by language, then by name
export let language = navigator.language.startsWith("zh") ? "zh" : "en";

/** Take the texts of the server, and the language of an earlier visit. */
export function begin(stored) {
  table = JSON.parse($("texts").textContent);
  if (stored in table) language = stored;
}

/** Change to the other language, and return it. */
export function change() {
  language = language === "en" ? "zh" : "en";
  return language;
}

/**
 * Return a text in the language of the page: one of the table by its name, or one from the server in
 * both languages. Values take the places of its `{}`.
 */
export function t(text, ...values) {
  const found = typeof text === "string" ? table[language]?.[text] ?? text : text?.[language] ?? "";
  return values.reduce((all, it) => all.replace("{}", () => it), found);
}

/** Return sentences as one text, without the empty ones. */
export const joined = (sentences) => sentences.filter(Boolean).join(GAP[language]);
