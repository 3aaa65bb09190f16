// The form of a new job: a scene, a grid, options, and what building it would take.

import {get_json, random_key, send_json} from "./api.js";
import {clear, field, h} from "./dom.js";
import {EstimateView} from "./estimate_view.js";
import {JobOptions} from "./job_options.js";
import {problem_box} from "./parts.js";
import {SceneChoice} from "./scene_choice.js";

export function new_job_page(_, query, signal) {
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
    this.name = h("input", {maxlength: "200", autocomplete: "off",
                            on: {change: () => { this.key = random_key(); }}});
    this.trouble = h("div", {role: "alert"});
    this.key = random_key();  // one for what is filled in: pressing the button twice posts one job
    this.submit = h("button", {class: "primary"}, "Post the job");
    this.element = h("form", {class: "stack", novalidate: true},
      h("p", {class: "crumb"}, h("a", {href: "#/"}, "Jobs")), h("h1", {}, "New job"),
      h("div", {class: "two form-two"},
        h("div", {class: "stack"},
          this.scene.element,
          h("section", {class: "card stack", "aria-labelledby": "grid-title"},
            h("h2", {id: "grid-title"}, "Grid"), this.options.resolution_field,
            field("Name of the job", this.name, "Optional, for people.")),
          this.options.element),
        h("div", {class: "stack sticky"}, this.estimate.element, this.trouble,
          h("div", {class: "buttons"}, this.submit))));
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      this.post();
    });
  }

  // `like`: the id of a job whose scene and options are taken over.
  async begin(like) {
    try {
      const model = like ? await get_json(`/api/v1/jobs/${encodeURIComponent(like)}`, this.signal) : null;
      await this.scene.load(model ? [model.scene].flat() : null);
      if (model) this.options.set(model);
      this.changed();
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      clear(this.trouble, problem_box(problem));
    }
  }

  // The request's body, or null while no scene is chosen. Throws Problem for a field that is wrong.
  body() {
    const scene = this.scene.value();
    if (!scene) return null;
    const name = this.name.value.trim();
    return {scene, ...(name && {name}), ...this.options.values()};
  }

  changed() {
    clear(this.trouble);
    this.key = random_key();
    let question = null;
    try {
      const body = this.body();
      if (body) question = {scene: body.scene, resolution: body.resolution, options: body.options};
    } catch {
      // Said when the job is posted, not while it is typed.
    }
    this.estimate.look(question);
  }

  async post() {
    clear(this.trouble);
    this.submit.disabled = true;
    try {
      const body = this.body();
      if (!body) {
        clear(this.trouble, h("p", {class: "bad"}, "Choose a scene, or upload one."));
        return;
      }
      const job = await send_json("POST", "/api/v1/jobs", body,
                                  {headers: {"Idempotency-Key": this.key}, signal: this.signal});
      location.hash = `#/jobs/${job.id}`;
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      clear(this.trouble, problem_box(problem));
    } finally {
      this.submit.disabled = false;
    }
  }
}
