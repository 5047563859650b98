/** What several panes use: pictures, errors, announcements, workers. */

/** Show a picture in an image, in place of the picture before. */
export function showBlob(image, blob) {
  if (image.src) URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(blob);
}

/** Act, and report the error, or null, to `trouble`. Whether it went well. */
export async function attempt(trouble, act) {
  try {
    await act();
    trouble(null);
    return true;
  } catch (error) {
    trouble(error);
    return false;
  }
}

/** Set a text that a screen reader announces, if it changes. */
export function announce(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** Limits of a seed: numbers that JSON holds exactly. */
export const SEEDS = { min: "0", max: "9007199254740991", step: "1", required: "" };

/** Prepare workers for `parents`; while they start, and while another pane or run breeds, show so by `show`. Returns the
 * state of the brood. */
export async function readyWorkers(server, body, show, isShown = () => true) {
  while (isShown()) {
    const timer = setTimeout(() => show("starting workers …"), 400);
    let state = null;
    try {
      state = await server.postJson("ready", body);
    } finally {
      clearTimeout(timer);
      show(state && state.waits ? "Studio still breeds other children; this pane waits …" : "");
    }
    if (!state.waits) return state;
    await pause(250);
  }
  return null;
}
