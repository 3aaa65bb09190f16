// Begins what takes longest, the graphics context and its programs, while the other modules of the
// page still load. A job may have nothing to look at yet, so its page does not.

import {createContext} from "./gl/gl_objects.js";
import {Passes} from "./gl/passes.js";
import {TileSource} from "./tile_source.js";

let begun = null;

function begin(canvas) {
  const source = new TileSource({base: "/api/v1/view"}), manifest = source.manifest();
  const beginMs = performance.now(), gl = createContext(canvas);
  manifest.catch(() => {});  // reported by whoever waits for it
  if (!gl) return;
  const passes = gl.isContextLost() ? null : new Passes(gl),
        mine = {source, manifest, beginMs, gl, passes};
  begun = mine;
  // A context that is lost now already comes back, too; its programs do not.
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    mine.passes = null;
    if (passes) passes.disposed = true;
  });
  // A program that fails is reported by the next compile().
  manifest.then(({colors}) => mine.passes?.compile(Boolean(colors))).catch(() => {});
}

if (!new URLSearchParams(location.search).has("job")) begin(document.getElementById("scene"));

// {source, manifest, beginMs, gl, passes} for the canvas of the page, null if it was taken already,
// or cannot be had. `passes` are null if the context was lost.
export function takeBegun() {
  const taken = begun;
  begun = null;
  return taken;
}
