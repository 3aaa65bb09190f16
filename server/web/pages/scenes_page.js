// The uploaded scenes, with buttons to delete them.

import {getJson, poll, request} from "../lib/api.js";
import {announce, clear, confirmAction, h} from "../lib/dom.js";
import {agoText, sizeText, timeText} from "../lib/format.js";
import {problemBox} from "../views/parts.js";

const kPageSize = 100;
const kPauseMs = 8000;

export function scenesPage(_, query, signal) {
  const cursor = query.get("cursor");
  const error = h("div", {role: "alert"});
  const rows = h("tbody", {});
  const table = h(
      "div", {class: "scroll card"},
      h("table", {class: "scenes"},
        h("thead", {},
          h("tr", {},
            ["Scene", "Size", "Uploaded", ""].map(
                (name) => h("th", {scope: "col", class: name === "Size" ? "number" : ""}, name)))),
        rows));
  const empty = h("p", {class: "empty", hidden: true}, "No scenes are uploaded.");
  const more = h("div", {class: "buttons end"});
  let known = "";
  const update = async () => {
    const path = new URLSearchParams({limit: kPageSize, ...(cursor && {cursor})});
    const list = await getJson(`/api/v1/scenes?${path}`, signal);
    const text = JSON.stringify(list);
    if (text === known) return kPauseMs;  // keeps the elements and their focus
    known = text;
    clear(rows, list.scenes.map((scene) => sceneRow(scene, error, update)));
    table.hidden = list.scenes.length === 0;
    empty.hidden = list.scenes.length > 0;
    clear(
        more,
        list.next_cursor &&
            h("a", {
              class: "button",
              href: `#/scenes?${new URLSearchParams({cursor: list.next_cursor})}`
            },
              "More scenes"));
    return kPauseMs;
  };
  poll(update, (problem) => clear(error, problemBox(problem)), signal);
  return {
    title: "Scenes",
    content:
        h("div", {class: "stack"},
          h("div", {class: "page-head"}, h("h1", {}, "Scenes"),
            h("a", {class: "button primary", href: "#/new"}, "Upload a scene")),
          error, table, empty, more)
  };
}

function sceneRow(scene, error, update) {
  const remove = async () => {
    clear(error);
    if (!await confirmAction(
            "Delete this scene?", `${scene.name} will be deleted from the service.`,
            "Delete the scene"))
      return;
    try {
      await request("DELETE", `/api/v1/scenes/${encodeURIComponent(scene.name)}`);
      announce(`${scene.name} is deleted`);
      await update();
    } catch (problem) {
      if (problem.code === undefined) throw problem;
      clear(error, problemBox(problem));
    }
  };
  const size = scene.complete ? sizeText(scene.size_bytes) :
                                `${sizeText(scene.received_bytes)} of an unfinished upload`;
  return h(
      "tr", {}, h("th", {scope: "row", class: "name"}, scene.name),
      h("td", {class: "number"}, size),
      h("td", {title: timeText(scene.modified_at)}, agoText(scene.modified_at)),
      h("td", {class: "number"},
        h("button", {
          type: "button",
          class: "small danger",
          "aria-label": `Delete ${scene.name}`,
          on: {click: remove}
        },
          "Delete")));
}
