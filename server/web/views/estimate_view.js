// An estimate of the build, requested from the service while the user fills in the form.

import {send_json, sleep} from "../lib/api.js";
import {clear, h, set_text} from "../lib/dom.js";
import {count_text, duration_text, range_text, short_count, size_text} from "../lib/format.js";
import {problem_box} from "./parts.js";

const kDebounce_ms = 700;  // after the last change
const kMaxAttempts = 5;    // while the service is busy with other plans

const kFigures = [
  ["voxels", "Voxels", short_count],
  ["dag_nodes", "DAG nodes", short_count],
  ["file_bytes", "File", size_text],
  ["disk_bytes", "Disk (peak)", size_text],
  ["memory_bytes", "Memory (peak)", size_text],
  ["cpu_s", "CPU time", duration_text],
  ["wall_s", "Wall time", duration_text],
];

export class EstimateView {
  constructor(signal) {
    this.signal = signal;
    this.status = h("p", {class: "hint", "aria-live": "polite"});
    this.table = h("div", {});
    this.element = h("section", {class: "card estimate", "aria-labelledby": "estimate-title"},
      h("h2", {id: "estimate-title"}, "Estimate"), this.status, this.table);
    this.update(null);
  }

  // `body`: of the job; null while the form is incomplete.
  async update(body) {
    const question = JSON.stringify(body);
    if (question === this.question) return;
    this.question = question;
    this.request_abort?.abort();
    this.table.classList.add("old");
    if (!body) {
      set_text(this.status, "Choose a scene to see the estimate.");
      clear(this.table);
      return;
    }
    const request_abort = this.request_abort = new AbortController();
    this.signal.addEventListener("abort", () => request_abort.abort(), {once: true, signal: request_abort.signal});
    set_text(this.status, "Estimating from small builds…");
    try {
      await sleep(kDebounce_ms, request_abort.signal);
      if (!request_abort.signal.aborted) this.show(await this.request(body, request_abort.signal));
    } catch (problem) {
      if (request_abort.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      set_text(this.status, "");
      clear(this.table, problem_box(problem));
      this.table.classList.remove("old");
    }
  }

  async request(body, signal) {
    for (let attempt = 1;; ++attempt) {
      try {
        return await send_json("POST", "/api/v1/jobs?dry_run=true", body, {signal});
      } catch (problem) {
        if (signal.aborted || !problem.is_transient || attempt === kMaxAttempts) throw problem;
        await sleep(1000 * Math.max(1, problem.retry_after_s), signal);
      }
    }
  }

  show(estimate) {
    set_text(this.status, `${count_text(estimate.triangles)} triangles in ${count_text(estimate.subvolumes)} ` +
                          `occupied subvolume${estimate.subvolumes === 1 ? "" : "s"}`);
    this.table.classList.remove("old");
    clear(this.table, h("table", {},
      h("thead", {}, h("tr", {}, h("td", {}), h("th", {scope: "col", class: "number"}, "Likely"),
        h("th", {scope: "col", class: "number"}, "Range"))),
      h("tbody", {}, kFigures.filter(([key]) => estimate[key]).map(([key, name, text]) => {
        const {low, likely, high} = estimate[key];
        return h("tr", {}, h("th", {scope: "row"}, name), h("td", {class: "number likely"}, text(likely)),
                 h("td", {class: "number faint"}, range_text(text(low), text(high))));
      }))));
  }
}
