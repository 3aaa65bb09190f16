// The viewer that replaces the picture on a job's page. It has no panel and does not change the
// page's address.

import {authorization} from "../lib/api.js";
import {h} from "../lib/dom.js";
import {titleText} from "../lib/format.js";

import {Viewer} from "./app.js";
import {Renderer} from "./render/renderer.js";
import {TileSource} from "./tile_source.js";
import {fillTools} from "./tools.js";

const kBudgetBytes = 64 * 2 ** 20;

// Shows the viewer in `place` until `signal` aborts. If that is not possible, throws an Error and
// leaves `place` unchanged.
export async function embedViewer(place, job, signal) {
  const isKeyed = Boolean(document.activeElement?.matches(":focus-visible"));
  const canvas = h("canvas", {
    class: "scene",
    tabindex: "0",
    role: "application",
    "aria-label": `The voxels of ${titleText(job)}. Arrow keys orbit, H lists all keys.`
  });
  const stage = h("div", {class: "stage"}, canvas);
  const tools = h("div", {class: "tools embedded", role: "toolbar", "aria-label": "View"});
  fillTools(tools);
  const status = h("p", {class: "status"});
  stage.append(tools, status);
  const source = new TileSource({base: job.links.self, headers: authorization()});
  let viewer = null;
  const renderer =
      new Renderer(canvas, source, {budgetBytes: kBudgetBytes, onChange: () => viewer?.schedule()});
  // Releases the WebGL context early, because a browser has only a few contexts and this page
  // remains open.
  const release = () => {
    renderer.dispose();
    if (!renderer.context.gl.isContextLost())
      renderer.context.gl.getExtension("WEBGL_lose_context")?.loseContext();
  };
  try {
    const manifest = await source.manifest();
    await renderer.start();
    if (signal.aborted) return release();
    place.replaceChildren(h("div", {class: "viewer embedded"}, stage));
    viewer = new Viewer({
      canvas,
      renderer,
      manifest,
      signal,
      bookmarks: false,
      isKeyed,
      fileName: `job-${job.id}`,
      places: {panel: h("div"), tools, status}
    });
  } catch (error) {
    release();
    throw error;
  }
  signal.addEventListener("abort", release, {once: true});
  canvas.focus({preventScroll: true});
}
