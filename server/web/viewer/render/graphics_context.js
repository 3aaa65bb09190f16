// The WebGL context of a canvas and its shader programs. A browser can take the context away at any
// time and restore it later. A restored context is empty, so programs, tiles and targets are
// created again.

import {createContext, WebGLUnavailable} from "../gl/gl_objects.js";
import {Passes} from "../gl/passes.js";

const kDefaultMaxSize = 4096;  // edge of a texture, until a context has reported its own limit

export class GraphicsContext {
  // `early`: the context that early.js has created for this canvas; null if it has created none.
  // Throws WebGLUnavailable.
  constructor(canvas, early, {onLost, onRestored}) {
    this.canvas = canvas;
    this.gl = early?.gl ?? createContext(canvas);
    if (!this.gl)
      throw new WebGLUnavailable("This browser or its graphics driver does not offer WebGL 2.");
    this.isLost = this.gl.isContextLost();
    this.isDisposed = false;
    this.passes = null;
    this.maxSize = kDefaultMaxSize;
    this.compileBeginMs = 0;
    this.compileMs = 0;
    this.listening = new AbortController();
    this.listen(onLost, onRestored);
    if (!this.isLost) this.createPasses(early?.passes, early?.beginMs);
  }

  listen(onLost, onRestored) {
    const {signal} = this.listening;
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.isLost = true;
      onLost();
    }, {signal});
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.isLost = false;
      this.createPasses();
      onRestored();
    }, {signal});
  }

  createPasses(passes = null, beginMs = performance.now()) {
    this.maxSize = this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE) || kDefaultMaxSize;
    this.compileBeginMs = passes ? beginMs : performance.now();
    if (this.passes) this.passes.disposed = true;  // their objects were lost with the old context
    this.passes = passes ?? new Passes(this.gl);
  }

  // True if `passes` can draw: their context was neither lost nor replaced.
  owns(passes) {
    return !this.isDisposed && !this.isLost && passes === this.passes && !this.gl.isContextLost();
  }

  // Resolves to true when the programs for the file can be used. Resolves to false if the context
  // was lost.
  async compile(isColored) {
    const {passes} = this;
    await passes.compile(isColored);
    if (!this.owns(passes)) return false;
    this.compileMs = performance.now() - this.compileBeginMs;
    return true;
  }

  dispose() {
    this.isDisposed = true;
    this.listening.abort();
    this.passes?.dispose();
  }
}
