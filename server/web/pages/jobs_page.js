// All jobs, newest first, filtered by state; refreshed every other second while any is active.

import {get_json, poll} from "../lib/api.js";
import {announce, clear, h, set_text} from "../lib/dom.js";
import {ago_text, duration_text, grid_text, has_ended, scene_text, short_count, size_text, state_text,
        time_text, title_text, unit_text} from "../lib/format.js";
import {meter, problem_box, state_badge, update_job_meter} from "../views/parts.js";

const kStates = ["running", "queued", "suspended", "failed", "canceled", "succeeded"];
const kPageSize = 50;
const kBusy_ms = 2000;
const kIdle_ms = 8000;

export function jobs_page(_, query, signal) {
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
    const {jobs, counts, next_cursor} = await get_json(`/api/v1/jobs?${path}`, signal);
    clear(error);
    show_filters(filters, counts, state);
    show_rows(list, rows, jobs);
    empty.hidden = jobs.length > 0;
    if (!seen || !empty.hidden) clear(empty, empty_text(state, cursor));
    seen = true;
    show_paging(older, state, cursor, next_cursor);
    return jobs.every((job) => has_ended(job.state)) ? kIdle_ms : kBusy_ms;
  };
  poll(update, (problem) => clear(error, problem_box(problem)), signal);

  return {title: "Jobs", content: h("div", {class: "stack"},
    h("div", {class: "page-head"}, h("h1", {}, "Jobs"),
      h("a", {class: "button primary", href: "#/new"}, "New job")),
    filters, error, list, empty, older)};
}

function empty_text(state, cursor) {
  if (cursor) return "No older jobs.";
  if (state) return `No ${state} jobs.`;
  return h("span", {}, "No jobs yet. ", h("a", {href: "#/new"}, "Submit the first one."));
}

function show_filters(element, counts, chosen) {
  const total = Object.values(counts).reduce((sum, n) => sum + n, 0);
  const count_of = (state) => (counts[state] || 0) + (state === "running" ? counts.canceling || 0 : 0);
  const entries = [[null, "all", total], ...kStates.map((state) => [state, state, count_of(state)])];
  if (!element.firstChild) {
    element.append(h("nav", {"aria-label": "Jobs by state"}, entries.map(([state, name]) =>
      h("a", {href: state ? `#/?state=${state}` : "#/", "aria-current": state === chosen ? "true" : null},
        name, h("span", {class: "count"})))));
  }
  element.querySelectorAll(".count").forEach((count, i) => set_text(count, String(entries[i][2])));
}

function show_paging(element, state, cursor, next_cursor) {
  const to = (next) => `#/?${new URLSearchParams({...(state && {state}), ...(next && {cursor: next})})}`;
  clear(element, cursor && h("a", {class: "button", href: to(null)}, "Newest"),
        next_cursor && h("a", {class: "button", href: to(next_cursor)}, "Older jobs"));
}

// Reuses the rows of jobs that remain, to preserve focus and selection.
function show_rows(list, rows, jobs) {
  const ids = new Set(jobs.map((job) => job.id));
  for (const [id, row] of rows) {
    if (ids.has(id)) continue;
    row.element.remove();
    rows.delete(id);
  }
  jobs.forEach((job, i) => {
    if (!rows.has(job.id)) rows.set(job.id, job_row(job));
    const row = rows.get(job.id);
    row.update(job);
    if (list.children[i] !== row.element) list.insertBefore(row.element, list.children[i] || null);
  });
}

function job_row(job) {
  const badge = h("span", {class: "badge-place"});
  const bar = meter(`progress of ${title_text(job)}`);
  const activity = h("span", {class: "does"});
  const made = h("time", {class: "made"});
  const element = h("li", {},
    h("a", {class: "job-row", href: `#/jobs/${job.id}`},
      badge,
      h("div", {class: "what"}, h("strong", {}, title_text(job)),
        h("span", {class: "about"}, `${job.name ? `${scene_text(job)} · ` : ""}${grid_text(job.resolution)}`)),
      h("div", {class: "how-far"}, bar.element, activity), made));
  let state = null;
  const update = (now) => {
    if (now.state !== state) {
      clear(badge, state_badge(now.state));
      if (state) announce(`${title_text(now)} is ${state_text(now.state)}`);
      state = now.state;
    }
    update_job_meter(bar, now);
    set_text(activity, activity_text(now));
    set_text(made, ago_text(now.created_at));
    made.setAttribute("datetime", now.created_at);
    made.title = time_text(now.created_at);
  };
  return {element, update};
}

// What a job is doing, in one line.
function activity_text(job) {
  const p = job.progress;
  switch (job.state) {
    case "queued":
      if (job.not_before && Date.parse(job.not_before) > Date.now())
        return `retries ${ago_text(job.not_before)} after ${job.error?.code || "an error"}`;
      return job.position ? `number ${job.position} in the queue` : "waiting";
    case "succeeded":
      return `${size_text(job.result.bytes)} · ${short_count(job.result.voxels)} voxels · ` +
             `${duration_text(job.result.wall_s)}`;
    case "failed":
      return job.error ? `${job.error.code}: ${job.error.message}` : "";
    default: {
      if (!p) return "";
      const far = p.total ? `${short_count(p.done)} of ${unit_text(short_count(p.total), p.unit)}` : "";
      const left = job.state === "running" && p.eta_s > 0 ? `${duration_text(p.eta_s)} left` : "";
      return [p.stage, far, left].filter(Boolean).join(" · ");
    }
  }
}
