// How fast the GPU is, and how much it is given at once: pixels of a part, and of a picture while the camera moves.

const kTargetMs = 40;           // of a frame while the camera moves
const kPartMs = 120;            // of what the GPU is given at once
const kScales = [1, 3 / 4, 1 / 2, 3 / 8, 1 / 4, 3 / 16, 1 / 8];  // of the internal resolution
const kFewTiles = 64, kCoarsePixels = 16;  // that a picture lacks, and the width of its cells for want of them
const kMinPart = 1 << 12, kFirstPart = 1 << 17;     // pixels of one part, until it is known how long one takes

export class Pace {
  constructor() {
    this.part_pixels = kFirstPart;
    this.frame_ms = 0;
    this.call_ms = 0;
    this.interval_ms = 16;       // between two frames of the browser
    this.scale_index = kScales.length - 1;
    this.lacks_few = false;
  }

  get scale() {
    return kScales[this.scale_index];
  }
  // The same while tiles arrive. Small pictures find soonest what most of a view needs, but upon the rest their rays hit
  // by chance: when one lacks few tiles, the pixels of the final picture say what is still missing.
  get seeking_scale() {
    return this.lacks_few ? 1 : this.scale;
  }
  begin_view() {
    this.lacks_few = false;
  }
  note_lacking(tiles, coarse_pixels) {
    this.lacks_few ||= tiles < kFewTiles && coarse_pixels < kCoarsePixels;
  }

  // The browser offers to draw a frame.
  tick(now_ms) {
    const interval = now_ms - this.call_ms;
    this.call_ms = now_ms;
    if (interval > 4) this.interval_ms = Math.min(interval, 1.05 * this.interval_ms, kTargetMs);
  }

  // What is seen as done at a frame may have been done since the one before.
  gpu_ms(seen_ms) {
    return Math.max(1, seen_ms - this.interval_ms / 2);
  }

  // One of several parts was seen as done after so long. Returns how long it took.
  part_done(seen_ms) {
    const part_ms = this.gpu_ms(seen_ms);
    this.part_pixels = Math.max(kMinPart, Math.round(this.part_pixels * Math.min(2, kPartMs / part_ms)));
    return part_ms;
  }

  // The same of the last part, or the only one, of a picture with so many pixels; its other parts took `busy_ms`.
  // Chooses the internal resolution, if it `counts` for that, by the time that a frame of the last one took.
  frame_done(seen_ms, busy_ms, pixels, counts) {
    const frame_ms = busy_ms + this.gpu_ms(seen_ms);
    if (busy_ms === 0) this.part_pixels = Math.max(kMinPart, Math.round(2.25 * pixels * kPartMs / frame_ms));
    this.frame_ms = this.frame_ms > 0 ? 0.7 * this.frame_ms + 0.3 * frame_ms : frame_ms;
    if (!counts) return;
    const wanted = this.scale * Math.sqrt(kTargetMs / Math.max(1, frame_ms));
    const slower = frame_ms > 1.4 * kTargetMs, faster = this.scale_index > 0 && wanted >= kScales[this.scale_index - 1];
    if (!slower && !faster) return;
    const index = kScales.findIndex((scale) => scale <= wanted);
    this.scale_index = index < 0 ? kScales.length - 1 : faster ? Math.max(index, this.scale_index - 2) : index;
  }
}
