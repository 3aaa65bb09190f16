// The clipping box: two sliders for each axis.

import {h, setText} from "../lib/dom.js";
import {countText} from "../lib/format.js";

const kSteps = 1024;

export class ClipView {
  // onChange(clip) gets {low, high} in voxels, or null.
  constructor(resolution, onChange) {
    this.resolution = resolution;
    this.onChange = onChange;
    this.box = {low: [0, 0, 0], high: Array(3).fill(resolution)};
    this.enabled =
        h("input", {type: "checkbox", id: "clip-on", on: {change: () => this.changed()}});
    this.sliders = ["low", "high"].map((end) => [0, 1, 2].map((axis) => this.slider(end, axis)));
    const rows = [0, 1, 2].map(
        (axis) =>
            h("div", {class: "clip-axis"},
              h("span", {class: "axis", "aria-hidden": "true"}, "xyz"[axis]), this.sliders[0][axis],
              this.sliders[1][axis], this.outputs[axis]));
    this.element =
        h("div", {class: "stack"},
          h("div", {class: "check"}, this.enabled, h("label", {for: "clip-on"
            }, "Show only the inside of a box")), this.rows = h("div", {class: "clip-rows"}, rows));
    this.show();
  }

  outputs = [0, 1, 2].map(() => h("output", {class: "faint"}));

  slider(end, axis) {
    const step = Math.max(1, this.resolution / kSteps);
    return h("input", {
      type: "range",
      min: "0",
      max: String(this.resolution),
      step: String(step),
      "aria-label": `${"xyz"[axis]} ${end === "low" ? "from" : "to"}, in voxels`,
      on: {input: (event) => this.move(end, axis, Number(event.target.value))}
    });
  }

  // Moves one end of the box. Also moves the other end if necessary, because a box has at least one
  // voxel.
  move(end, axis, value) {
    const {low, high} = this.box;
    if (end === "low") {
      low[axis] = Math.min(value, this.resolution - 1);
      high[axis] = Math.max(high[axis], low[axis] + 1);
    } else {
      high[axis] = Math.max(value, 1);
      low[axis] = Math.min(low[axis], high[axis] - 1);
    }
    this.changed();
  }

  changed() {
    this.show();
    this.onChange(this.enabled.checked ? {low: [...this.box.low], high: [...this.box.high]} : null);
  }

  // Sets the box without calling onChange.
  set(clip) {
    this.enabled.checked = clip !== null;
    if (clip) this.box = {low: [...clip.low], high: [...clip.high]};
    this.show();
  }

  show() {
    this.rows.hidden = !this.enabled.checked;
    const {low, high} = this.box;
    for (let axis = 0; axis < 3; ++axis) {
      this.sliders[0][axis].value = String(low[axis]);
      this.sliders[1][axis].value = String(high[axis]);
      setText(this.outputs[axis], `${countText(low[axis])} – ${countText(high[axis])}`);
    }
  }
}
