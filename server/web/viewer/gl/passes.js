// The programs and targets for a picture, and the order in which the passes run.

import {kColorFeedback} from "./color_shader.js";
import {AsyncReading, gpuDone, pause, Program, Target} from "./gl_objects.js";
import {
  kColoredTrace,
  kCombine,
  kFeedback,
  kLight,
  kOcclusion,
  kPick,
  kPresent,
  kSun,
  kSunPlaces,
  kSunRows,
  kTrace
} from "./picture_shaders.js";

// Light is divided by one of these numbers before it is written to a target. A target with bytes
// holds values of at most 1, so it represents light of up to kByteRange.
const kHalfRange = 1;      // for a target with half floats
const kByteRange = 8;      // for a target with bytes
const kFeedbackBlock = 4;  // edge in canvas pixels of a feedback texel
const kHitFormats = ["RGBA32UI"], kColoredHitFormats = ["RGBA32UI", "R32UI"],
      kLightFormats = ["R8", "R32UI", "R32UI"];
const kSkyFormats = ["RGBA8"], kFeedbackFormats = ["RGBA32UI"];
const kColorTexels =
    1 << 17;  // approximate number of texels in the color feedback; a visible page needs one

// Returns the uniforms for a feedback in which each texel represents a block of pixels: the edge of
// a block in pixels, and the position of the sampled pixel in a block.
function blocksOf(edge, seed) {
  return {u_block: edge, u_sample: [seed % edge, Math.floor(seed / edge) % edge]};
}

export class Passes {
  constructor(gl) {
    this.gl = gl;
    this.floats = Boolean(
        gl.getExtension("EXT_color_buffer_float") ||
        gl.getExtension("EXT_color_buffer_half_float"));
    this.parallel = gl.getExtension("KHR_parallel_shader_compile");
    this.light = new Program(gl, "light", kLight);
    this.occlusion = new Program(gl, "occlusion", kOcclusion);
    this.combine = new Program(gl, "combine", kCombine);
    this.present = new Program(gl, "present", kPresent);
    this.feedback = new Program(gl, "feedback", kFeedback);
    this.trace = null;  // trace and colorFeedback depend on the file, so compile() creates them
    this.colorFeedback = null;
    this.pick = null;
    this.sun = null;
    this.later = null;  // promise for the compilation of pick and sun
    this.disposed = false;
    this.targets = null;
    this.vertexArray = gl.createVertexArray();
    // begin() waits until the programs that do not depend on the file are compiled. Without
    // KHR_parallel_shader_compile it would query the status of a program, which blocks until the
    // program is linked. Then the browser must start to link all programs before the first query,
    // so compile() calls begin() after it has created the remaining programs.
    this.begun = this.parallel ? this.begin() : null;
    this.begun?.catch(() => {});  // compile() reports the error
    this.compiled = null;         // the promise that compile() returns
  }

  get colorRange() {
    return this.floats ? kHalfRange : kByteRange;
  }

  async begin() {
    if (!await this.finish([this.light, this.occlusion, this.combine, this.present, this.feedback]))
      return;
    this.gl.bindVertexArray(this.vertexArray);
    this.warmUp([
      [this.light, kLightFormats], [this.occlusion, kSkyFormats],
      [this.combine, [this.colorFormat]], [this.feedback, kFeedbackFormats]
    ]);
  }

  // Resolves when all programs for a file are compiled. The page remains responsive if the browser
  // compiles in the background. Throws WebGLUnavailable if a program has an error. Does nothing if
  // the context is lost.
  compile(colored) {
    return this.compiled ??= this.compileAll(colored);
  }

  async compileAll(colored) {
    const {gl} = this;
    this.trace = new Program(gl, "trace", colored ? kColoredTrace : kTrace);
    if (colored) this.colorFeedback = new Program(gl, "color feedback", kColorFeedback);
    await (this.begun ??= this.begin());
    if (!await this.finish([this.trace, ...(colored ? [this.colorFeedback] : [])])) return;
    this.warmUp([
      [this.trace, colored ? kColoredHitFormats : kHitFormats],
      ...(colored ? [[this.colorFeedback, kFeedbackFormats]] : [])
    ]);
    await gpuDone(gl, () => this.disposed || gl.isContextLost());
  }

  warmUp(programs) {
    const {gl} = this, words = new Target(gl, 1, 1, ["RGBA32UI"]),
          floats = new Target(gl, 1, 1, ["RGBA8"]);
    for (const [program, formats] of programs)
      program.warmUp(formats, words.textures[0], floats.textures[0]);
    words.dispose();
    floats.dispose();
    gl.flush();
  }

  get colorFormat() {
    return this.floats ? "RGBA16F" : "RGBA8";
  }

  // Compiles the programs that the first picture does not need (pick and sun). Resolves to true if
  // they can be used.
  compileLater() {
    if (!this.later) {
      this.pick = new Program(this.gl, "pick", kPick);
      this.sun = new Program(this.gl, "sun", kSun);
      this.later = this.finish([this.pick, this.sun]);
    }
    return this.later;
  }

  async finish(programs) {
    while (!this.disposed && !programs.every((program) => program.done(this.parallel)))
      await pause();
    if (this.disposed || this.gl.isContextLost()) return false;
    for (const program of programs) program.finish();
    return true;
  }

  // Provides targets for a picture of width x height pixels. The picture has the size of the
  // canvas, `full` {width, height}, or a smaller size while the camera moves or tiles arrive. If a
  // larger size is needed later, the targets get the full size, so that later changes of the size
  // allocate nothing. `colored` is true if the file has colors.
  resize(width, height, full, colored) {
    const {targets} = this,
          isForCanvas = targets?.full.width === full.width && targets.full.height === full.height;
    if (!isForCanvas) this.allocate(width, height, full, colored);
    else if (width > targets.hits.width || height > targets.hits.height)
      this.allocate(full.width, full.height, full, colored);
    // A smaller picture should report as many missing tiles as a full-size picture. So each of its
    // feedback texels covers fewer pixels.
    const share = Math.max(width / full.width, height / full.height);
    Object.assign(this.targets, {
      width,
      height,
      feedbackBlock: Math.ceil(Math.min(1, share) * kFeedbackBlock),
      colorBlock: 2 ** Math.max(0, Math.ceil(Math.log2(width * height / kColorTexels) / 2))
    });
  }

  // True if the targets already have this size.
  hasTargets(width, height, full) {
    const {targets} = this;
    return targets?.width === width && targets.height === height &&
        targets.full.width === full.width && targets.full.height === full.height;
  }

  allocate(width, height, full, colored) {
    const {gl} = this, color = this.colorFormat, across = Math.sqrt(kColorTexels * width / height);
    this.releaseTargets();
    this.targets = {
      full: {width: full.width, height: full.height},
      width,
      height,
      hits: new Target(gl, width, height, colored ? kColoredHitFormats : kHitFormats),
      light: new Target(gl, width, height, kLightFormats),
      sky: new Target(gl, Math.ceil(width / 2), Math.ceil(height / 2), kSkyFormats),
      colors: [new Target(gl, width, height, [color]), new Target(gl, width, height, [color])],
      feedback: new Target(
          gl, Math.ceil(full.width / kFeedbackBlock), Math.ceil(full.height / kFeedbackBlock),
          kFeedbackFormats),
      // Large enough for any size of the picture, with the colorBlock that resize() sets for it.
      colorFeedback: colored ?
          new Target(
              gl, Math.ceil(Math.min(width, across + 4)),
              Math.ceil(Math.min(height, kColorTexels / across + 4)), kFeedbackFormats) :
          null,
      feedbackBlock: kFeedbackBlock,
      colorBlock: 1,
      current: 0,
    };
  }

  get targetBytes() {
    return this.allTargets.reduce((sum, target) => sum + target.bytes, 0);
  }
  get allTargets() {
    if (!this.targets) return [];
    const {hits, light, sky, colors, feedback, colorFeedback} = this.targets;
    return [hits, light, sky, ...colors, feedback, colorFeedback].filter(
        (target) => target !== null);
  }

  // Draws one sample per pixel and accumulates it with the earlier samples; `values.u_frame` is the
  // number of the sample, from 0. Yields between parts of at most `partPixels()` pixels. Returns
  // the reading of the feedback. The member `colors` of the reading is the reading of the color
  // feedback, which is ready at the same time; `colors` is null if no colors are shown.
  * draw(values, partPixels) {
    const {targets} = this, {width, height, hits, light, sky, colors} = targets;
    const all = this.passValues(values);
    const steps = [
      [this.trace, hits, width, height], [this.light, light, width, height],
      [this.occlusion, sky, Math.ceil(width / 2), Math.ceil(height / 2)]
    ];
    let left = partPixels();
    for (const [program, target, columns, allRows] of steps)
      for (let row = 0, rows; row < allRows; row += rows) {
        if (left < columns) {
          yield null;
          left = partPixels();
        }
        rows = Math.min(allRows - row, Math.max(1, Math.floor(left / columns)));
        program.draw(target, all, columns, allRows, {row, rows});
        left -= rows * columns;
      }
    this.combine.draw(colors[1 - targets.current], all, width, height);
    targets.current = 1 - targets.current;
    return this.drawFeedback(all);
  }

  // Returns the uniforms of all passes of a sample.
  passValues(values) {
    const {width, height, hits, light, sky, colors, current} = this.targets;
    return {
      ...values,
      u_size: [width, height],
      u_hits: hits.textures[0],
      u_light: light.textures[0],
      u_sky: sky.textures[0],
      u_normals: light.textures[1],
      u_colors: hits.textures[1] || hits.textures[0],
      u_colored: hits.textures.length > 1,
      u_shadow_missing: light.textures[2],
      u_before: colors[current].textures[0],
      u_share: this.floats ? 1 / (values.u_frame + 1) : 1,
      u_range: this.colorRange
    };
  }

  drawFeedback(values) {
    const {feedback, colorFeedback, feedbackBlock, colorBlock} = this.targets;
    const colors = colorFeedback && values.u_color_levels >= 0 ?
        this.read(this.colorFeedback, colorFeedback, colorBlock, values) :
        null;
    return Object.assign(this.read(this.feedback, feedback, feedbackBlock, values), {colors});
  }

  // Draws a feedback with one texel per block of pixels, and starts to read its texels.
  read(program, target, block, values) {
    const size = [this.targets.width, this.targets.height].map((edge) => Math.ceil(edge / block));
    program.draw(target, {...values, ...blocksOf(block, values.u_seed)}, ...size);
    return new AsyncReading(this.gl, target, ...size);
  }

  // Draws the accumulated picture to the canvas.
  show(exposure, width, height) {
    const {targets} = this;
    this.present.draw(
        null, {
          u_color: targets.colors[targets.current].textures[0],
          u_extent: [width, height],
          u_size: [targets.width, targets.height],
          u_exposure: exposure * this.colorRange
        },
        width, height);
  }

  // Returns the hits of a picture, which may have any size. They are words of pack_hit(), in rows
  // from the bottom.
  capture(values, width, height) {
    const {gl} = this, target = new Target(gl, width, height, ["RGBA32UI"]);
    this.trace.draw(target, {...values, u_color_levels: -1}, width, height);
    const words = new Uint32Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    target.dispose();
    return words;
  }

  // Resolves to the hit of one ray: 4 words of pack_hit(), the low corner of the cell, and the slot
  // of the cell's tile. Resolves to null if the context is lost. Does not block on the GPU. Call
  // compileLater() first.
  async pickOne(values) {
    const {gl} = this, target = new Target(gl, 2, 1, ["RGBA32UI"]);
    this.pick.draw(target, values, 2, 1);
    const reading = new AsyncReading(gl, target, 2, 1);
    target.dispose();
    while (!reading.ready) {
      if (this.disposed || gl.isContextLost()) return null;
      await pause();
    }
    return reading.take();
  }

  // Returns {place, wanted}. `place` is the number of one of 48 positions of the sun: at this
  // position, the lit share of the surfaces in the last picture is nearest to `share`. `wanted` is
  // a Map, as in readFeedback(), of the missing tiles that could change this choice; all its
  // priorities are 1. Call compileLater() first.
  chooseSun(values, share) {
    const {gl, targets} = this, wanted = new Map();
    const target = new Target(gl, kSunPlaces, kSunRows, ["RGBA32UI"]),
          words = new Uint32Array(kSunPlaces * kSunRows * 4);
    this.sun.draw(
        target, {
          ...values,
          u_size: [targets.width, targets.height],
          u_hits: targets.hits.textures[0],
          u_normals: targets.light.textures[1]
        },
        kSunPlaces, kSunRows);
    gl.readPixels(0, 0, kSunPlaces, kSunRows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    target.dispose();
    let best = 0, bestOff = Infinity;
    for (let place = 0; place < kSunPlaces; ++place) {
      let seen = 0, lit = 0;
      for (let row = 0; row < kSunRows; ++row) {
        const at = 4 * (row * kSunPlaces + place), state = words[at];
        if (words[at + 1] !== 0) wanted.set(words[at + 1], 1);
        seen += state > 0;
        lit += state === 2;
      }
      const off = Math.abs(lit / Math.max(1, seen) - share);
      if (off < bestOff) [best, bestOff] = [place, off];
    }
    return {place: best, wanted};
  }

  dispose() {
    this.disposed = true;
    this.releaseTargets();
    for (const program
             of [this.trace, this.light, this.occlusion, this.combine, this.present, this.feedback,
                 this.colorFeedback, this.pick, this.sun])
      program?.dispose();
    this.gl.deleteVertexArray(this.vertexArray);
  }

  releaseTargets() {
    for (const target of this.allTargets) target.dispose();
    this.targets = null;
  }
}
