// What a page remembers. A browser may forbid storage: then a reload forgets.
export const stored = (item, otherwise, from = "localStorage") => {
  try {
    return window[from].getItem(`t2.${item}`) ?? otherwise;
  } catch {
    return otherwise;
  }
};
export const store = (item, value, to = "localStorage") => {
  try {
    window[to].setItem(`t2.${item}`, value);
  } catch { /* it is forbidden */ }
};
