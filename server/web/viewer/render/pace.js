// Measures the speed of the GPU. Chooses, from this speed, the number of pixels per part of a
// sample, and the internal resolution while the camera moves or tiles arrive.

const kTargetMs = 40;  // target time of a frame while the camera moves
const kPartMs = 120;   // target time of a part of a sample
const kScales = [1, 3 / 4, 1 / 2, 3 / 8, 1 / 4, 3 / 16, 1 / 8];  // internal / full resolution
// Limits for lacksFew: missing tiles, and width in pixels of the widest missing cell.
const kFewTiles = 64, kCoarsePixels = 16;
const kMinPart = 1 << 12,
      kFirstPart = 1 << 17;  // pixels per part, until the speed is known

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
  // The scale while tiles arrive. A small picture quickly finds most of the tiles that a view
  // needs, but it has few rays and finds the last missing tiles only by chance. So if only few
  // tiles are missing, a full-size picture searches for them.
  get seekingScale() {
    return this.lacksFew ? 1 : this.scale;
  }
  beginView() {
    this.lacksFew = false;
  }
  noteLacking(tiles, coarsePixels) {
    this.lacksFew ||= tiles < kFewTiles && coarsePixels < kCoarsePixels;
  }

  // Measures the interval between frames. Call it when the browser requests a frame.
  tick(nowMs) {
    const interval = nowMs - this.callMs;
    this.callMs = nowMs;
    if (interval > 4) this.intervalMs = Math.min(interval, 1.05 * this.intervalMs, kTargetMs);
  }

  // Estimates the time on the GPU from an observed time. The GPU may have finished at any time
  // since the previous frame, so half of the frame interval is subtracted.
  gpuMs(seenMs) {
    return Math.max(1, seenMs - this.intervalMs / 2);
  }

  // Takes the observed time of a part that is not the last part of its sample, and adjusts the
  // number of pixels per part. Returns the estimated time on the GPU.
  partDone(seenMs) {
    const partMs = this.gpuMs(seenMs);
    this.partPixels =
        Math.max(kMinPart, Math.round(this.partPixels * Math.min(2, kPartMs / partMs)));
    return partMs;
  }

  // Takes the observed time of the last or only part of a sample. `busyMs` is the sum of partDone()
  // for the other parts, and `pixels` the number of the sample's pixels. If `counts` is true,
  // chooses the internal resolution from the total time.
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
