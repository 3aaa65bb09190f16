// Programs and targets of a picture, and the order in which its passes run.

import {AsyncReading, gpu_done, pause, Program, Target} from "./gl_objects.js";
import {kColorFeedback} from "./color_shader.js";
import {kColoredTrace, kCombine, kFeedback, kLight, kOcclusion, kPick, kPresent, kSun, kSunPlaces, kSunRows, kTrace} from "./picture_shaders.js";

const kHalfRange = 1;        // brightest light of a target with half floats
const kByteRange = 8;        // and of one with bytes
const kFeedbackBlock = 4;     // pixels of the canvas that a texel of the feedback is of
const kHitFormats = ["RGBA32UI"], kColoredHitFormats = ["RGBA32UI", "R32UI"], kLightFormats = ["R8", "R32UI", "R32UI"];
const kSkyFormats = ["RGBA8"], kFeedbackFormats = ["RGBA32UI"];
const kColorTexels = 1 << 17;  // of the feedback of colors, about: each page that is seen needs one of its own

// The pixels that a texel of a feedback is of, and which of them it says more about.
function blocks_of(edge, seed) {
  return {u_block: edge, u_sample: [seed % edge, Math.floor(seed / edge) % edge]};
}

export class Passes {
  constructor(gl) {
    this.gl = gl;
    this.floats = Boolean(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"));
    this.parallel = gl.getExtension("KHR_parallel_shader_compile");
    this.light = new Program(gl, "light", kLight);
    this.occlusion = new Program(gl, "occlusion", kOcclusion);
    this.combine = new Program(gl, "combine", kCombine);
    this.present = new Program(gl, "present", kPresent);
    this.feedback = new Program(gl, "feedback", kFeedback);
    this.trace = null;           // these two depend on the file
    this.color_feedback = null;
    this.pick = null;
    this.sun = null;
    this.later = null;           // promise of these two
    this.disposed = false;
    this.targets = null;
    this.vertex_array = gl.createVertexArray();
    // What does not depend on the file. A compiler that cannot say when it is done is not waited for before it has all.
    this.begun = this.parallel ? this.begin() : null;
    this.begun?.catch(() => {});  // compile() reports it
    this.compiled = null;        // promise of compile()
  }

  get color_range() {
    return this.floats ? kHalfRange : kByteRange;
  }

  async begin() {
    if (!await this.finish([this.light, this.occlusion, this.combine, this.present, this.feedback])) return;
    this.gl.bindVertexArray(this.vertex_array);
    this.warm_up([[this.light, kLightFormats], [this.occlusion, kSkyFormats], [this.combine, [this.color_format]],
                  [this.feedback, kFeedbackFormats]]);
  }

  // Resolves when all programs for a file are compiled; the page stays responsive where the browser can compile in
  // the background. Throws WebGLUnavailable if one cannot be; does nothing if the context is lost.
  compile(colored) {
    return this.compiled ??= this.compile_all(colored);
  }

  async compile_all(colored) {
    const {gl} = this;
    this.trace = new Program(gl, "trace", colored ? kColoredTrace : kTrace);
    if (colored) this.color_feedback = new Program(gl, "color feedback", kColorFeedback);
    await (this.begun ??= this.begin());
    if (!await this.finish([this.trace, ...(colored ? [this.color_feedback] : [])])) return;
    this.warm_up([[this.trace, colored ? kColoredHitFormats : kHitFormats],
                  ...(colored ? [[this.color_feedback, kFeedbackFormats]] : [])]);
    await gpu_done(gl, () => this.disposed || gl.isContextLost());
  }

  warm_up(programs) {
    const {gl} = this, words = new Target(gl, 1, 1, ["RGBA32UI"]), floats = new Target(gl, 1, 1, ["RGBA8"]);
    for (const [program, formats] of programs) program.warm_up(formats, words.textures[0], floats.textures[0]);
    words.dispose();
    floats.dispose();
    gl.flush();
  }

  get color_format() {
    return this.floats ? "RGBA16F" : "RGBA8";
  }

  // The same for the programs that a first picture does not need. Resolves to whether they can be used.
  compile_later() {
    if (!this.later) {
      this.pick = new Program(this.gl, "pick", kPick);
      this.sun = new Program(this.gl, "sun", kSun);
      this.later = this.finish([this.pick, this.sun]);
    }
    return this.later;
  }

  async finish(programs) {
    while (!this.disposed && !programs.every((program) => program.done(this.parallel))) await pause();
    if (this.disposed || this.gl.isContextLost()) return false;
    for (const program of programs) program.finish();
    return true;
  }

  // Targets for a picture of this size, of the `full` one {width, height}, or of fewer pixels while the camera moves.
  // They are as large as they have to be, which is as large as the full one from the second size on: so nothing is
  // allocated when a camera begins to move or stops. `colored`: of a file with colors.
  resize(width, height, full, colored) {
    const {targets} = this, is_for_canvas = targets?.full.width === full.width && targets.full.height === full.height;
    if (!is_for_canvas) this.allocate(width, height, full, colored);
    else if (width > targets.hits.width || height > targets.hits.height) this.allocate(full.width, full.height, full, colored);
    // A small picture says as much as a large one of what is missing: then a texel is of fewer pixels.
    const share = Math.max(width / full.width, height / full.height);
    Object.assign(this.targets, {width, height, feedback_block: Math.ceil(Math.min(1, share) * kFeedbackBlock),
                                 color_block: 2 ** Math.max(0, Math.ceil(Math.log2(width * height / kColorTexels) / 2))});
  }

  allocate(width, height, full, colored) {
    const {gl} = this, color = this.color_format, across = Math.sqrt(kColorTexels * width / height);
    this.release_targets();
    this.targets = {
      full: {width: full.width, height: full.height}, width, height,
      hits: new Target(gl, width, height, colored ? kColoredHitFormats : kHitFormats),
      light: new Target(gl, width, height, kLightFormats),
      sky: new Target(gl, Math.ceil(width / 2), Math.ceil(height / 2), kSkyFormats),
      colors: [new Target(gl, width, height, [color]), new Target(gl, width, height, [color])],
      feedback: new Target(gl, Math.ceil(full.width / kFeedbackBlock), Math.ceil(full.height / kFeedbackBlock), kFeedbackFormats),
      // For any size, with the block of that.
      color_feedback: colored ? new Target(gl, Math.ceil(Math.min(width, across + 4)),
                                           Math.ceil(Math.min(height, kColorTexels / across + 4)), kFeedbackFormats) : null,
      feedback_block: kFeedbackBlock, color_block: 1, current: 0,
    };
  }

  get target_bytes() {
    return this.all_targets.reduce((sum, target) => sum + target.bytes, 0);
  }
  get all_targets() {
    if (!this.targets) return [];
    const {hits, light, sky, colors, feedback, color_feedback} = this.targets;
    return [hits, light, sky, ...colors, feedback, color_feedback].filter((target) => target !== null);
  }

  // One sample per pixel, accumulated as number `values.u_frame` (from 0 on). Yields between parts of at
  // most `part_pixels()` pixels. Returns the reading of the feedback; its `colors` is that of the colors, ready as
  // soon as the reading is, or null if none are shown.
  *draw(values, part_pixels) {
    const {targets, gl} = this, {width, height, hits, light, sky, colors, feedback, color_feedback, feedback_block, color_block} = targets;
    const share = this.floats ? 1 / (values.u_frame + 1) : 1;
    const [before, after] = [colors[targets.current], colors[1 - targets.current]];
    const all = {...values, u_size: [width, height], u_hits: hits.textures[0], u_light: light.textures[0], u_sky: sky.textures[0], u_normals: light.textures[1],
                 u_colors: hits.textures[1] || hits.textures[0], u_colored: hits.textures.length > 1,
                 u_shadow_missing: light.textures[2], u_before: before.textures[0], u_share: share,
                 u_range: this.color_range, ...blocks_of(feedback_block, values.u_seed)};
    const parts_of = (edge) => [Math.ceil(width / edge), Math.ceil(height / edge)];
    let left = part_pixels();
    const [sky_width, sky_height] = parts_of(2);
    for (const [program, target, columns, all_rows] of [[this.trace, hits, width, height], [this.light, light, width, height],
                                                        [this.occlusion, sky, sky_width, sky_height]])
      for (let row = 0, rows; row < all_rows; row += rows) {
        if (left < columns) {
          yield null;
          left = part_pixels();
        }
        rows = Math.min(all_rows - row, Math.max(1, Math.floor(left / columns)));
        program.draw(target, all, columns, all_rows, {row, rows});
        left -= rows * columns;
      }
    this.combine.draw(after, all, width, height);
    targets.current = 1 - targets.current;
    this.feedback.draw(feedback, all, ...parts_of(feedback_block));
    let of_colors = null;
    if (color_feedback && values.u_color_levels >= 0) {
      this.color_feedback.draw(color_feedback, {...all, ...blocks_of(color_block, values.u_seed)}, ...parts_of(color_block));
      of_colors = new AsyncReading(gl, color_feedback, ...parts_of(color_block));
    }
    return Object.assign(new AsyncReading(gl, feedback, ...parts_of(feedback_block)), {colors: of_colors});
  }

  // Draws the accumulated picture to the canvas.
  show(exposure, width, height) {
    const {targets} = this;
    this.present.draw(null, {u_color: targets.colors[targets.current].textures[0], u_extent: [width, height],
                             u_size: [targets.width, targets.height], u_exposure: exposure * this.color_range}, width, height);
  }

  // The hits of a picture of any size, as words of pack_hit(), rows from the bottom.
  capture(values, width, height) {
    const {gl} = this, target = new Target(gl, width, height, ["RGBA32UI"]);
    this.trace.draw(target, {...values, u_color_levels: -1}, width, height);
    const words = new Uint32Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    target.dispose();
    return words;
  }

  // The hit of one ray: 4 words of pack_hit(), low corner of the cell, slot of the tile it is in. Null if
  // the context is lost. The page does not wait for the GPU. After compile_later(): by then `values` may be out of date.
  async pick_one(values) {
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

  // {place: of the 48 of the sun, the one that lights nearest to `share` of what the last picture shows,
  //  wanted: leaf address -> 1, tiles that would make the choice better}. After compile_later().
  choose_sun(values, share) {
    const {gl, targets} = this, wanted = new Map();
    const target = new Target(gl, kSunPlaces, kSunRows, ["RGBA32UI"]), words = new Uint32Array(kSunPlaces * kSunRows * 4);
    this.sun.draw(target, {...values, u_size: [targets.width, targets.height], u_hits: targets.hits.textures[0],
                 u_normals: targets.light.textures[1]},
                 kSunPlaces, kSunRows);
    gl.readPixels(0, 0, kSunPlaces, kSunRows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    target.dispose();
    let best = 0, best_off = Infinity;
    for (let place = 0; place < kSunPlaces; ++place) {
      let seen = 0, lit = 0;
      for (let row = 0; row < kSunRows; ++row) {
        const at = 4 * (row * kSunPlaces + place), state = words[at];
        if (words[at + 1] !== 0) wanted.set(words[at + 1], 1);
        seen += state > 0;
        lit += state === 2;
      }
      const off = Math.abs(lit / Math.max(1, seen) - share);
      if (off < best_off) [best, best_off] = [place, off];
    }
    return {place: best, wanted};
  }

  dispose() {
    this.disposed = true;
    this.release_targets();
    for (const program of [this.trace, this.light, this.occlusion, this.combine, this.present, this.feedback, this.color_feedback,
                           this.pick, this.sun])
      program?.dispose();
    this.gl.deleteVertexArray(this.vertex_array);
  }

  release_targets() {
    for (const target of this.all_targets) target.dispose();
    this.targets = null;
  }
}
