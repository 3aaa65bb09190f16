// Tracks how complete the picture of the current view is, from the feedback readings of its frames
// (gl/feedback.js).

const kQuietReadings = 2;             // readings without a missing tile that complete the view
export const kMaxLateCellPixels = 3;  // arriving cells of up to this width do not restart a picture

export class ViewProgress {
  constructor() {
    this.quietReadings = 0;
    this.coarsePixels = 0;    // width of the widest cell whose tile is missing
    this.isFullSize = false;  // true if the last frame that was read had all pixels of the canvas
    this.waiting = [];        // the resolve functions of the promises from complete()
  }

  restart() {
    this.quietReadings = 0;
  }

  get isComplete() {
    return this.quietReadings >= kQuietReadings;
  }

  // True if an arriving tile changes the picture so much that the picture must start again. If
  // false, only the remaining samples of the picture use the tile.
  get needsRestartOnArrival() {
    return !this.isComplete || this.coarsePixels > kMaxLateCellPixels;
  }

  // Takes the reading of a frame of the current view. `isQuiet`: the frame was up to date, the
  // camera is still, and no request for a tile is in progress.
  takeReading(isQuiet, isFullSize) {
    if (isQuiet) this.quietReadings++;
    else if (this.needsRestartOnArrival) this.quietReadings = 0;
    this.isFullSize = isFullSize;
  }

  resolveWaiting() {
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}
