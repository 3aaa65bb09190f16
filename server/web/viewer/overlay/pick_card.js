// The card next to the picked voxel. It shows the position of the voxel and the length of a
// measurement. On phones, it is above the closed panel.

import {clear, h} from "../../lib/dom.js";
import {countText} from "../../lib/format.js";

const kGapPx = 14;    // distance between the voxel and the card
const kMarginPx = 8;  // minimum distance between the card and the edge of the picture

export class PickCard {
  // `picks` is the PickView (pick_view.js). The card calls focusPicture() after a click on a button
  // has removed the button, because the button had the focus.
  constructor(picks, focusPicture) {
    Object.assign(this, {picks, focusPicture});
    this.element =
        h("div", {class: "pick-card", role: "group", "aria-label": "Picked voxel", hidden: true});
    this.shown = [];
  }

  // Moves the card next to the picked voxel, which is at the point `at` in a picture of this size.
  // If `at` is null, hides the card. `from` is the point at which a measurement starts, or null;
  // the card is on the other side of the voxel if it fits there, so that the line remains visible.
  place(at, from, width, height) {
    const {pick, start} = this.picks, {element} = this;
    element.hidden = !at;
    if (!at) return;
    if (this.shown[0] !== pick || this.shown[1] !== start) this.fill(pick, start);
    const {offsetWidth, offsetHeight} = element;
    const [x, isNextTo] = sideOf(at[0], offsetWidth, width, from !== null && from[0] > at[0]);
    // If the card fits neither to the left nor to the right of the voxel, it is above or below it.
    const above = at[1] - kGapPx - offsetHeight, isFree = !from || from[1] >= at[1];
    const y = isNextTo               ? at[1] - offsetHeight / 2 :
        isFree && above >= kMarginPx ? above :
                                       at[1] + kGapPx;
    const lowest = Math.max(kMarginPx, height - offsetHeight - kMarginPx);
    element.style.transform =
        `translate(${Math.round(x)}px, ${Math.round(Math.min(Math.max(y, kMarginPx), lowest))}px)`;
  }

  fill(pick, start) {
    this.shown = [pick, start];
    const {picks} = this, edge = picks.cellEdge(pick);
    clear(
        this.element,
        h("p", {class: "pick-card-voxel"},
          edge === 1 ? "Voxel " : `Cube of ${countText(edge)}³ at `,
          h("code", {"data-card": "voxel"}, pick.voxel.join(", "))),
        h("p", {class: "faint"}, h("code", {"data-card": "scene"}, picks.sceneText(pick))),
        start && start !== pick && h("p", {"data-card": "measure"}, picks.measureText()),
        start === pick && h("p", {}, "Pick another voxel."), start !== pick && this.buttons(start));
  }

  // Returns the buttons of the card. The card has no buttons while the user picks the second voxel
  // of a measurement, because they could cover this voxel.
  buttons(start) {
    const {picks} = this;
    return h(
        "div", {class: "buttons"},
        h("button", {
          type: "button",
          class: "small",
          "data-action": "card-measure",
          "aria-pressed": String(Boolean(start)),
          on: {click: () => this.act(() => picks.toggleMeasure())}
        },
          "Measure"),
        h("button", {
          type: "button",
          class: "small quiet",
          "data-action": "card-close",
          "aria-label": "Remove the mark",
          on: {click: () => this.act(() => picks.forget())}
        },
          "×"));
  }

  // Runs the action of a button. The action replaces all buttons, so the focus then moves to the
  // picture.
  act(run) {
    run();
    this.focusPicture();
  }
}

// Returns [x, isNextTo]. x is the left edge of a card with the width `size`, for a voxel at the
// column `at` of a picture with this width. isNextTo is true if the card fits to the right or to
// the left of the voxel; otherwise, the card is in the middle of the picture.
function sideOf(at, size, width, prefersLeft) {
  const right = at + kGapPx, left = at - kGapPx - size;
  const fits = {[right]: right + size + kMarginPx <= width, [left]: left >= kMarginPx};
  for (const x of prefersLeft ? [left, right] : [right, left])
    if (fits[x]) return [x, true];
  return [(width - size) / 2, false];
}
