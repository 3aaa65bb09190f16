// What the picture of a running job shows, in words, over the picture.

import {h, set_text, svg} from "../../lib/dom.js";
import {count_text, has_ended, state_text, title_text} from "../../lib/format.js";
import {kStyles} from "./subvolume_wires.js";

export class Banner {
  constructor(wires) {
    this.wires = wires;
    this.text = h("p", {class: "running-text"});
    this.kinds = Object.fromEntries(Object.entries(kStyles).map(([kind, style]) => [kind, h("li", {}, sample(style), style.name)]));
    const legend = h("ul", {class: "running-legend"}, Object.values(this.kinds));
    const toggle = h("button", {type: "button", class: "small", "aria-pressed": "true", on: {click: () => {
      wires.set_visible(!wires.visible);
      toggle.setAttribute("aria-pressed", String(wires.visible));
      legend.hidden = !wires.visible;
    }}}, "Subvolumes");
    this.element = h("div", {class: "running"}, this.text, toggle, legend);
  }

  // `job` is null while the service does not answer; the counts are the last that are known.
  show(job, {built = 0, total = 0}) {
    const what = `${count_text(built)} of ${count_text(total)} occupied subvolumes are built`;
    set_text(this.text, !job ? "The service does not answer. This is what was built when it did."
      : has_ended(job.state) ? `${title_text(job)} is ${state_text(job.state)} and has no result. This is what was built of it.`
      : `${state_text(job.state)}: ${what}, drawn coarsely.`);
    this.kinds.waiting.hidden = this.kinds.built.hidden = !this.wires.draws_all;
    this.element.classList.toggle("bad", !job || has_ended(job.state));
  }
}

function sample({color, width, dash}) {
  return svg("svg", {width: 28, height: 10, "aria-hidden": "true"},
    svg("line", {x1: 1, y1: 5, x2: 27, y2: 5, stroke: color, "stroke-width": width, "stroke-dasharray": dash.join(" ") || null}));
}
