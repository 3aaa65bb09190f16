// The progress of a job over all its stages, which the service computes.

import {hasEnded} from "./format.js";

// Returns {fraction, leftS}: the completed fraction of a job, 0 to 1, and an estimate of the
// remaining seconds. A value is null if it is unknown.
export function jobProgress({state, progress}) {
  if (state === "succeeded") return {fraction: 1, leftS: null};
  const overall = progress?.overall;
  return {
    fraction: overall?.fraction ?? null,
    leftS: state === "running" ? overall?.eta_s ?? null : null
  };
}

// Shows the progress of a job in `bar`, a meter of views/parts.js.
export function updateJobMeter(bar, job) {
  const {fraction} = jobProgress(job);
  const waits = job.state === "queued" || job.state === "suspended" || hasEnded(job.state);
  bar.update(waits && fraction === null ? 0 : fraction);
  bar.element.dataset.state = job.state;
}
