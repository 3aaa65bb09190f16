// The card next to the picked voxel: its place, and the length of a measurement. Phones show it
// above the closed panel.

import {clear, h} from "../../lib/dom.js";
import {countText} from "../../lib/format.js";

const kGapPx = 14;    // between the voxel and the card
const kMarginPx = 8;  // between the card and the edge of the picture

export class PickCard {
  // `picks` is the PickView. focusPicture() is called when a button of the card disappears.
  constructor(picks, focusPicture) {
    Object.assign(this, {picks, focusPicture});
    this.element =
        h("div", {class: "pick-card", role: "group", "aria-label": "Picked voxel", hidden: true});
    this.shown = [];
  }

  // Moves the card next to the point `at` of a picture of this size. Hides it if `at` is null.
  // Keeps the point `from` visible, at which a measurement starts; null: none.
  place(at, from, width, height) {
    const {pick, start} = this.picks, {element} = this;
    element.hidden = !at;
    if (!at) return;
    if (this.shown[0] !== pick || this.shown[1] !== start) this.fill(pick, start);
    const {offsetWidth, offsetHeight} = element;
    const [x, isNextTo] = sideOf(at[0], offsetWidth, width, from !== null && from[0] > at[0]);
    // A card that is too wide for both sides is above or below the voxel.
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

  // The buttons are missing while the second voxel is to be picked, which may be below them.
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

  // Runs the action of a button, which replaces the buttons.
  act(run) {
    run();
    this.focusPicture();
  }
}

// Returns where a card of this width is in a picture, and whether it is next to the column `at`:
// on its right or on its left, or in the middle of the picture if it fits on neither side.
function sideOf(at, size, width, prefersLeft) {
  const right = at + kGapPx, left = at - kGapPx - size;
  const fits = {[right]: right + size + kMarginPx <= width, [left]: left >= kMarginPx};
  for (const x of prefersLeft ? [left, right] : [right, left])
    if (fits[x]) return [x, true];
  return [(width - size) / 2, false];
}
