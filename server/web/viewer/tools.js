// The buttons over the picture. They have the names of the viewer's actions.

import {h} from "../lib/dom.js";

const kTools =
    [["reset", "Reset"], ["toggleFly", "Fly"], ["screenshot", "Save picture"], ["help", "Help"]];

export function fillTools(place, ...more) {
  place.replaceChildren(
      ...kTools.map(
          ([name, text]) => h("button", {type: "button", class: "small", "data-tool": name}, text)),
      ...more);
}
