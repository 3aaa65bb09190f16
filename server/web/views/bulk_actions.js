// Buttons for actions on several selected jobs of a list.

import {sendJson} from "../lib/api.js";
import {announce, clear, confirmAction, h, setText} from "../lib/dom.js";
import {hasEnded} from "../lib/format.js";

import {problemBox} from "./parts.js";

// The actions. applies(job) returns true if the action is possible in the state of the job.
// request(job) sends the request. `kind` is the CSS class of the button.
const kActions = [
  {
    name: "Cancel",
    applies: (job) => ["queued", "running", "suspended"].includes(job.state),
    request: (job) => sendJson("POST", `${job.links.self}/cancel`),
    kind: "danger"
  },
  {
    name: "Retry",
    applies: (job) => ["failed", "canceled"].includes(job.state),
    request: (job) => sendJson("POST", `${job.links.self}/retry`),
    kind: ""
  },
  {
    name: "Delete",
    applies: (job) => hasEnded(job.state),
    request: (job) => sendJson("DELETE", job.links.self),
    kind: "danger"
  },
];

export class BulkActions {
  // reload() reloads the list; it is called after each action.
  constructor(reload) {
    this.reload = reload;
    this.selected = new Map();  // job id -> job
    this.text = h("span", {class: "faint"});
    this.error = h("div", {role: "alert"});
    this.buttons = kActions.map(
        (action) =>
            h("button", {
              type: "button",
              class: `small ${action.kind}`,
              "data-bulk": action.name.toLowerCase(),
              on: {click: () => this.run(action)}
            },
              action.name));
    this.bar = h("div", {class: "buttons bulk", hidden: true}, this.text, this.buttons);
    this.element = h("div", {}, this.bar, this.error);
  }

  // Returns a checkbox that selects the job. `title` is the name of the job.
  checkbox(job, title) {
    const box = h("input", {type: "checkbox", "aria-label": `Select ${title}`});
    box.addEventListener("change", () => {
      if (box.checked) this.selected.set(job.id, job);
      else this.selected.delete(job.id);
      this.show();
    });
    return box;
  }

  // Replaces the selected jobs by their current state in `jobs`, the jobs of the list. Jobs that
  // are no longer in the list are deselected.
  update(jobs) {
    const byId = new Map(jobs.map((job) => [job.id, job]));
    for (const id of [...this.selected.keys()])
      if (byId.has(id)) this.selected.set(id, byId.get(id));
      else this.selected.delete(id);
    this.show();
  }

  show() {
    const jobs = [...this.selected.values()];
    this.bar.hidden = jobs.length === 0;
    setText(this.text, `${jobs.length} selected`);
    kActions.forEach((action, i) => {
      const count = jobs.filter(action.applies).length;
      this.buttons[i].hidden = count === 0;
      setText(this.buttons[i], count === jobs.length ? action.name : `${action.name} ${count}`);
    });
  }

  // Runs the action for all selected jobs to which it applies, one job after the other so that the
  // service does not get many requests at the same time. Stops at the first error.
  async run({name, applies, request}) {
    const jobs = [...this.selected.values()].filter(applies);
    const what = jobs.length === 1 ? "this job" : `${jobs.length} jobs`;
    clear(this.error);
    if (name !== "Retry" &&
        !await confirmAction(`${name} ${what}?`, kConsequences[name], `${name} ${what}`))
      return;
    try {
      for (const job of jobs) await request(job);
      announce(`${name}: ${jobs.length} ${jobs.length === 1 ? "job" : "jobs"}`);
    } catch (problem) {
      if (problem.code === undefined) throw problem;
      clear(this.error, problemBox(problem));
    }
    await this.reload();
  }
}

const kConsequences = {
  Cancel: "Their partial results will be deleted.",
  Delete: "Their results, reports and logs will be deleted.",
};
