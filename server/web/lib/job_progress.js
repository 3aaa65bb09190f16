// Computes the progress of a job over all its stages.

import {hasEnded} from "./format.js";

// The long stages of a job, in their order. `share` is the typical time of a stage, relative to the
// other stages. applies(options) returns true if a job with these options has the stage. All other
// stages are short; while one of them runs, the progress does not change.
const kStages = [
  {name: "ingest", share: 10, applies: () => true},
  {name: "build", share: 60, applies: () => true},
  {name: "interior", share: 20, applies: (options) => Boolean(options.solid)},
  {name: "merge", share: 25, applies: () => true},
  {name: "reorder", share: 25, applies: (options) => options.order === "first-parent"},
  {name: "color", share: 140, applies: (options) => Boolean(options.color || options.attributes)},
  {name: "write", share: 5, applies: () => true},
];

// Returns {fraction, leftS}: the completed fraction of a job, 0 to 1, and an estimate of the
// remaining seconds. A value is null if it is unknown.
export function jobProgress({state, progress, options}) {
  if (state === "succeeded") return {fraction: 1, leftS: null};
  const stages = kStages.filter(({applies}) => applies(options ?? {}));
  const begun = progress?.stages ?? [];
  const at = Math.max(...begun.map(({name}) => stages.findIndex((stage) => stage.name === name)));
  if (!(at >= 0)) return {fraction: progress ? 0 : null, leftS: null};
  const sum = (list) => list.reduce((total, {share}) => total + share, 0);
  const now = begun.findLast(({name}) => name === stages[at].name);
  const part = now.ended ? 1 : now.total > 0 ? Math.min(1, now.done / now.total) : 0;
  const done = sum(stages.slice(0, at)) + part * stages[at].share;
  const spentS = begun.reduce((total, {wall_s: wallS}) => total + wallS, 0);
  const isKnown = state === "running" && done > 0 && spentS > 1;
  const stageLeftS = now.ended ? 0 : progress.eta_s > 0 ? progress.eta_s : null;
  const laterS = sum(stages.slice(at + 1)) * spentS / done;
  return {
    fraction: done / sum(stages),
    leftS: isKnown && stageLeftS !== null ? stageLeftS + laterS : null
  };
}

// Shows the progress of a job in `bar`, a meter of views/parts.js.
export function updateJobMeter(bar, job) {
  const {fraction} = jobProgress(job);
  const waits = job.state === "queued" || job.state === "suspended" || hasEnded(job.state);
  bar.update(waits && fraction === null ? 0 : fraction);
  bar.element.dataset.state = job.state;
}
