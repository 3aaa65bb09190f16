// The picked voxel, and the distance between two picks.

import {announce, clear, fact, h} from "../lib/dom.js";
import {countText} from "../lib/format.js";

import {distance, subtract} from "./vector.js";

export class PickView {
  // onChange() is called when the number of picks changes.
  constructor(space, onChange) {
    this.space = space;
    this.onChange = onChange;
    this.pick = this.start = null;
    this.element = h("div", {class: "stack"});
    this.show();
  }

  set(pick) {
    this.pick = pick;
    this.show();
    if (!pick) announce("There is no voxel here.");
    else
      announce(`Picked voxel ${pick.voxel.join(", ")}.${
          this.start ? ` Distance ${this.measureText()}.` : ""}`);
  }

  // Starts or ends a measurement from the current pick.
  toggleMeasure() {
    if (!this.start && !this.pick)
      return announce("Pick a voxel first: distances are measured from it.");
    this.start = this.start ? null : this.pick;
    announce(this.start ? "Measuring from this voxel: pick another one." : "Not measuring.");
    this.show();
  }

  // Returns the box {low, high} that contains the two picked voxels; null if there are not two
  // picks.
  box() {
    if (!this.start || !this.pick) return null;
    const edge = (pick) => this.cellEdge(pick);
    return {
      low: this.pick.voxel.map((c, axis) => Math.min(c, this.start.voxel[axis])),
      high: this.pick.voxel.map(
          (c, axis) => Math.max(c + edge(this.pick), this.start.voxel[axis] + edge(this.start)))
    };
  }

  cellEdge({level}) {
    return this.space.resolution / 2 ** level;
  }

  // Returns the position of a pick in scene units, as text.
  sceneText(pick) {
    return this.space.text(pick.position).replaceAll(",", ", ");
  }

  measuredVoxels() {
    return distance(this.pick.position, this.start.position);
  }
  lengthText() {
    return `${lengthText(this.measuredVoxels())} voxels`;
  }
  measureText() {
    const inScene = this.measuredVoxels() * this.space.edge / this.space.resolution;
    return `${this.lengthText()}, ${lengthText(inScene)} in scene units`;
  }

  show() {
    const {pick, start} = this;
    clear(
        this.element,
        !pick &&
            h("p", {class: "faint"}, "Click a voxel, or press Enter for the one in the center."),
        pick &&
            h("dl", {class: "facts pick"},
              fact("Voxel", h("code", {"data-fact": "voxel"}, pick.voxel.join(", "))),
              fact("In scene units", h("code", {"data-fact": "scene"}, this.sceneText(pick))),
              fact(
                  "Level", h("span", {"data-fact": "level"}, String(pick.level)),
                  this.edgeNote(pick)),
              fact(
                  "Node of the tile: level / word offset",
                  h("code", {"data-fact": "node"}, `${pick.nodeLevel} / ${pick.nodeOffset}`)),
              fact("Distance from the camera", `${lengthText(pick.distance)} voxels`)),
        start &&
            h("dl", {class: "facts measure"},
              fact("From voxel", h("code", {}, start.voxel.join(", "))),
              pick && fact("Distance", h("span", {"data-fact": "measure"}, this.measureText())),
              pick &&
                  fact(
                      "Along the axes, in voxels",
                      h("code", {},
                        subtract(pick.position, start.position)
                            .map((c) => Number(c.toFixed(2)))
                            .join(", ")))),
        (pick || start) &&
            h("div", {class: "buttons"},
              h("button", {
                type: "button",
                class: "small",
                "aria-pressed": String(Boolean(start)),
                "data-action": "measure",
                on: {click: () => this.toggleMeasureAndFocus()}
              },
                "Measure from here"),
              h("button", {type: "button", class: "small quiet", on: {click: () => this.forget()}},
                "Clear")));
    this.onChange();
  }

  // toggleMeasure() replaces the buttons, so this function moves the focus to the new button.
  toggleMeasureAndFocus() {
    this.toggleMeasure();
    this.element.querySelector('[data-action="measure"]')?.focus();
  }

  forget() {
    this.pick = this.start = null;
    this.show();
  }

  edgeNote(pick) {
    const edge = this.cellEdge(pick);
    return h(
        "span", {class: "faint"},
        edge === 1 ?
            " (a voxel)" :
            ` (a cube of ${countText(edge)} voxels; more detail is not loaded or not visible)`);
  }
}

function lengthText(value) {
  return String(Number(value.toPrecision(6)));
}
