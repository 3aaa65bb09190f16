// The list of all jobs, which can be searched and filtered by state. Running jobs are first, and
// then all others, newest first. The page refreshes the list every two seconds while it shows a job
// that has not ended, and every eight seconds otherwise.

import {getJson, poll} from "../lib/api.js";
import {announce, clear, h, setText} from "../lib/dom.js";
import {
  agoText,
  durationText,
  gridText,
  hasEnded,
  labelsText,
  sceneText,
  shortCount,
  sizeText,
  stateText,
  timeText,
  titleText,
  unitText
} from "../lib/format.js";
import {jobProgress, updateJobMeter} from "../lib/job_progress.js";
import {BulkActions} from "../views/bulk_actions.js";
import {meter, problemBox, stateBadge} from "../views/parts.js";

const kStates = ["running", "queued", "suspended", "failed", "canceled", "succeeded"];
const kPageSize = 50;
const kBusyMs = 2000;
const kIdleMs = 8000;

export function jobsPage(_, query, signal) {
  const state = kStates.includes(query.get("state")) ? query.get("state") : null;
  const cursor = query.get("cursor"), words = query.get("q") ?? "";
  const filters = h("div", {class: "filters"});
  const error = h("div", {role: "alert"});
  const list = h("ul", {class: "jobs"});
  const empty = h("p", {class: "empty", hidden: true});
  const older = h("div", {class: "buttons end"});
  const rows = new Map();  // job id -> row
  let seen = false;

  const listOf = (states, from) => {
    const path = new URLSearchParams({limit: kPageSize});
    if (states) path.set("state", states === "running" ? "running,canceling" : states);
    if (from) path.set("cursor", from);
    if (words) path.set("q", words);
    return getJson(`/api/v1/jobs?${path}`, signal);
  };
  const update = async () => {
    const first = state || cursor ? [] : (await listOf("running", null)).jobs;
    const {jobs: page, counts, next_cursor} = await listOf(state, cursor);
    const isFirst = new Set(first.map((job) => job.id));
    const jobs = [...first, ...page.filter((job) => !isFirst.has(job.id))];
    clear(error);
    showFilters(filters, counts, state, words);
    showRows(list, rows, jobs, bulk);
    bulk.update(jobs);
    empty.hidden = jobs.length > 0;
    if (!seen || !empty.hidden) clear(empty, emptyText(state, cursor, words));
    seen = true;
    showPaging(older, {state, q: words}, cursor, next_cursor);
    return jobs.every((job) => hasEnded(job.state)) ? kIdleMs : kBusyMs;
  };
  const bulk =
      new BulkActions(() => update().catch((problem) => clear(error, problemBox(problem))));
  poll(update, (problem) => clear(error, problemBox(problem)), signal);

  return {
    title: "Jobs",
    content:
        h("div", {class: "stack"},
          h("div", {class: "page-head"}, h("h1", {}, "Jobs"),
            h("a", {class: "button primary", href: "#/new"}, "New job")),
          h("div", {class: "find"}, filters, searchForm(state, words)), error, bulk.element, list,
          empty, older)
  };
}

// Returns the URL fragment of the list with these parameters. Leaves out parameters with empty
// values.
function addressOf(parameters) {
  const given = Object.entries(parameters).filter(([, value]) => value);
  return `#/${given.length ? "?" : ""}${new URLSearchParams(given)}`;
}

function searchForm(state, words) {
  const input = h("input", {
    type: "search",
    value: words,
    maxlength: "100",
    placeholder: "Name, scene, label or id",
    "aria-label": "Find jobs by name, scene, label or id"
  });
  const form =
      h("form", {class: "search", role: "search"}, input, h("button", {class: "small"}, "Find"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    location.hash = addressOf({state, q: input.value.trim()}).slice(1);
  });
  return form;
}

function emptyText(state, cursor, words) {
  if (cursor) return "No older jobs.";
  if (words) return `No ${state ? `${state} ` : ""}jobs match "${words}".`;
  if (state) return `No ${state} jobs.`;
  return h("span", {}, "No jobs yet. ", h("a", {href: "#/new"}, "Submit the first one."));
}

function showFilters(element, counts, chosen, q) {
  const total = Object.values(counts).reduce((sum, n) => sum + n, 0);
  const countOf = (state) =>
      (counts[state] || 0) + (state === "running" ? counts.canceling || 0 : 0);
  const entries = [[null, "all", total], ...kStates.map((state) => [state, state, countOf(state)])];
  if (!element.firstChild) {
    element.append(
        h("nav", {"aria-label": "Jobs by state"},
          entries.map(
              ([state, name]) =>
                  h("a",
                    {href: addressOf({state, q}), "aria-current": state === chosen ? "true" : null},
                    name, h("span", {class: "count"})))));
  }
  element.querySelectorAll(".count").forEach((count, i) => setText(count, String(entries[i][2])));
}

function showPaging(element, parameters, cursor, next_cursor) {
  const to = (next) => addressOf({...parameters, cursor: next});
  clear(
      element, cursor && h("a", {class: "button", href: to(null)}, "Newest"),
      next_cursor && h("a", {class: "button", href: to(next_cursor)}, "Older jobs"));
}

// Shows `jobs` as rows of the element `list`. Keeps the rows of jobs that are already in the list,
// to preserve focus and selection.
function showRows(list, rows, jobs, bulk) {
  const ids = new Set(jobs.map((job) => job.id));
  for (const [id, row] of rows) {
    if (ids.has(id)) continue;
    row.element.remove();
    rows.delete(id);
  }
  jobs.forEach((job, i) => {
    if (!rows.has(job.id)) rows.set(job.id, jobRow(job, bulk));
    const row = rows.get(job.id);
    row.update(job);
    if (list.children[i] !== row.element) list.insertBefore(row.element, list.children[i] || null);
  });
}

function jobRow(job, bulk) {
  const badge = h("span", {class: "badge-place"});
  const bar = meter(`progress of ${titleText(job)}`);
  const activity = h("span", {class: "does"});
  const made = h("time", {class: "made"});
  const element =
      h("li", {}, h("label", {class: "select"}, bulk.checkbox(job, titleText(job))),
        h("a", {class: "job-row", href: `#/jobs/${job.id}`}, badge,
          h("div", {class: "what"}, h("strong", {}, titleText(job)),
            h("span", {class: "about"},
              [job.name && sceneText(job), gridText(job.resolution), labelsText(job)]
                  .filter(Boolean)
                  .join(" · "))),
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
      const {leftS} = jobProgress(job);
      const left = leftS > 0 ? `about ${durationText(leftS)} left` : "";
      return [p.stage, far, left].filter(Boolean).join(" · ");
    }
  }
}
