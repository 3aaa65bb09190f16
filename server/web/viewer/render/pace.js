// How fast the GPU is, and how much it is given at once: pixels of a part, and of a picture while
// the camera moves.

const kTargetMs = 40;  // of a frame while the camera moves
const kPartMs = 120;   // of what the GPU is given at once
const kScales = [1, 3 / 4, 1 / 2, 3 / 8, 1 / 4, 3 / 16, 1 / 8];  // of the internal resolution
const kFewTiles = 64,
      kCoarsePixels = 16;  // that a picture lacks, and the width of its cells for want of them
const kMinPart = 1 << 12,
      kFirstPart = 1 << 17;  // pixels of one part, until it is known how long one takes

export class Pace {
  constructor() {
    this.partPixels = kFirstPart;
    this.frameMs = 0;
    this.callMs = 0;
    this.intervalMs = 16;  // between two frames of the browser
    this.scaleIndex = kScales.length - 1;
    this.lacksFew = false;
  }

  get scale() {
    return kScales[this.scaleIndex];
  }
  // The same while tiles arrive. Small pictures find soonest what most of a view needs, but upon
  // the rest their rays hit by chance: when one lacks few tiles, the pixels of the final picture
  // say what is still missing.
  get seekingScale() {
    return this.lacksFew ? 1 : this.scale;
  }
  beginView() {
    this.lacksFew = false;
  }
  noteLacking(tiles, coarsePixels) {
    this.lacksFew ||= tiles < kFewTiles && coarsePixels < kCoarsePixels;
  }

  // The browser offers to draw a frame.
  tick(nowMs) {
    const interval = nowMs - this.callMs;
    this.callMs = nowMs;
    if (interval > 4) this.intervalMs = Math.min(interval, 1.05 * this.intervalMs, kTargetMs);
  }

  // What is seen as done at a frame may have been done since the one before.
  gpuMs(seenMs) {
    return Math.max(1, seenMs - this.intervalMs / 2);
  }

  // One of several parts was seen as done after so long. Returns how long it took.
  partDone(seenMs) {
    const partMs = this.gpuMs(seenMs);
    this.partPixels =
        Math.max(kMinPart, Math.round(this.partPixels * Math.min(2, kPartMs / partMs)));
    return partMs;
  }

  // The same of the last part, or the only one, of a picture with so many pixels; its other parts
  // took `busyMs`. Chooses the internal resolution, if it `counts` for that, by the time that a
  // frame of the last one took.
  frameDone(seenMs, busyMs, pixels, counts) {
    const frameMs = busyMs + this.gpuMs(seenMs);
    if (busyMs === 0)
      this.partPixels = Math.max(kMinPart, Math.round(2.25 * pixels * kPartMs / frameMs));
    this.frameMs = this.frameMs > 0 ? 0.7 * this.frameMs + 0.3 * frameMs : frameMs;
    if (!counts) return;
    const wanted = this.scale * Math.sqrt(kTargetMs / Math.max(1, frameMs));
    const slower = frameMs > 1.4 * kTargetMs,
          faster = this.scaleIndex > 0 && wanted >= kScales[this.scaleIndex - 1];
    if (!slower && !faster) return;
    const index = kScales.findIndex((scale) => scale <= wanted);
    this.scaleIndex = index < 0 ? kScales.length - 1 :
        faster                  ? Math.max(index, this.scaleIndex - 2) :
                                  index;
  }
}
