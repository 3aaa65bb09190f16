// The page of one job, updated by its events.

import {getJson, sleep} from "../lib/api.js";
import {announce, clear, fact, h, setText} from "../lib/dom.js";
import {follow} from "../lib/events.js";
import {
  agoText,
  gridText,
  hasEnded,
  sceneText,
  stateText,
  timeText,
  titleText,
  warningText
} from "../lib/format.js";
import {ClusterView} from "../views/cluster_view.js";
import {CubesView} from "../views/cubes_view.js";
import {ExportsView} from "../views/exports_view.js";
import {actions} from "../views/job_actions.js";
import {LogView} from "../views/log_view.js";
import {copyButton, problemBox, stateBadge} from "../views/parts.js";
import {ProgressView} from "../views/progress_view.js";
import {RatePlot} from "../views/rate_plot.js";
import {resultView} from "../views/result_view.js";
import {Timeline} from "../views/timeline.js";

const kPreviewPauseMs = 1500;
const kEndedPauseMs = 30000;

export function jobPage([id], _, signal) {
  const page = new JobPage(id, signal);
  page.run();
  return {title: `Job ${id}`, content: page.element};
}

class JobPage {
  constructor(id, signal) {
    this.path = `/api/v1/jobs/${id}`;
    this.signal = signal;
    this.job = null;
    this.jobEvents = 0;  // number of events "job" received
    this.places =
        Object.fromEntries(["head", "actions", "error", "warnings", "result", "below"].map(
            (name) => [name, h("div", {class: name})]));
    this.places.error.setAttribute("role", "alert");
    this.link = h("span", {class: "link-state"});
    this.progress = new ProgressView();
    this.timeline = new Timeline();
    this.cluster = new ClusterView();
    this.rate = new RatePlot(`${this.path}/rates`, signal);
    this.cubes = new CubesView(`${this.path}/subvolumes`, signal);
    this.exports = new ExportsView(`${this.path}/exports`, signal);
    this.log = new LogView(`${this.path}/log`, signal);
    this.element = h(
        "div", {class: "stack"}, h("p", {class: "crumb"}, h("a", {href: "#/"}, "Jobs"), this.link),
        h("p", {class: "loading"}, "Loading…"));
  }

  // Follows the job until it has ended, and follows it again if it is retried.
  async run() {
    try {
      this.updateJob(await getJson(this.path, this.signal));
      while (!this.signal.aborted) {
        if (hasEnded(this.job.state)) await this.waitWhileEnded();
        else await this.follow();
      }
    } catch (problem) {
      if (this.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      this.showFailure(problem);
    }
  }

  async follow() {
    await follow(`${this.path}/events`, {
      signal: this.signal,
      onEvent: (name, data) => this.handleEvent(name, data),
      onStatus: (status, problem) => this.showConnection(status, problem),
    });
    setText(this.link, "");
  }

  // Waits before an ended job is fetched again. By then its preview may be ready, or the job may
  // have been retried.
  async waitWhileEnded() {
    const waking = new AbortController();
    this.wake = () => waking.abort();
    this.signal.addEventListener("abort", this.wake, {once: true});
    const previewPending = this.job.state === "succeeded" && !this.job.preview;
    await sleep(previewPending ? kPreviewPauseMs : kEndedPauseMs, waking.signal);
    this.signal.removeEventListener("abort", this.wake);
    if (this.signal.aborted || (waking.signal.aborted && !hasEnded(this.job.state))) return;
    this.updateJob(await getJson(this.path, this.signal));
  }

  handleEvent(name, data) {
    if (name === "job") {
      ++this.jobEvents;
      this.updateJob(data);
    }
    if (name === "progress") this.updateProgress(data);
  }

  updateJob(job) {
    const first = this.job === null;
    const changed = first || this.job.state !== job.state;
    this.job = job;
    if (first) this.buildLayout();
    if (changed) {
      if (!first) announce(`The job is ${stateText(job.state)}.`);
      document.title = `${stateText(job.state)} · ${titleText(job)} · voxdag`;
    }
    this.showHead();
    if (changed) this.showActions();
    clear(this.places.error, errorBox(job));
    if (changed) this.showParts(job);
    clear(
        this.places.warnings,
        job.warnings.length > 0 &&
            h("ul", {class: "notice"},
              job.warnings.map((warning) => h("li", {}, warningText(warning)))));
    this.progress.show(job);
    if (job.progress) this.updateProgress(job.progress);
    this.cubes.update(job);
    this.log.setLive(!hasEnded(job.state));
    if (job.state === "succeeded") resultView(this.places.result, job, this.signal);
    else clear(this.places.result);
    this.exports.update(job);
  }

  updateProgress(progress) {
    this.job.progress = progress;
    this.progress.show(this.job);
    this.timeline.show(this.job);
    this.cluster.show(this.job);
    this.rate.update(this.job, () => this.showParts(this.job));
    this.showParts(this.job);
    this.cubes.update(this.job);
  }

  // Hides the cards that will never have anything to show, because the job has ended. If the job
  // has failed, moves its log next to the error and opens it.
  showParts(job) {
    const ended = hasEnded(job.state), stages = job.progress?.stages ?? [];
    this.rateCard.hidden = this.rate.empty && ended;
    this.stagesCard.hidden = ended && stages.length === 0;
    this.cubesCard.hidden = ended && !(job.progress?.subvolumes?.total > 0);
    this.columns.classList.toggle("one", this.cubesCard.hidden);
    // With the rate, the left column is as high as the subvolumes without this card.
    const place = this.rateCard.hidden ? this.leftColumn : this.places.below;
    if (this.aboutCard.parentElement !== place) place.append(this.aboutCard);
    const fails = job.state === "failed";
    if (fails && !this.hasFailed) {
      this.places.error.after(this.log.element);
      this.log.element.open = true;
    }
    if (!fails && this.hasFailed) this.element.append(this.log.element);
    this.hasFailed = fails;
  }

  async reload() {
    const events = this.jobEvents, job = await getJson(this.path, this.signal);
    // An event that has arrived since the request can have a newer state than the answer.
    if (this.jobEvents === events) this.updateJob(job);
    this.wake?.();
  }

  buildLayout() {
    clear(
        this.element, this.element.firstChild, this.places.head, this.places.actions,
        this.places.error, this.places.warnings, this.progress.element, this.places.result,
        this.exports.element,
        this.columns =
            h("div", {class: "two"},
              this.leftColumn =
                  h("div", {class: "stack"},
                    this.stagesCard =
                        h("section", {class: "card", "aria-labelledby": "stages-title"},
                          h("h2", {id: "stages-title"}, "Stages"), this.timeline.element),
                    this.cluster.element,
                    this.rateCard =
                        h("section", {class: "card", "aria-labelledby": "rate-title"},
                          h("h2", {id: "rate-title"}, "Rate"), this.rate.element),
                    this.aboutCard =
                        h("section", {class: "card", "aria-labelledby": "about-title"},
                          h("h2", {id: "about-title"}, "About this job"),
                          this.about = h("dl", {class: "facts"}))),
              this.cubesCard =
                  h("section", {class: "card", "aria-labelledby": "cubes-title"},
                    h("h2", {id: "cubes-title"}, "Subvolumes"), this.cubes.element)),
        this.places.below, this.log.element);
  }

  showHead() {
    const job = this.job;
    clear(
        this.places.head,
        h("div", {class: "title-row"}, h("h1", {}, titleText(job)), stateBadge(job.state)),
        h("p", {class: "about"}, job.name ? `${sceneText(job)} · ` : "", gridText(job.resolution)));
    const when = (time) =>
        time ? [timeText(time), " ", h("span", {class: "faint unbroken"}, agoText(time))] : ["–"];
    const options =
        Object.entries(job.options || {}).map(([name, value]) => `${name} ${value}`).join(", ");
    clear(
        this.about, fact("Id", h("code", {}, job.id), " ", copyButton(job.id, "the job's id")),
        fact("Scene", [job.scene].flat().join(", ")), fact("Options", options || "default"),
        job.labels?.length > 0 &&
            fact(
                "Labels",
                job.labels.flatMap(
                    (label) =>
                        [h("a", {href: `#/?${new URLSearchParams({q: label})}`}, label), " "])),
        job.webhook && fact("Webhook", webhookText(job.webhook)),
        fact("Priority", String(job.priority)),
        fact("Attempts", `${job.attempts} of ${job.max_attempts}`),
        fact("Created", ...when(job.created_at)), fact("Started", ...when(job.started_at)),
        fact("Finished", ...when(job.finished_at)));
  }

  // Shows the buttons for the job's state. If an old button had the keyboard focus, moves the focus
  // to the first new button.
  showActions() {
    const hadFocus = this.places.actions.contains(document.activeElement);
    clear(this.places.actions, actions(this.job, () => this.reload()));
    if (hadFocus) this.places.actions.querySelector("button, a")?.focus();
  }

  showConnection(status, problem) {
    this.link.className = `link-state ${status}`;
    setText(
        this.link,
        status === "live" ? "live" : `reconnecting: ${problem?.message || "the stream closed"}`);
  }

  showFailure(problem) {
    clear(
        this.element, this.element.firstChild, problemBox(problem),
        h("div", {class: "buttons"}, h("a", {class: "button", href: "#/"}, "All jobs")));
  }
}

// Returns a box with the job's last error; null without an error or if the job has succeeded since.
// Returns a text such as "delivered to https://hooks.example.org:443".
function webhookText({origin, state, attempts, error, next_attempt_at: nextAt}) {
  const texts = {
    waiting: "when the job has ended, to",
    pending: "not yet delivered to",
    delivered: "delivered to",
    failed: "could not be delivered to"
  };
  const tries =
      attempts > 1 || error ? ` · ${attempts} ${attempts === 1 ? "attempt" : "attempts"}` : "";
  return `${texts[state] ?? state} ${origin}${tries}` + (error ? ` · ${error}` : "") +
      (error && nextAt ? ` · next attempt ${timeText(nextAt)}` : "");
}

function errorBox(job) {
  if (!job.error || job.state === "succeeded") return null;
  const problem = {code: job.error.code, detail: job.error.message};
  if (job.state === "failed") return problemBox(problem, "This job failed.");
  if (job.not_before && Date.parse(job.not_before) > Date.now())
    return problemBox(
        problem, `An attempt failed; the next one starts ${agoText(job.not_before)}.`);
  return job.state === "canceled" ? null : problemBox(problem, "An earlier attempt failed.");
}
