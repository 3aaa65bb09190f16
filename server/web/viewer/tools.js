// The buttons over the picture, by the names of the viewer's actions.

import {h} from "../lib/dom.js";

const kTools = [["reset", "Reset"], ["toggle_fly", "Fly"], ["screenshot", "Save picture"], ["help", "Help"]];

export function fill_tools(place, ...more) {
  place.replaceChildren(...kTools.map(([name, text]) =>
    h("button", {type: "button", class: "small", "data-tool": name}, text)), ...more);
}
