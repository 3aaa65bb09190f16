// The page of one job, updated by its events.

import {get_json, sleep} from "../lib/api.js";
import {ClusterView} from "../views/cluster_view.js";
import {CubesView} from "../views/cubes_view.js";
import {announce, clear, fact, h, set_text} from "../lib/dom.js";
import {follow} from "../lib/events.js";
import {ago_text, grid_text, has_ended, scene_text, state_text, time_text, title_text} from "../lib/format.js";
import {actions} from "../views/job_actions.js";
import {LogView} from "../views/log_view.js";
import {copy_button, problem_box, state_badge} from "../views/parts.js";
import {ProgressView} from "../views/progress_view.js";
import {RatePlot} from "../views/rate_plot.js";
import {result_view} from "../views/result_view.js";
import {Timeline} from "../views/timeline.js";

const kPreviewPause_ms = 1500;
const kEndedPause_ms = 30000;

export function job_page([id], _, signal) {
  const page = new JobPage(id, signal);
  page.run();
  return {title: `Job ${id}`, content: page.element};
}

class JobPage {
  constructor(id, signal) {
    this.path = `/api/v1/jobs/${id}`;
    this.signal = signal;
    this.job = null;
    this.places = Object.fromEntries(
      ["head", "actions", "error", "warnings", "result"].map((name) => [name, h("div", {class: name})]));
    this.places.error.setAttribute("role", "alert");
    this.link = h("span", {class: "link-state"});
    this.progress = new ProgressView();
    this.timeline = new Timeline();
    this.cluster = new ClusterView();
    this.rate = new RatePlot(id);
    this.cubes = new CubesView(`${this.path}/subvolumes`, signal);
    this.log = new LogView(`${this.path}/log`, signal);
    this.element = h("div", {class: "stack"}, h("p", {class: "crumb"}, h("a", {href: "#/"}, "Jobs"), this.link),
      h("p", {class: "loading"}, "Loading…"));
  }

  // Follows the job until it has ended, and again if it is retried.
  async run() {
    try {
      this.update_job(await get_json(this.path, this.signal));
      while (!this.signal.aborted) {
        if (has_ended(this.job.state)) await this.wait_while_ended();
        else await this.follow();
      }
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      this.show_failure(problem);
    }
  }

  async follow() {
    await follow(`${this.path}/events`, {
      signal: this.signal,
      on_event: (name, data) => this.handle_event(name, data),
      on_status: (status, problem) => this.show_connection(status, problem),
    });
    set_text(this.link, "");
  }

  // Waits before looking at an ended job again: for its preview, or in case it is retried.
  async wait_while_ended() {
    const waking = new AbortController();
    this.wake = () => waking.abort();
    this.signal.addEventListener("abort", this.wake, {once: true});
    const preview_pending = this.job.state === "succeeded" && !this.job.preview;
    await sleep(preview_pending ? kPreviewPause_ms : kEndedPause_ms, waking.signal);
    this.signal.removeEventListener("abort", this.wake);
    if (this.signal.aborted || (waking.signal.aborted && !has_ended(this.job.state))) return;
    this.update_job(await get_json(this.path, this.signal));
  }

  handle_event(name, data) {
    if (name === "job") this.update_job(data);
    if (name === "progress") this.update_progress(data);
  }

  update_job(job) {
    const first = this.job === null;
    const changed = first || this.job.state !== job.state;
    this.job = job;
    if (first) this.build_layout();
    if (changed) {
      if (!first) announce(`The job is ${state_text(job.state)}.`);
      document.title = `${state_text(job.state)} · ${title_text(job)} · voxdag`;
    }
    this.show_head();
    if (changed) this.show_actions();
    clear(this.places.error, error_box(job));
    clear(this.places.warnings, job.warnings.length > 0 && h("ul", {class: "notice"},
      job.warnings.map((text) => h("li", {}, text))));
    this.progress.show(job);
    if (job.progress) this.update_progress(job.progress);
    this.cubes.update(job);
    this.log.set_live(!has_ended(job.state));
    if (job.state === "succeeded") result_view(this.places.result, job, this.signal);
    else clear(this.places.result);
  }

  update_progress(progress) {
    this.job.progress = progress;
    this.progress.show(this.job);
    this.timeline.show(this.job);
    this.cluster.show(this.job);
    this.rate.add(this.job);
    this.rate_card.hidden = this.rate.empty && has_ended(this.job.state);
    this.cubes.update(this.job);
  }

  async reload() {
    this.update_job(await get_json(this.path, this.signal));
    this.wake?.();
  }

  build_layout() {
    clear(this.element, this.element.firstChild,
      this.places.head, this.places.actions, this.places.error, this.places.warnings,
      this.progress.element, this.places.result,
      h("div", {class: "two"},
        h("div", {class: "stack"},
          h("section", {class: "card", "aria-labelledby": "stages-title"},
            h("h2", {id: "stages-title"}, "Stages"), this.timeline.element),
          this.cluster.element,
          this.rate_card = h("section", {class: "card", "aria-labelledby": "rate-title"},
            h("h2", {id: "rate-title"}, "Rate"), this.rate.element),
          h("section", {class: "card", "aria-labelledby": "about-title"},
            h("h2", {id: "about-title"}, "About this job"), this.about = h("dl", {class: "facts"}))),
        h("section", {class: "card", "aria-labelledby": "cubes-title"},
          h("h2", {id: "cubes-title"}, "Subvolumes"), this.cubes.element)),
      this.log.element);
  }

  show_head() {
    const job = this.job;
    clear(this.places.head, h("div", {class: "title-row"}, h("h1", {}, title_text(job)), state_badge(job.state)),
      h("p", {class: "about"}, job.name ? `${scene_text(job)} · ` : "", grid_text(job.resolution)));
    const when = (time) => time ? [time_text(time), " ", h("span", {class: "faint"}, ago_text(time))] : ["–"];
    const options = Object.entries(job.options || {}).map(([name, value]) => `${name} ${value}`).join(", ");
    clear(this.about,
      fact("Id", h("code", {}, job.id), " ", copy_button(job.id, "the job's id")),
      fact("Scene", [job.scene].flat().join(", ")),
      fact("Options", options || "default"),
      fact("Priority", String(job.priority)),
      fact("Attempts", `${job.attempts} of ${job.max_attempts}`),
      fact("Created", ...when(job.created_at)),
      fact("Started", ...when(job.started_at)),
      fact("Finished", ...when(job.finished_at)));
  }

  // The buttons change with the state; keyboard focus stays among them.
  show_actions() {
    const had_focus = this.places.actions.contains(document.activeElement);
    clear(this.places.actions, actions(this.job, () => this.reload()));
    if (had_focus) this.places.actions.querySelector("button, a")?.focus();
  }

  show_connection(status, problem) {
    this.link.className = `link-state ${status}`;
    set_text(this.link, status === "live" ? "live" : `reconnecting: ${problem?.message || "the stream closed"}`);
  }

  show_failure(problem) {
    clear(this.element, this.element.firstChild, problem_box(problem),
      h("div", {class: "buttons"}, h("a", {class: "button", href: "#/"}, "All jobs")));
  }
}

// The last error, unless the job has succeeded since.
function error_box(job) {
  if (!job.error || job.state === "succeeded") return null;
  const problem = {code: job.error.code, detail: job.error.message};
  if (job.state === "failed") return problem_box(problem, "This job failed.");
  if (job.not_before && Date.parse(job.not_before) > Date.now())
    return problem_box(problem, `An attempt failed; the next one starts ${ago_text(job.not_before)}.`);
  return job.state === "canceled" ? null : problem_box(problem, "An earlier attempt failed.");
}
