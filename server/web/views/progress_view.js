// Shows the progress of a job over all stages, its current stage, and numbers of its current
// attempt.

import {h, setText} from "../lib/dom.js";
import {countText, durationText, hasEnded, shortCount, sizeText, unitText} from "../lib/format.js";
import {jobProgress, updateJobMeter} from "../lib/job_progress.js";

import {meter} from "./parts.js";

const kFigures = [
  ["elapsed", "Elapsed", (p) => durationText(p.elapsed_s)],
  ["voxels", "Voxels", (p) => shortCount(p.voxels)],
  ["nodes", "Nodes", (p) => shortCount(p.nodes)],
  ["bytes", "Artifacts", (p) => sizeText(p.bytes)],
  ["memory", "Memory", (p) => sizeText(p.memory_bytes)],
  ["disk", "Disk", (p) => sizeText(p.disk_bytes)],
];

export class ProgressView {
  constructor() {
    this.stage = h("strong", {class: "stage-now"});
    this.percent = h("span", {class: "percent"});
    this.bar = meter("progress of the job");
    this.detail = h("p", {class: "detail"});
    this.values = {};
    const figures = kFigures.map(
        ([key, name]) =>
            h("div", {class: "figure"}, h("dt", {}, name), this.values[key] = h("dd", {}, "–")));
    this.figures = h("dl", {class: "figures"}, figures);
    this.element =
        h("section", {class: "card progress", "aria-label": "Progress"},
          h("div", {class: "stage-row"}, this.stage, this.percent), this.bar.element, this.detail,
          this.figures);
  }

  show(job) {
    const p = job.progress;
    this.element.hidden = job.state === "succeeded" || (hasEnded(job.state) && !p);
    updateJobMeter(this.bar, job);
    setText(this.stage, headline(job));
    setText(this.percent, job.state === "queued" ? "" : wholeText(jobProgress(job)));
    setText(this.detail, detailText(job));
    this.figures.hidden = !p;
    if (p)
      for (const [key, , text] of kFigures) setText(this.values[key], text(p));
  }
}

// Returns the text about the progress over all stages, such as "42 %, about 3 m 20 s left".
function wholeText({fraction, leftS}) {
  if (fraction === null) return "";
  return percentText(fraction) + (leftS > 0 ? `, about ${durationText(leftS)} left` : "");
}

function percentText(fraction) {
  return fraction > 0 && fraction < 0.1 ? `${(Math.floor(1000 * fraction) / 10).toFixed(1)} %` :
                                          `${Math.floor(100 * fraction)} %`;
}

function headline(job) {
  const stage = job.progress?.stage;
  switch (job.state) {
    case "queued":
      return job.position ? `Number ${job.position} in the queue` : "Waiting in the queue";
    case "suspended":
      return stage ? `Suspended in ${stage}` : "Suspended";
    case "canceling":
      return "Canceling…";
    case "canceled":
      return stage ? `Canceled in ${stage}` : "Canceled";
    case "failed":
      return stage ? `Failed in ${stage}` : "Failed";
    default:
      return stage || "Starting…";
  }
}

function detailText(job) {
  const p = job.progress;
  if (!p || !p.stage) return "";
  const far = p.total ? `${countText(p.done)} of ${unitText(countText(p.total), p.unit)}` :
                        unitText(countText(p.done), p.unit);
  if (hasEnded(job.state) || job.state !== "running") return far;
  return [
    far, p.rate > 0 && `${shortCount(p.rate)} ${p.unit} per second`,
    p.eta_s > 0 && `${durationText(p.eta_s)} left in this stage`
  ].filter(Boolean)
      .join(" · ");
}
