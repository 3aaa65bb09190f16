// The list of all jobs, newest first, with a filter by state. The list is refreshed every two
// seconds while a job on the page has not ended, and every eight seconds otherwise.

import {getJson, poll} from "../lib/api.js";
import {announce, clear, h, setText} from "../lib/dom.js";
import {
  agoText,
  durationText,
  gridText,
  hasEnded,
  sceneText,
  shortCount,
  sizeText,
  stateText,
  timeText,
  titleText,
  unitText
} from "../lib/format.js";
import {meter, problemBox, stateBadge, updateJobMeter} from "../views/parts.js";

const kStates = ["running", "queued", "suspended", "failed", "canceled", "succeeded"];
const kPageSize = 50;
const kBusyMs = 2000;
const kIdleMs = 8000;

export function jobsPage(_, query, signal) {
  const state = kStates.includes(query.get("state")) ? query.get("state") : null;
  const cursor = query.get("cursor");
  const filters = h("div", {class: "filters"});
  const error = h("div", {role: "alert"});
  const list = h("ul", {class: "jobs"});
  const empty = h("p", {class: "empty", hidden: true});
  const older = h("div", {class: "buttons end"});
  const rows = new Map();  // job id -> row
  let seen = false;

  const update = async () => {
    const path = new URLSearchParams({limit: kPageSize});
    if (state) path.set("state", state === "running" ? "running,canceling" : state);
    if (cursor) path.set("cursor", cursor);
    const {jobs, counts, next_cursor} = await getJson(`/api/v1/jobs?${path}`, signal);
    clear(error);
    showFilters(filters, counts, state);
    showRows(list, rows, jobs);
    empty.hidden = jobs.length > 0;
    if (!seen || !empty.hidden) clear(empty, emptyText(state, cursor));
    seen = true;
    showPaging(older, state, cursor, next_cursor);
    return jobs.every((job) => hasEnded(job.state)) ? kIdleMs : kBusyMs;
  };
  poll(update, (problem) => clear(error, problemBox(problem)), signal);

  return {
    title: "Jobs",
    content:
        h("div", {class: "stack"},
          h("div", {class: "page-head"}, h("h1", {}, "Jobs"),
            h("a", {class: "button primary", href: "#/new"}, "New job")),
          filters, error, list, empty, older)
  };
}

function emptyText(state, cursor) {
  if (cursor) return "No older jobs.";
  if (state) return `No ${state} jobs.`;
  return h("span", {}, "No jobs yet. ", h("a", {href: "#/new"}, "Submit the first one."));
}

function showFilters(element, counts, chosen) {
  const total = Object.values(counts).reduce((sum, n) => sum + n, 0);
  const countOf = (state) =>
      (counts[state] || 0) + (state === "running" ? counts.canceling || 0 : 0);
  const entries = [[null, "all", total], ...kStates.map((state) => [state, state, countOf(state)])];
  if (!element.firstChild) {
    element.append(
        h("nav", {"aria-label": "Jobs by state"},
          entries.map(
              ([state, name]) =>
                  h("a", {
                    href: state ? `#/?state=${state}` : "#/",
                    "aria-current": state === chosen ? "true" : null
                  },
                    name, h("span", {class: "count"})))));
  }
  element.querySelectorAll(".count").forEach((count, i) => setText(count, String(entries[i][2])));
}

function showPaging(element, state, cursor, next_cursor) {
  const to = (next) =>
      `#/?${new URLSearchParams({...(state && {state}), ...(next && {cursor: next})})}`;
  clear(
      element, cursor && h("a", {class: "button", href: to(null)}, "Newest"),
      next_cursor && h("a", {class: "button", href: to(next_cursor)}, "Older jobs"));
}

// Shows `jobs` as rows of the element `list`. Keeps the rows of jobs that are already in the list,
// to preserve focus and selection.
function showRows(list, rows, jobs) {
  const ids = new Set(jobs.map((job) => job.id));
  for (const [id, row] of rows) {
    if (ids.has(id)) continue;
    row.element.remove();
    rows.delete(id);
  }
  jobs.forEach((job, i) => {
    if (!rows.has(job.id)) rows.set(job.id, jobRow(job));
    const row = rows.get(job.id);
    row.update(job);
    if (list.children[i] !== row.element) list.insertBefore(row.element, list.children[i] || null);
  });
}

function jobRow(job) {
  const badge = h("span", {class: "badge-place"});
  const bar = meter(`progress of ${titleText(job)}`);
  const activity = h("span", {class: "does"});
  const made = h("time", {class: "made"});
  const element =
      h("li", {},
        h("a", {class: "job-row", href: `#/jobs/${job.id}`}, badge,
          h("div", {class: "what"}, h("strong", {}, titleText(job)),
            h("span", {class: "about"},
              `${job.name ? `${sceneText(job)} · ` : ""}${gridText(job.resolution)}`)),
          h("div", {class: "how-far"}, bar.element, activity), made));
  let state = null;
  const update = (now) => {
    if (now.state !== state) {
      clear(badge, stateBadge(now.state));
      if (state) announce(`${titleText(now)} is ${stateText(now.state)}`);
      state = now.state;
    }
    updateJobMeter(bar, now);
    setText(activity, activityText(now));
    setText(made, agoText(now.created_at));
    made.setAttribute("datetime", now.created_at);
    made.title = timeText(now.created_at);
  };
  return {element, update};
}

// Describes the activity of a job in one line.
function activityText(job) {
  const p = job.progress;
  switch (job.state) {
    case "queued":
      if (job.not_before && Date.parse(job.not_before) > Date.now())
        return `retries ${agoText(job.not_before)} after ${job.error?.code || "an error"}`;
      return job.position ? `number ${job.position} in the queue` : "waiting";
    case "succeeded":
      return `${sizeText(job.result.bytes)} · ${shortCount(job.result.voxels)} voxels · ` +
          `${durationText(job.result.wall_s)}`;
    case "failed":
      return job.error ? `${job.error.code}: ${job.error.message}` : "";
    default: {
      if (!p) return "";
      const far =
          p.total ? `${shortCount(p.done)} of ${unitText(shortCount(p.total), p.unit)}` : "";
      const left = job.state === "running" && p.eta_s > 0 ? `${durationText(p.eta_s)} left` : "";
      return [p.stage, far, left].filter(Boolean).join(" · ");
    }
  }
}
