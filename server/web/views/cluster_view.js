// The nodes of a cluster and what they do for a job.

import {clear, h, set_text} from "../lib/dom.js";
import {count_text} from "../lib/format.js";

export class ClusterView {
  constructor() {
    this.summary = h("p", {class: "detail"});
    this.rows = h("tbody");
    this.element = h("section", {class: "card", "aria-labelledby": "cluster-title"},
      h("h2", {id: "cluster-title"}, "Tasks on the cluster"), this.summary,
      h("table", {},
        h("thead", {}, h("tr", {}, ["Node", "Running", "Built"].map((name) => h("th", {scope: "col"}, name)))),
        this.rows));
    this.element.hidden = true;
  }

  show(job) {
    const cluster = job.progress?.cluster;
    this.element.hidden = !cluster;
    if (!cluster) return;
    // What is known of tasks is of the last attempt.
    const runs = job.state === "running";
    const running = cluster.nodes.reduce((sum, node) => sum + node.running, 0);
    set_text(this.summary, `${count_text(cluster.built)} of ${count_text(cluster.batches)} batches built` +
      (runs ? ` · ${count_text(running)} running, ${count_text(cluster.waiting)} waiting` : "") +
      (cluster.failed_attempts ? ` · ${count_text(cluster.failed_attempts)} failed and submitted again` : ""));
    clear(this.rows, cluster.nodes.map((node) =>
      h("tr", {}, h("td", {}, node.name), h("td", {}, runs ? count_text(node.running) : "–"), h("td", {}, count_text(node.built)))));
  }
}
