// The text over the picture of a running job.

import {h, setText, svg} from "../../lib/dom.js";
import {countText, hasEnded, stateText, titleText} from "../../lib/format.js";

import {kStyles} from "./subvolume_wires.js";

const kNoAnswer = "The service does not answer. The picture shows the last known state.";

export class Banner {
  constructor(wires) {
    this.wires = wires;
    this.text = h("p", {class: "banner-text"});
    this.kinds = Object.fromEntries(Object.entries(kStyles).map(
        ([kind, style]) => [kind, h("li", {}, sample(style), style.name)]));
    const legend = h("ul", {class: "banner-legend"}, Object.values(this.kinds));
    const toggle =
        h("button", {
          type: "button",
          class: "small",
          "aria-pressed": "true",
          on: {
            click: () => {
              wires.setVisible(!wires.visible);
              toggle.setAttribute("aria-pressed", String(wires.visible));
              legend.hidden = !wires.visible;
            }
          }
        },
          "Subvolumes");
    this.element = h("div", {class: "banner"}, this.text, toggle, legend);
  }

  // `job` is null while the service does not answer. `built` and `total` are the last known numbers
  // of built subvolumes and of all subvolumes. `isMerged` is true if the picture shows all voxels,
  // and only their colors or other attributes are missing.
  show(job, {built = 0, total = 0}, isMerged = false) {
    setText(this.text, job ? describe(job, built, total, isMerged) : kNoAnswer);
    this.kinds.waiting.hidden = this.kinds.built.hidden = !this.wires.drawsAll;
    this.element.classList.toggle("bad", !job || hasEnded(job.state));
  }
}

function describe(job, built, total, isMerged) {
  const state = stateText(job.state);
  if (hasEnded(job.state))
    return `${titleText(job)} is ${state} and has no result. The picture shows its built part.`;
  if (isMerged)
    return `${state}: all voxels are built. Their colors or other attributes are not ready yet.`;
  const count = `${countText(built)} of ${countText(total)} occupied subvolumes are built`;
  return `${state}: ${count}, drawn coarsely.`;
}

function sample({color, width, dash}) {
  return svg("svg", {width: 28, height: 10, "aria-hidden": "true"}, svg("line", {
               x1: 1,
               y1: 5,
               x2: 27,
               y2: 5,
               stroke: color,
               "stroke-width": width,
               "stroke-dasharray": dash.join(" ") || null
             }));
}
