// The elements over the picture: a mark at the picked voxel, a mark at the start of a measurement,
// the line between the two with its length, and the card next to the picked voxel.

import {h, setText, svg} from "../../lib/dom.js";
import {Projection} from "../projection.js";

import {PickCard} from "./pick_card.js";

export class Markers {
  // `picks` is the PickView (pick_view.js) that has the picked voxel and the start.
  constructor(canvas, picks) {
    Object.assign(this, {canvas, picks});
    this.marks = ["picked", "start"].map(
        (kind) => h("span", {class: `mark ${kind}`, "aria-hidden": "true", hidden: true}));
    this.lines = ["outline", "line"].map((kind) => svg("line", {class: kind}));
    this.drawing = svg("svg", {class: "measured", "aria-hidden": "true"}, this.lines);
    this.label = h("span", {class: "measured-length", "aria-hidden": "true"});
    this.card = new PickCard(picks, () => canvas.focus({preventScroll: true}));
    this.elements = [this.drawing, ...this.marks, this.label, this.card.element];
    this.drawing.style.display = "none";
    this.label.hidden = true;
    canvas.parentElement.append(...this.elements);
  }

  dispose() {
    for (const element of this.elements) element.remove();
  }

  show(camera) {
    const {clientWidth: width, clientHeight: height} = this.canvas, {pick, start} = this.picks;
    const projection = new Projection(camera, width, height);
    const places = [pick, start].map((shown) => shown && projection.point(shown.position));
    places.forEach((at, i) => {
      const isSeen = Boolean(at) && at[0] >= 0 && at[0] <= width && at[1] >= 0 && at[1] <= height;
      this.marks[i].hidden = !isSeen;
      if (isSeen) moveTo(this.marks[i], at);
      if (i === 0) this.card.place(isSeen ? at : null, places[1], width, height);
    });
    this.showLine(pick && start ? projection.line(start.position, pick.position) : null);
  }

  // Draws the measured line between `ends`, two points of the picture. Hides it if `ends` is null.
  showLine(ends) {
    this.drawing.style.display = ends ? "" : "none";
    this.label.hidden = !ends;
    if (!ends) return;
    const [[x1, y1], [x2, y2]] = ends.map((end) => end.map((c) => c.toFixed(1)));
    for (const line of this.lines)
      for (const [name, value] of Object.entries({x1, y1, x2, y2})) line.setAttribute(name, value);
    setText(this.label, this.picks.lengthText());
    moveTo(this.label, ends[0].map((c, i) => (c + ends[1][i]) / 2));
  }
}

function moveTo(element, [x, y]) {
  element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
}
