// What a build would take, asked of the service while the form is filled in.

import {send_json, sleep} from "./api.js";
import {clear, h, set_text} from "./dom.js";
import {count_text, duration_text, range_text, short_count, size_text} from "./format.js";
import {problem_box} from "./parts.js";

const kCalm_ms = 700;  // after the last change
const kMaxTries = 5;  // while the service is busy with others' plans

const kFigures = [
  ["voxels", "Voxels", short_count],
  ["dag_nodes", "DAG nodes", short_count],
  ["file_bytes", "File", size_text],
  ["disk_bytes", "Disk, at most", size_text],
  ["memory_bytes", "Memory, at most", size_text],
  ["cpu_s", "CPU time", duration_text],
  ["wall_s", "Wall time", duration_text],
];

export class EstimateView {
  constructor(signal) {
    this.signal = signal;
    this.status = h("p", {class: "hint", "aria-live": "polite"});
    this.table = h("div", {});
    this.element = h("section", {class: "card estimate", "aria-labelledby": "estimate-title"},
      h("h2", {id: "estimate-title"}, "What it would take"), this.status, this.table);
    this.look(null);
  }

  // `body`: of the job; null while there is none to ask about.
  async look(body) {
    const question = JSON.stringify(body);
    if (question === this.question) return;
    this.question = question;
    this.asking?.abort();
    this.table.classList.add("old");
    if (!body) {
      set_text(this.status, "Choose a scene to see the estimate.");
      clear(this.table);
      return;
    }
    const asking = this.asking = new AbortController();
    this.signal.addEventListener("abort", () => asking.abort(), {once: true, signal: asking.signal});
    set_text(this.status, "Estimating from small builds…");
    try {
      await sleep(kCalm_ms, asking.signal);
      if (!asking.signal.aborted) this.show(await this.ask(body, asking.signal));
    } catch (problem) {
      if (asking.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      set_text(this.status, "");
      clear(this.table, problem_box(problem));
      this.table.classList.remove("old");
    }
  }

  async ask(body, signal) {
    for (let tries = 1;; ++tries) {
      try {
        return await send_json("POST", "/api/v1/jobs?dry_run=true", body, {signal});
      } catch (problem) {
        if (signal.aborted || !problem.may_pass || tries === kMaxTries) throw problem;
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
        h("th", {scope: "col", class: "number"}, "Between"))),
      h("tbody", {}, kFigures.filter(([key]) => estimate[key]).map(([key, name, text]) => {
        const {low, likely, high} = estimate[key];
        return h("tr", {}, h("th", {scope: "row"}, name), h("td", {class: "number likely"}, text(likely)),
                 h("td", {class: "number faint"}, range_text(text(low), text(high))));
      }))));
  }
}
