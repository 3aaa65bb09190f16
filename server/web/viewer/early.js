// Creates the graphics context and its programs while the other modules of the page are still
// loading: compiling the programs takes longer than anything else. The page of a job does not use
// this module, because a job may have nothing to draw yet.

import {createContext} from "./gl/gl_objects.js";
import {Passes} from "./gl/passes.js";
import {isPublished, sourceOfPage} from "./page_source.js";

let begun = null;

function begin(canvas) {
  const source = sourceOfPage(), manifest = source.manifest();
  const beginMs = performance.now(), gl = createContext(canvas);
  manifest.catch(() => {});  // the error is reported where the promise is awaited
  if (!gl) return;
  const passes = gl.isContextLost() ? null : new Passes(gl),
        mine = {source, manifest, beginMs, gl, passes};
  begun = mine;
  // If the context is lost before the renderer takes it, its programs are also lost. The renderer
  // then compiles them again.
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    mine.passes = null;
    if (passes) passes.disposed = true;
  });
  // The error of a program is ignored here, because the renderer's call of compile() reports it.
  manifest.then(({colors}) => mine.passes?.compile(Boolean(colors))).catch(() => {});
}

if (isPublished() || !new URLSearchParams(location.search).has("job"))
  begin(document.getElementById("scene"));

// Returns {source, manifest, beginMs, gl, passes} for the canvas of the page. `passes` is null if
// the context was lost. Returns null after the first call, or if no context is available.
export function takeBegun() {
  const taken = begun;
  begun = null;
  return taken;
}
