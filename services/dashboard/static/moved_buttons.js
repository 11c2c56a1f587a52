// Buttons that take the place of the stick or the gears once the page has rearranged itself: a press that was
// meant for what was there before is refused, until none came for REST_MS.
const USED = "#stick, #gears";
const MOVED = "#reset, #release";
const REST_MS = 1500;
let used = null; // { box, refused }: of the control that was pressed last; when a press was refused there
let refused = null; // the button whose click belongs to a refused press

const contains = (box, { clientX: x, clientY: y }) => x >= box.left && x <= box.right && y >= box.top && y <= box.bottom;

function isMeantForOther(event) {
  if (!used || !contains(used.box, event)) return false;
  const now = performance.now();
  if (now - used.refused > REST_MS) used = null;
  else used.refused = now;
  return used !== null;
}

/** Refuse such presses; `told` is called for each. */
export function begin(told) {
  document.addEventListener("pointerdown", (event) => {
    refused = null;
    const control = event.target.closest?.(USED);
    if (control) used = { box: control.getBoundingClientRect(), refused: Infinity };
    else if (event.target.closest?.(MOVED) && isMeantForOther(event)) {
      event.stopImmediatePropagation();
      refused = event.target;
      told();
    }
  }, true);
  document.addEventListener("click", (event) => {
    if (event.target === refused) event.stopImmediatePropagation();
    refused = null;
  }, true);
}
