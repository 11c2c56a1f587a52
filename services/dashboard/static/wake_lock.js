// Keeps the screen on while this page drives or keeps the emergency stop alive. A browser without
// wake locks, or a page without https, shows that the screen may turn off.
let lock = null;
let isAsking = false;

/** Hold the lock or give it back; return whether the screen may turn off although it must not. */
export function update(isNeeded) {
  if (!isNeeded) {
    lock?.release().catch(() => {});
    lock = null;
  } else if (navigator.wakeLock && !document.hidden && (!lock || lock.released) && !isAsking) {
    isAsking = true;
    navigator.wakeLock.request("screen")
      .then((it) => { lock = it; }, () => {}) // the battery is low
      .then(() => { isAsking = false; });
  }
  return isNeeded && !isAsking && (!lock || lock.released);
}
