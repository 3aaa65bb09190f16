// The result of a job: preview, numbers and levels.

import {request} from "../lib/api.js";
import {clear, fact, h, setText} from "../lib/dom.js";
import {countText, durationText, gridText, sizeText, titleText} from "../lib/format.js";

import {downloadCommand} from "./job_actions.js";
import {copyButton} from "./parts.js";

// Fills `place`, unless it already shows this result.
export function resultView(place, job, signal) {
  const key = `${job.result.sha256} ${job.preview}`;
  if (place.dataset.key === key && place.firstChild) return;
  if (place.querySelector("canvas.scene") && place.dataset.key?.startsWith(job.result.sha256))
    return;  // the user explores this result in the embedded viewer
  place.dataset.key = key;
  const r = job.result;
  const saved = 100 * (1 - r.dag_nodes / Math.max(1, r.svo_nodes));
  clear(
      place,
      h("section", {class: "card result-card", "aria-labelledby": "result-title"},
        h("h2", {id: "result-title"}, "Result"),
        h("div", {class: "seen"}, picture(job, signal),
          h("dl", {class: "figures"},
            [
              ["Voxels", countText(r.voxels)],
              ["Octree nodes", countText(r.svo_nodes)],
              ["DAG nodes", countText(r.dag_nodes)],
              ["Nodes saved", `${saved.toFixed(1)} %`],
              ["File", sizeText(r.bytes)],
              ["Triangles", countText(r.triangles)],
              ["Wall time", durationText(r.wall_s)],
              ["CPU time", durationText(r.cpu_s)],
              ["Peak memory", sizeText(r.peak_rss_bytes)],
            ]
                .map(
                    ([name, value]) =>
                        h("div", {class: "figure"}, h("dt", {}, name), h("dd", {}, value))))),
        h("dl", {class: "facts"},
          fact(
              "SHA-256", h("code", {class: "long"}, r.sha256), " ",
              copyButton(r.sha256, "the SHA-256")),
          fact("Cube", cubeText(r.bounds)), fact("Command", downloadCommand(job)))),
      h("section", {class: "card", "aria-labelledby": "levels-title"},
        h("h2", {id: "levels-title"}, "Levels"), levelsTable(job)));
}

function cubeText({origin, edge}) {
  const short = (x) => Number(x.toPrecision(6));
  return `from ${origin.map(short).join(", ")}, edge ${short(edge)}`;
}

// Returns the picture and, below it, the buttons that open the result in a viewer.
function picture(job, signal) {
  const place = preview(job, signal);
  const error = h("p", {class: "bad", role: "alert"});
  const button =
      h("button", {type: "button", class: "small", "data-action": "look"}, "Look around here");
  button.addEventListener("click", async () => {
    if (button.hasAttribute("aria-busy")) return;
    button.setAttribute("aria-busy", "true");
    try {
      const {embedViewer} = await import("../viewer/embedded.js");
      await embedViewer(place, job, signal);
      button.hidden = true;
    } catch (problem) {
      setText(error, problem.message);
    } finally {
      button.removeAttribute("aria-busy");
    }
  });
  return h(
      "div", {class: "picture-frame"}, place, error,
      h("div", {class: "buttons"}, button,
        h("a", {class: "button small", "data-action": "view", href: `/viewer.html?job=${job.id}`},
          "View in the whole window")));
}

function preview(job, signal) {
  const place = h("div", {class: "picture"});
  if (!job.preview) {
    place.append(h("p", {class: "empty"}, "Rendering the preview…"));
    return place;
  }
  request("GET", job.links.preview, {signal})
      .then((response) => response.blob())
      .then((blob) => {
        const url = URL.createObjectURL(blob);
        signal.addEventListener("abort", () => URL.revokeObjectURL(url), {once: true});
        if (place.querySelector("canvas")) return;
        clear(place, h("img", {
                src: url,
                width: "960",
                height: "540",
                alt: `Rendering of the voxels of ${titleText(job)}`
              }));
      })
      .catch(() => {
        if (!signal.aborted)
          clear(place, h("p", {class: "empty"}, "The preview could not be loaded."));
      });
  return place;
}

// Returns a table of the levels. Level 0 is the root; the last level has the bricks of 4³ voxels.
function levelsTable(job) {
  const levels = job.result.levels;
  const maxNodes = Math.max(1, ...levels.map((level) => level.nodes));
  const rows = levels.map(({level, nodes, bytes}) => {
    const bar = h("span", {class: "bar"});
    bar.style.width = `${(100 * nodes / maxNodes).toFixed(2)}%`;
    const name = level === levels.length - 1 ? "bricks" : level === 0 ? "root" : "";
    return h(
        "tr", {},
        h("th", {scope: "row"}, String(level), name && h("span", {class: "faint"}, ` ${name}`)),
        h("td", {class: "number"}, gridText(job.resolution / 2 ** level)),
        h("td", {class: "number"}, countText(nodes)),
        h("td", {class: "bar-cell", "aria-hidden": "true"}, bar),
        h("td", {class: "number"}, sizeText(bytes)));
  });
  return h(
      "div", {class: "scroll", tabindex: "0", role: "region", "aria-labelledby": "levels-title"},
      h("table", {},
        h("thead", {},
          h("tr", {}, h("th", {scope: "col"}, "Level"),
            h("th", {scope: "col", class: "number"}, "Cube edge"),
            h("th", {scope: "col", class: "number"}, "Nodes"), h("td", {class: "bar-cell"}),
            h("th", {scope: "col", class: "number"}, "Bytes"))),
        h("tbody", {}, rows)));
}
