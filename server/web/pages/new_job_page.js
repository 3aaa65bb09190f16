// The form for a new job: its scene, grid and options, and an estimate of the build's cost.

import {getJson, randomKey, sendJson} from "../lib/api.js";
import {clear, field, h} from "../lib/dom.js";
import {EstimateView} from "../views/estimate_view.js";
import {JobOptions} from "../views/job_options.js";
import {problemBox} from "../views/parts.js";
import {SceneChoice} from "../views/scene_choice.js";

export function newJobPage(_, query, signal) {
  const form = new NewJob(signal);
  form.begin(query.get("like"));
  return {title: "New job", content: form.element};
}

class NewJob {
  constructor(signal) {
    this.signal = signal;
    this.scene = new SceneChoice(signal, () => this.changed());
    this.options = new JobOptions(() => this.changed());
    this.estimate = new EstimateView(signal);
    this.name = h("input", {
      maxlength: "200",
      autocomplete: "off",
      on: {
        change: () => {
          this.key = randomKey();
        }
      }
    });
    this.labels = h("input", {autocomplete: "off", on: {change: () => this.changed()}});
    this.error = h("div", {role: "alert"});
    // The idempotency key changes only when the user changes the form. So two requests for the same
    // form, for example after a double click, create only one job.
    this.key = randomKey();
    this.submit = h("button", {class: "primary"}, "Submit");
    this.element =
        h("form", {class: "stack", novalidate: true},
          h("p", {class: "crumb"}, h("a", {href: "#/"}, "Jobs")), h("h1", {}, "New job"),
          h("div", {class: "two form-two"},
            h("div", {class: "stack"}, this.scene.element,
              h("section", {class: "card stack", "aria-labelledby": "grid-title"},
                h("h2", {id: "grid-title"}, "Grid"), this.options.resolutionField,
                this.options.colorSwitch),
              h("section", {class: "card stack", "aria-labelledby": "job-title"},
                h("h2", {id: "job-title"}, "Job"), field("Name of the job", this.name, "Optional."),
                field("Labels", this.labels, "Optional, separated by commas.")),
              this.options.element),
            h("div", {class: "stack sticky"}, this.estimate.element, this.error,
              h("div", {class: "buttons"}, this.submit))));
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      this.submitJob();
    });
  }

  // Fills in the form. `like` is the id of a job from which the scene and the options are copied.
  async begin(like) {
    try {
      const model =
          like ? await getJson(`/api/v1/jobs/${encodeURIComponent(like)}`, this.signal) : null;
      await this.scene.load(model ? [model.scene].flat() : null);
      if (model) this.options.set(model);
      if (model?.labels) this.labels.value = model.labels.join(", ");
      this.changed();
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      clear(this.error, problemBox(problem));
    }
  }

  // Returns the request body; null if no scene is chosen. Throws Problem for an invalid field.
  body() {
    const scene = this.scene.value();
    if (!scene) return null;
    const name = this.name.value.trim();
    const labels = this.labels.value.split(",").map((label) => label.trim()).filter(Boolean);
    return {scene, ...(name && {name}), ...(labels.length && {labels}), ...this.options.values()};
  }

  changed() {
    clear(this.error);
    this.key = randomKey();
    let question = null;
    try {
      const body = this.body();
      if (body) question = {scene: body.scene, resolution: body.resolution, options: body.options};
    } catch {
      // The error is reported when the job is submitted, not while the user types.
    }
    this.estimate.update(question);
  }

  async submitJob() {
    clear(this.error);
    this.submit.disabled = true;
    try {
      const body = this.body();
      if (!body) {
        clear(this.error, h("p", {class: "bad"}, "Choose a scene, or upload one."));
        return;
      }
      const job = await sendJson(
          "POST", "/api/v1/jobs", body,
          {headers: {"Idempotency-Key": this.key}, signal: this.signal});
      location.hash = `#/jobs/${job.id}`;
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      clear(this.error, problemBox(problem));
    } finally {
      this.submit.disabled = false;
    }
  }
}
