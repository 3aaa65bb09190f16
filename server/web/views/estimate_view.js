// The estimate of the build, which is requested from the service while the user fills in the form.

import {sendJson, sleep} from "../lib/api.js";
import {clear, h, setText} from "../lib/dom.js";
import {countText, durationText, rangeText, shortCount, sizeText} from "../lib/format.js";

import {problemBox} from "./parts.js";

const kDebounceMs = 700;  // pause between the last change and the request
const kMaxAttempts = 5;   // attempts while the service is busy with other plans

const kFigures = [
  ["voxels", "Voxels", shortCount],
  ["dag_nodes", "DAG nodes", shortCount],
  ["file_bytes", "File", sizeText],
  ["disk_bytes", "Disk (peak)", sizeText],
  ["memory_bytes", "Memory (peak)", sizeText],
  ["cpu_s", "CPU time", durationText],
  ["wall_s", "Wall time", durationText],
];

export class EstimateView {
  constructor(signal) {
    this.signal = signal;
    this.status = h("p", {class: "hint", "aria-live": "polite"});
    this.table = h("div", {});
    this.element =
        h("section", {class: "card estimate", "aria-labelledby": "estimate-title"},
          h("h2", {id: "estimate-title"}, "Estimate"), this.status, this.table);
    this.update(null);
  }

  // Shows the estimate for `body`, the request body of the job; null while the form is incomplete.
  async update(body) {
    const question = JSON.stringify(body);
    if (question === this.question) return;
    this.question = question;
    this.requestAbort?.abort();
    this.table.classList.add("old");
    if (!body) {
      setText(this.status, "Choose a scene to see the estimate.");
      clear(this.table);
      return;
    }
    const requestAbort = this.requestAbort = new AbortController();
    this.signal.addEventListener(
        "abort", () => requestAbort.abort(), {once: true, signal: requestAbort.signal});
    setText(this.status, "Estimating from small builds…");
    try {
      await sleep(kDebounceMs, requestAbort.signal);
      if (!requestAbort.signal.aborted) this.show(await this.request(body, requestAbort.signal));
    } catch (problem) {
      if (requestAbort.signal.aborted) return;
      if (problem.code === undefined) throw problem;
      setText(this.status, "");
      clear(this.table, problemBox(problem));
      this.table.classList.remove("old");
    }
  }

  async request(body, signal) {
    for (let attempt = 1;; ++attempt) {
      try {
        return await sendJson("POST", "/api/v1/jobs?dry_run=true", body, {signal});
      } catch (problem) {
        if (signal.aborted || !problem.isTransient || attempt === kMaxAttempts) throw problem;
        await sleep(1000 * Math.max(1, problem.retryAfterS), signal);
      }
    }
  }

  show(estimate) {
    setText(
        this.status,
        `${countText(estimate.triangles)} triangles in ${countText(estimate.subvolumes)} ` +
            `occupied subvolume${estimate.subvolumes === 1 ? "" : "s"}`);
    this.table.classList.remove("old");
    clear(
        this.table,
        h("table", {},
          h("thead", {},
            h("tr", {}, h("td", {}), h("th", {scope: "col", class: "number"}, "Likely"),
              h("th", {scope: "col", class: "number"}, "Range"))),
          h("tbody", {}, kFigures.filter(([key]) => estimate[key]).map(([key, name, text]) => {
            const {low, likely, high} = estimate[key];
            return h(
                "tr", {}, h("th", {scope: "row"}, name),
                h("td", {class: "number likely"}, text(likely)),
                h("td", {class: "number faint"}, rangeText(text(low), text(high))));
          }))));
  }
}
