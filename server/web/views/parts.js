// Small elements used by several pages.

import {h, setText} from "../lib/dom.js";
import {stateText} from "../lib/format.js";

export function stateBadge(state) {
  return h("span", {class: `state ${state}`}, stateText(state));
}

// Returns a box with a Problem or a job's error, and with its code.
export function problemBox(problem, title = null) {
  return h(
      "div", {class: "problem"}, title && h("strong", {}, title),
      h("p", {}, problem.detail || problem.message),
      h("p", {class: "code"}, problem.code, problem.status ? ` · HTTP ${problem.status}` : null));
}

// Returns an accessible progress bar. Its update(fraction) takes 0 to 1; null if the fraction is
// unknown.
export function meter(label) {
  const full = h("div", {class: "meter-full"});
  const element =
      h("div", {
        class: "meter",
        role: "progressbar",
        "aria-label": label,
        "aria-valuemin": "0",
        "aria-valuemax": "100"
      },
        full);
  const update = (fraction) => {
    element.classList.toggle("unknown", fraction === null);
    full.style.width = fraction === null ? "" : `${(100 * fraction).toFixed(2)}%`;
    if (fraction === null) element.removeAttribute("aria-valuenow");
    else element.setAttribute("aria-valuenow", String(Math.floor(100 * fraction)));
  };
  return {element, update};
}

// Returns a button that copies `text` to the clipboard.
export function copyButton(text, what) {
  const button =
      h("button", {type: "button", class: "quiet small", "aria-label": `Copy ${what}`}, "Copy");
  button.addEventListener("click", async () => {
    const copied = await copy(text);
    setText(button, copied ? "Copied" : "Select and press Ctrl-C");
    setTimeout(() => setText(button, "Copy"), 2000);
  });
  return button;
}

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);  // not available on plain http
    return true;
  } catch {
    return false;
  }
}
