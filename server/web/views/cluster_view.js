// The nodes of a cluster and their tasks for a job.

import {clear, h, setText} from "../lib/dom.js";
import {countText} from "../lib/format.js";

export class ClusterView {
  constructor() {
    this.summary = h("p", {class: "detail"});
    this.rows = h("tbody");
    this.element = h(
        "section", {class: "card", "aria-labelledby": "cluster-title"},
        h("h2", {id: "cluster-title"}, "Tasks on the cluster"), this.summary,
        h("table", {},
          h("thead", {},
            h("tr", {}, ["Node", "Running", "Built"].map((name) => h("th", {scope: "col"}, name)))),
          this.rows));
    this.element.hidden = true;
  }

  show(job) {
    const cluster = job.progress?.cluster;
    this.element.hidden = !cluster;
    if (!cluster) return;
    // The counts are from the last attempt. They include running tasks only while the job runs.
    const runs = job.state === "running";
    const running = cluster.nodes.reduce((sum, node) => sum + node.running, 0);
    setText(
        this.summary,
        `${countText(cluster.built)} of ${countText(cluster.batches)} batches built` +
            (runs ? ` · ${countText(running)} running, ${countText(cluster.waiting)} waiting` :
                    "") +
            (cluster.failed_attempts ?
                 ` · ${countText(cluster.failed_attempts)} failed and submitted again` :
                 ""));
    clear(
        this.rows,
        cluster.nodes.map(
            (node) => h(
                "tr", {}, h("td", {}, node.name), h("td", {}, runs ? countText(node.running) : "–"),
                h("td", {}, countText(node.built)))));
  }
}
