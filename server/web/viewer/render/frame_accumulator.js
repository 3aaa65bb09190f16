// Draws the samples of a picture and counts them. A sample is drawn in parts, because a GPU that
// gets too much work in one piece freezes the whole system, and some drivers end a context that is
// busy for seconds. At most one sample is being drawn. At most one drawn sample waits until its
// feedback (gl/feedback.js) can be read.

import {mark} from "./statistics.js";

export class FrameAccumulator {
  // show() copies the accumulated picture to the canvas.
  constructor(context, pace, show) {
    this.context = context;
    this.pace = pace;
    this.show = show;
    this.seed = 0;
    this.samples = 0;       // number of samples per pixel in the current picture
    this.hasDrawn = false;  // true once anything was drawn in the current context
    this.drawing = null;    // the sample being drawn
    this.reading = null;    // the drawn sample whose feedback has not been read
  }

  // Starts a new picture. If a full-size sample of a still picture is being drawn, it is abandoned,
  // because a smaller sample finds the missing tiles sooner.
  restart() {
    this.samples = 0;
    if (this.reading) this.reading.isOutdated = true;
    if (!this.drawing) return;
    this.drawing.isOutdated = true;
    if (!this.drawing.isFull || this.drawing.isMoving) return;
    this.context.gl.deleteSync(this.drawing.fence);
    this.drawing = null;
  }

  // Forgets everything that was lost with the context.
  reset() {
    this.hasDrawn = false;
    this.drawing = this.reading = null;
  }

  // Starts to draw a sample. `sample` is {width, height, isFull, isMoving, epoch, poolTextures}.
  begin(values, sample, nowMs) {
    const parts = this.context.passes.draw(values, () => this.pace.partPixels);
    this.drawing = {...sample, parts, fence: null, partMs: nowMs, busyMs: 0, isOutdated: false};
    this.drawPart(nowMs);
  }

  // Draws the next part of the sample if the GPU has finished the previous part. Returns true if
  // the sample is complete.
  continue(nowMs, poolTextures) {
    const {drawing, context: {gl}} = this;
    if (gl.getSyncParameter(drawing.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(drawing.fence);
    // If a pool has grown since the sample began, its texture was replaced. The remaining parts
    // would still read the old texture, so the sample is abandoned.
    if (drawing.poolTextures.some((texture, i) => texture !== poolTextures[i])) {
      this.drawing = null;
      return true;
    }
    drawing.busyMs += this.pace.partDone(nowMs - drawing.partMs);
    return this.drawPart(nowMs);
  }

  // Draws the next part of the sample. Returns true if this was the last part.
  drawPart(nowMs) {
    const {drawing, context: {gl}} = this, {value: pass, done} = drawing.parts.next();
    drawing.partMs = nowMs;
    if (!done) {
      drawing.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.flush();
      return false;
    }
    this.show();
    this.noteDrawn();
    this.samples = drawing.isOutdated ? 0 : this.samples + 1;
    this.reading = {...drawing, pass};
    this.drawing = null;
    return true;
  }

  noteDrawn() {
    if (!this.hasDrawn) mark("first frame");
    this.hasDrawn = true;
  }

  // Returns the drawn sample if its feedback can be read now; otherwise null.
  takeReading() {
    if (!this.reading?.pass.ready) return null;
    const {reading} = this;
    this.reading = null;
    return reading;
  }
}
