// Small parts that several pages show.

import {h, set_text} from "./dom.js";
import {done_part, state_text} from "./format.js";

export function state_badge(state) {
  return h("span", {class: `state ${state}`}, state_text(state));
}

// A Problem, or a job's error, with its code.
export function problem_box(problem, title = null) {
  return h("div", {class: "problem"},
    title && h("strong", {}, title),
    h("p", {}, problem.detail || problem.message),
    h("p", {class: "code"}, problem.code, problem.status ? ` · HTTP ${problem.status}` : null));
}

// A bar that is also read out. update(part) takes 0 to 1, or null for "not known".
export function meter(label) {
  const full = h("div", {class: "meter-full"});
  const element = h("div", {class: "meter", role: "progressbar", "aria-label": label,
                            "aria-valuemin": "0", "aria-valuemax": "100"}, full);
  const update = (part) => {
    element.classList.toggle("unknown", part === null);
    full.style.width = part === null ? "" : `${(100 * part).toFixed(2)}%`;
    if (part === null) element.removeAttribute("aria-valuenow");
    else element.setAttribute("aria-valuenow", String(Math.floor(100 * part)));
  };
  return {element, update};
}

// The meter of a job: its present stage while it runs, full when it succeeded.
export function update_job_meter(bar, job) {
  const part = job.state === "succeeded" ? 1 : done_part(job.progress);
  const idle = ["queued", "suspended", "canceled", "failed"].includes(job.state);
  bar.update(idle && part === null ? 0 : part);
  bar.element.dataset.state = job.state;
}

// A button that copies a text.
export function copy_button(text, what) {
  const button = h("button", {type: "button", class: "quiet small", "aria-label": `Copy ${what}`}, "Copy");
  button.addEventListener("click", async () => {
    const copied = await copy(text);
    set_text(button, copied ? "Copied" : "Select it and press Ctrl-C");
    setTimeout(() => set_text(button, "Copy"), 2000);
  });
  return button;
}

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);  // not there on plain http
    return true;
  } catch {
    return false;
  }
}
