// How complete the picture of the current view is, by the readings of its frames.

const kQuietReadings = 2;             // without a missing tile, until the view is complete
export const kMaxLateCellPixels = 3;  // missing cells up to this width do not restart a picture

export class ViewProgress {
  constructor() {
    this.quietReadings = 0;
    this.coarsePixels = 0;    // width of the widest cell whose tile is missing
    this.isFullSize = false;  // the last frame read had all pixels of the canvas
    this.waiting = [];        // resolve functions of complete()
  }

  restart() {
    this.quietReadings = 0;
  }

  get isComplete() {
    return this.quietReadings >= kQuietReadings;
  }

  // True if a tile that arrives changes the picture enough to start it again. Otherwise the
  // remaining samples show it.
  get needsRestartOnArrival() {
    return !this.isComplete || this.coarsePixels > kMaxLateCellPixels;
  }

  // Takes the reading of a frame of the current view. `isQuiet`: the frame was up to date, the
  // camera is still, and no tile is in flight.
  takeReading(isQuiet, isFullSize) {
    if (isQuiet) this.quietReadings++;
    else if (this.needsRestartOnArrival) this.quietReadings = 0;
    this.isFullSize = isFullSize;
  }

  resolveWaiting() {
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}
