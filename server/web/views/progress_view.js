// The current stage of a job, and the numbers of the attempt.

import {h, set_text} from "../lib/dom.js";
import {count_text, done_fraction, duration_text, has_ended, short_count, size_text, unit_text} from "../lib/format.js";
import {meter, update_job_meter} from "./parts.js";

const kFigures = [
  ["elapsed", "Elapsed", (p) => duration_text(p.elapsed_s)],
  ["voxels", "Voxels", (p) => short_count(p.voxels)],
  ["nodes", "Nodes", (p) => short_count(p.nodes)],
  ["bytes", "Artifacts", (p) => size_text(p.bytes)],
  ["memory", "Memory", (p) => size_text(p.memory_bytes)],
  ["disk", "Disk", (p) => size_text(p.disk_bytes)],
];

export class ProgressView {
  constructor() {
    this.stage = h("strong", {class: "stage-now"});
    this.percent = h("span", {class: "percent"});
    this.bar = meter("progress of the current stage");
    this.detail = h("p", {class: "detail"});
    this.values = {};
    const figures = kFigures.map(([key, name]) =>
      h("div", {class: "figure"}, h("dt", {}, name), this.values[key] = h("dd", {}, "–")));
    this.figures = h("dl", {class: "figures"}, figures);
    this.element = h("section", {class: "card progress", "aria-label": "Progress"},
      h("div", {class: "stage-row"}, this.stage, this.percent), this.bar.element, this.detail, this.figures);
  }

  show(job) {
    const p = job.progress;
    this.element.hidden = job.state === "succeeded";
    update_job_meter(this.bar, job);
    set_text(this.stage, headline(job));
    const fraction = done_fraction(p);
    set_text(this.percent, fraction === null || job.state === "queued" ? "" : percent_text(fraction));
    set_text(this.detail, detail_text(job));
    this.figures.hidden = !p;
    if (p) for (const [key, , text] of kFigures) set_text(this.values[key], text(p));
  }
}

function percent_text(fraction) {
  return fraction > 0 && fraction < 0.1 ? `${(Math.floor(1000 * fraction) / 10).toFixed(1)} %` : `${Math.floor(100 * fraction)} %`;
}

function headline(job) {
  const stage = job.progress?.stage;
  switch (job.state) {
    case "queued": return job.position ? `Number ${job.position} in the queue` : "Waiting in the queue";
    case "suspended": return stage ? `Suspended in ${stage}` : "Suspended";
    case "canceling": return "Canceling…";
    case "canceled": return stage ? `Canceled in ${stage}` : "Canceled";
    case "failed": return stage ? `Failed in ${stage}` : "Failed";
    default: return stage || "Starting…";
  }
}

function detail_text(job) {
  const p = job.progress;
  if (!p || !p.stage) return "";
  const far = p.total ? `${count_text(p.done)} of ${unit_text(count_text(p.total), p.unit)}`
                      : unit_text(count_text(p.done), p.unit);
  if (has_ended(job.state) || job.state !== "running") return far;
  return [far, p.rate > 0 && `${short_count(p.rate)} ${p.unit} per second`,
          p.eta_s > 0 && `${duration_text(p.eta_s)} left in this stage`].filter(Boolean).join(" · ");
}
