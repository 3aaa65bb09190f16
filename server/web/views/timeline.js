// Shows the stages of an attempt as bars whose lengths are proportional to their durations.

import {clear, h, setText} from "../lib/dom.js";
import {durationText, shortCount, unitText} from "../lib/format.js";

export class Timeline {
  constructor() {
    this.element =
        h("div", {}, this.list = h("ol", {class: "timeline"}),
          this.none = h("p", {class: "empty"}, "No stage has started."));
    this.rows = [];
  }

  show(job) {
    const stages = job.progress?.stages || [];
    this.none.hidden = stages.length > 0;
    // A new attempt has fewer or other stages.
    if (stages.length < this.rows.length ||
        this.rows.some((row, i) => row.name !== stages[i].name)) {
      clear(this.list);
      this.rows = [];
    }
    const totalS = Math.max(1e-3, stages.reduce((sum, stage) => sum + stage.wall_s, 0));
    let beginS = 0;
    stages.forEach((stage, i) => {
      if (!this.rows[i]) this.rows.push(this.addRow(stage));
      this.rows[i].update(stage, beginS / totalS, stage.wall_s / totalS, job.state === "running");
      beginS += stage.wall_s;
    });
  }

  addRow({name}) {
    const span = h("span", {class: "span"});
    const done = h("span", {class: "far"});
    const time = h("span", {class: "time"});
    const state = h("span", {class: "unseen"});
    const element =
        h("li", {}, h("span", {class: "name"}, name, state), h("span", {class: "track"}, span),
          done, time);
    this.list.append(element);
    const update = (stage, from, part, running) => {
      const now = !stage.ended && running;
      element.className = stage.ended ? "ended" : now ? "now" : "stopped";
      setText(state, stage.ended ? ", ended" : now ? ", running" : ", stopped");
      span.style.left = `${(100 * from).toFixed(2)}%`;
      span.style.width = `${(100 * part).toFixed(2)}%`;
      const count = shortCount(stage.done);
      setText(
          done,
          stage.ended || !stage.total ?
              unitText(count, stage.unit) :
              `${count} of ${unitText(shortCount(stage.total), stage.unit)}`);
      setText(time, durationText(stage.wall_s));
    };
    return {name, update};
  }
}
