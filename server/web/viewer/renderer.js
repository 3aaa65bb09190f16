// Draws a file of any size by casting rays through the tiles that are there, asks for those that are
// missing, and does so within a budget of GPU memory (docs/view.md).

import {create_context, WebGLUnavailable} from "./gl/gl_objects.js";
import {Colors, color_budget} from "./colors/colors.js";
import {Passes} from "./gl/passes.js";
import {read_feedback, read_hits} from "./gl/feedback.js";
import {jitter_of, picture_values} from "./gl/picture_values.js";
import {View} from "./gl/view.js";
import {Light} from "./light.js";
import {Pace} from "./pace.js";
import {kBlockBytes, statistics_of} from "./statistics.js";
import {FirstView} from "./tiles/first_view.js";
import {TileLoader} from "./tiles/tile_loader.js";
import {TilePool} from "./tiles/tile_pool.js";
import {TileStore} from "./tiles/tile_store.js";
import {add, scale} from "./vector.js";

export {WebGLUnavailable};

const kMebibyte = 1 << 20;
const kBudgetBytes = 256 * kMebibyte, kPhoneBudgetBytes = 64 * kMebibyte;
const kMaxPixels = 8e6, kPhoneMaxPixels = 2e6;  // of the canvas: its targets are not part of the budget
const kMovingMs = 180;          // after the last change of the view
const kSamples = 16;            // per pixel of a still picture
const kLitShare = 0.35;         // of what is seen within a scene
const kSunTrials = 8;           // in which no fewer tiles are wanted that would say more
const kFinePixels = 3;          // wide is a cell whose tile may arrive late
const kFirstWaitMs = 400;       // for the tiles of the first view
const kQuietRounds = 2;         // readings without a missing tile until a view is complete

export class Renderer {
  // `begun`: what early.js has begun for this canvas, or null.
  constructor(canvas, source, {budgetBytes, onChange, begun = null} = {}) {
    this.canvas = canvas;
    this.source = source;
    this.on_change = onChange || (() => {});
    const phone = matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
    this.budget_bytes = budgetBytes || (phone ? kPhoneBudgetBytes : kBudgetBytes);
    this.max_pixels = phone ? kPhoneMaxPixels : kMaxPixels;
    this.options = {minLevel: 0, maxLevel: null, clip: null, ambientOcclusion: true, sunShadows: true,
                    pixelTolerance: 1, wireLevel: null, color: true};
    this.view = null;
    this.first_picture_bytes = 0;
    this.sun_trials = 0;
    this.sun_wanted = Infinity;  // tiles, at the least so far
    this.has_drawn = false;      // since the context is there
    this.colors = null;          // of a file that has some
    this.sample = null;          // {parts, fence, part_ms, busy_ms, ...}: drawn in parts
    this.pace = new Pace();
    this.size = {width: canvas.width, height: canvas.height, css_width: canvas.width, css_height: canvas.height};
    this.times = {view_ms: -1e9, begin_ms: begun?.begin_ms ?? performance.now(), first_picture_ms: null, compile_ms: 0};
    this.seed = 0;
    this.samples = 0;
    this.quiet_rounds = 0;
    this.coarse_pixels = 0;
    this.full_drawn = false;     // the last frame that was read had all pixels
    this.stats = {steps_mean: 0, steps_99: 0, rays: 0};
    this.waiting = [];
    this.disposed = false;
    this.ready = false;          // programs, pool and root are there
    this.started = null;         // {resolve, reject} of start()
    this.gl = begun?.gl ?? create_context(canvas);
    if (!this.gl) throw new WebGLUnavailable("This browser or its graphics driver does not offer WebGL 2.");
    this.lost = this.gl.isContextLost();  // then on_restored() continues
    this.max_size = 4096;
    canvas.addEventListener("webglcontextlost", this.on_lost);
    canvas.addEventListener("webglcontextrestored", this.on_restored);
    if (!this.lost) this.create_programs(begun?.passes);
  }

  // Resolves when the first picture can be drawn, of a source whose manifest is there. With a view that was set before,
  // its tiles are fetched at once.
  async start() {
    this.info = this.source.info;
    this.light = new Light(this.info);
    if (this.view) this.light.place_sun(this.view.eye, this.view.forward);
    await new Promise((resolve, reject) => {
      this.started = {resolve, reject};
      if (this.disposed) resolve();
      else if (!this.lost) this.load();
    });
  }

  // Another root of the same DAG, which has grown: the tiles that are there stay. Resolves to whether it is shown.
  async show_root(info) {
    const {loader, store} = this;
    if (!this.ready || !this.info.root || info.levels <= 2) return false;
    await loader.load_root(info.root.level, info.root.offset);
    if (store !== this.store || !this.ready) return false;
    this.info = info;
    this.root_pointer = store.root.pointer;
    this.begin_epoch();
    return true;
  }

  setView(placement) {
    const view = new View(placement);
    if (view.equals(this.view)) return;
    this.view = view;
    if (this.light?.turn === null) this.light.place_sun(view.eye, view.forward);
    this.end_first_view();
    this.times.view_ms = performance.now();
    this.begin_epoch();
  }

  setOptions(options) {
    Object.assign(this.options, options);
    if (this.light) this.light.readings = 0;  // how bright it is may change at once
    this.end_first_view();
    this.begin_epoch();
  }

  resize(css_width, css_height, device_ratio) {
    const pixel_ratio = Math.min(device_ratio, Math.sqrt(this.max_pixels / Math.max(1, css_width * css_height)));
    const limit = this.max_size, width = Math.min(limit, Math.max(1, Math.round(css_width * pixel_ratio)));
    const height = Math.min(limit, Math.max(1, Math.round(css_height * pixel_ratio)));
    const same = width === this.canvas.width && height === this.canvas.height && width === this.size.width;
    this.size = {width, height, css_width, css_height};
    if (same) return;
    this.canvas.width = width;
    this.canvas.height = height;
    if (this.ready && this.passes.targets) this.show();  // the old picture, until there is a new one
    this.begin_epoch();
  }

  // Draws a frame if there is something new to draw and the GPU is done with the last one.
  frame(now_ms) {
    const now = performance.now(), moving = now - this.times.view_ms < kMovingMs;
    if (!this.ready || !this.view) return {moving, complete: true};  // on_change() says when there is more
    this.pace.tick(now);
    if (this.empty) {
      this.draw_empty();
      return {moving: false, complete: true};
    }
    if (!this.has_drawn && this.waits_for_tiles) return {moving, complete: false};
    if (this.sample && !this.continue_sample(now)) return {moving, complete: false};
    if (this.reading) {
      if (!this.reading.pass.ready) return {moving, complete: false};
      this.take_reading(now);
    }
    if (!moving && this.samples >= kSamples && ((this.is_complete && this.is_done) || this.rests(now))) return {moving, complete: true};
    this.draw(now, moving);
    return {moving, complete: false};
  }

  // Resolves when all tiles that the pixels of the canvas need have arrived, and the sun has its place: within a scene
  // not while the service is away, if that lacks tiles.
  complete() {
    if (this.ready && this.is_complete && this.full_drawn && this.sun_is_placed && !this.reading) return Promise.resolve();
    return new Promise((resolve) => {
      this.waiting.push(resolve);
      this.on_change();
    });
  }

  // What is seen at a point of the canvas, null for the sky.
  async pick(css_x, css_y) {
    const {passes} = this;
    if (!this.ready || this.empty || !await passes.compile_later()) return null;
    if (!this.ready || passes !== this.passes) return null;
    const {view, store} = this, {width, height} = this.size, {evicted} = store;
    const x = css_x / this.size.css_width * width, y = css_y / this.size.css_height * height;
    const values = this.uniforms(width, height);
    values.u_center = [width / 2 - x + 0.5, y - height / 2 + 0.5];
    const words = await passes.pick_one(values);
    if (!words || !this.ready || (words[1] >>> 23 & 1) === 0) return null;
    if (store.evicted !== evicted) return this.pick(css_x, css_y);  // what it refers to may have left
    const distance = new Float32Array(words.buffer, 0, 1)[0], log2_edge = words[1] >>> 16 & 31, axis = words[1] >>> 21 & 3;
    const direction = view.direction(x, y, width, height);
    const normal = axis === 3 ? direction.map((d) => -d) : [0, 0, 0];
    if (axis < 3) normal[axis] = direction[axis] > 0 ? -1 : 1;
    const node = words[2] !== 0 ? store.cut_off_node(words[2]) : store.by_slot[words[7]]?.tile || this.info.root;
    return {voxel: [...words.slice(4, 7)], level: this.info.levels - log2_edge, position: add(view.eye, scale(direction, distance)),
            distance, normal, nodeLevel: node.level, nodeOffset: String(node.offset)};
  }

  // Hits of a picture of any size with the tiles that are there, rows from the top.
  async capture({width, height}) {
    const is_drawn = this.ready && !this.empty, words = is_drawn
      ? this.passes.capture(this.uniforms(width, height), width, height) : new Uint32Array(4 * width * height);
    return read_hits(words, width, height, this.info?.levels);
  }

  statistics() {
    return statistics_of(this);
  }

  // null, or {code, message} of what does not arrive, and why.
  get problem() {
    return this.loader?.problem || (this.options.color && this.colors?.loader.problem) || null;
  }

  dispose() {
    this.disposed = true;
    this.canvas.removeEventListener("webglcontextlost", this.on_lost);
    this.canvas.removeEventListener("webglcontextrestored", this.on_restored);
    this.ready = false;
    this.loader?.dispose();
    this.passes?.dispose();
    this.store?.pool.dispose();
    this.colors?.dispose();
    this.started?.resolve();
  }

  create_programs(begun) {
    this.max_size = this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE) || 4096;
    const begin = begun ? this.times.begin_ms : performance.now();
    if (this.passes) this.passes.disposed = true;  // with its context
    this.passes = begun ?? new Passes(this.gl);
    this.times.compile_begin_ms = begin;
    this.can_choose_sun = false;
    this.reading = null;
  }

  // Makes the renderer ready, from the beginning if the context was lost in between.
  async load() {
    const {passes} = this, is_over = () => this.disposed || this.lost || passes !== this.passes || this.gl.isContextLost();
    try {
      const root = this.load_root();
      root.catch(() => {});  // reported below, unless the programs fail
      this.wait_until_ms = performance.now() + kFirstWaitMs;
      await passes.compile(Boolean(this.info.colors));
      if (is_over()) return;
      this.times.compile_ms = performance.now() - this.times.compile_begin_ms;
      mark("compiled");
      await root;
      if (is_over()) return;
      this.ready = true;
      this.begin_epoch();
      this.started.done = true;
      this.started.resolve();
    } catch (error) {
      if (is_over()) return;
      if (!this.started.done) return this.started.reject(error);
      console.error(error);
      this.loader?.fail(error);
      this.on_change();
    }
  }

  async load_root() {
    const {root, levels} = this.info;
    this.root_pointer = undefined;
    this.empty = !root && !this.info.root_brick;
    const for_colors = color_budget(this.info, this.budget_bytes);
    this.store = new TileStore(new TilePool(this.gl, this.pool_bytes(this.budget_bytes - for_colors)), this.info);
    this.colors = for_colors > 0 ? new Colors(this.gl, this.source, for_colors, (failed) => this.on_arrival(failed)) : null;
    this.loader = new TileLoader(this.source, this.store, (failed) => this.on_arrival(failed));
    if (root && levels > 2) {
      const words = await this.loader.load_root(root.level, root.offset);
      this.root_pointer = this.store.root?.pointer;  // none if the loader was disposed
      mark("root");
      if (words) this.seek_first_view(words);
    } else if (!this.empty) {
      this.root_pointer = this.store.add_brick(this.info.root_brick);
    }
  }

  // A small file needs less than the budget: at worst each voxel has a path of tiles. A growing DAG has no number yet.
  pool_bytes(budget_bytes) {
    const {voxels, levels, tile_levels} = this.info;
    return Math.min(budget_bytes, 4 * kMebibyte + Number(voxels ?? Infinity) * kBlockBytes * Math.ceil(levels / tile_levels));
  }

  // Begins the picture again. What is missing is found sooner by a small picture than by the rest of a large one.
  restart() {
    this.samples = 0;
    this.quiet_rounds = 0;
    if (this.reading) this.reading.outdated = true;
    if (!this.sample) return;
    this.sample.outdated = true;
    if (!this.sample.full || this.sample.moving) return;
    this.gl.deleteSync(this.sample.fence);
    this.sample = null;
  }

  begin_epoch() {
    this.restart();
    this.pace.begin_view();
    this.store?.begin_epoch();
    this.loader?.begin_epoch();
    this.colors?.begin_epoch();
    this.on_change();
  }

  // Before anything is drawn the tiles of a view are found without a reading of the feedback.
  seek_first_view(root_words) {
    if (!this.view || this.options.clip || this.times.first_picture_ms !== null) return;
    const {loader, store, info} = this, finest = 2 ** (info.levels - Math.min(info.levels, this.options.maxLevel ?? info.levels));
    loader.first_view = new FirstView(info, this.view, this.size, finest);
    loader.first_view.begin(store, store.root, root_words);
    this.follow_first_view();
  }

  follow_first_view() {
    const {loader} = this, now = performance.now();
    if (loader.first_view.is_over) return this.end_first_view();  // the next reading replaces the queue
    loader.demand(loader.first_view.wanted, now);
    if (loader.is_idle || loader.awaits_retry) this.end_first_view();
  }

  // A first picture that has its tiles is soon there; one without them only takes its time.
  get waits_for_tiles() {
    return performance.now() < this.wait_until_ms && (this.loader.first_view !== null || this.root_pointer === undefined);
  }

  end_first_view() {
    if (this.loader?.first_view) mark("tiles of the first view");
    if (this.loader) this.loader.first_view = null;
  }

  // A few fine tiles that arrive late do not begin the picture again: its other samples will have them.
  on_arrival(failed = false) {
    if (this.loader?.first_view) this.follow_first_view();
    if (!failed && (!this.is_complete || this.coarse_pixels > kFinePixels)) this.restart();
    this.on_change();
  }

  on_lost = (event) => {
    event.preventDefault();
    this.lost = true;
    this.ready = this.has_drawn = false;
    this.loader?.dispose();
    this.colors?.loader.dispose();
    this.reading = null;
    this.sample = null;
  };

  on_restored = () => {
    this.lost = false;
    this.create_programs();
    if (this.started) this.load();
  };

  // Within a scene the sun takes a better place as soon as the first view is complete. Returns whether the picture
  // is final as far as the sun is concerned.
  improve_sun(now_ms) {
    if (this.sun_is_placed) return true;
    const {passes} = this, {width, height} = passes.targets;
    if (!this.can_choose_sun) {
      passes.compile_later().then((usable) => this.can_choose_sun = usable && passes === this.passes,
                                  () => this.sun_trials = kSunTrials);
      return false;
    }
    const values = {...this.uniforms(width, height), u_turn: this.light.turn};
    const {place, wanted} = this.passes.choose_sun(values, kLitShare);
    this.sun_trials = wanted.size < this.sun_wanted ? 0 : this.sun_trials + 1;
    this.sun_wanted = Math.min(this.sun_wanted, wanted.size);
    if (wanted.size > 0 && this.sun_trials < kSunTrials && !this.loader.is_full) {
      this.loader.demand(wanted, now_ms);
      return false;
    }
    this.sun_trials = kSunTrials;
    this.light.set_sun(place);
    this.restart();
    this.light.readings = 0;
    return false;
  }

  get is_complete() {
    return this.quiet_rounds >= kQuietRounds;
  }

  get sun_is_placed() {
    return this.light.outside || this.sun_trials >= kSunTrials || !this.options.sunShadows;
  }

  // Whether nobody waits for a complete view, and the sun has its place.
  get is_done() {
    return this.waiting.length === 0 && this.sun_is_placed;
  }

  // Whether all that can be drawn is drawn until the service is asked again.
  rests(now) {
    return this.full_drawn && this.loaders.some((each) => each.pauses(now)) &&
           this.loaders.every((each) => each.pauses(now) || each.is_idle);
  }
  get loaders() {
    return [this.loader, ...(this.colors && this.options.color ? [this.colors.loader] : [])];
  }

  // The internal resolution: lower while the camera moves and while tiles arrive, if frames take long.
  internal_size(moving) {
    const {width, height} = this.size;
    const arrives = this.quiet_rounds === 0 || (!this.is_complete && this.loaders.some((each) => each.requests > 0));
    const coarse = moving || (arrives && this.loaders.every((each) => each.outage.count === 0));
    const scale = moving ? this.pace.scale : coarse ? this.pace.seeking_scale : 1;
    return {width: Math.max(1, Math.round(width * scale)), height: Math.max(1, Math.round(height * scale)), full: scale === 1};
  }

  draw(now, moving) {
    const {width, height, full} = this.internal_size(moving);
    const before = this.passes.targets;
    if (before?.width !== width || before.height !== height || before.full.width !== this.size.width || before.full.height !== this.size.height)
      this.samples = 0;
    this.passes.resize(width, height, this.size, this.colors !== null);
    // Cells are as fine as the still picture needs, unless the camera moves.
    const lod_height = moving ? height : this.size.height;
    const values = this.uniforms(width, height, lod_height);
    const frame = this.samples;
    this.seed++;
    Object.assign(values, {u_frame: frame, u_seed: this.seed, u_jitter: jitter_of(full ? frame : this.seed)});
    this.sample = {parts: this.passes.draw(values, () => this.pace.part_pixels), fence: null, part_ms: now, busy_ms: 0,
                   epoch: this.store.epoch, moving, full, width, height, outdated: false, pools: this.pools};
    this.draw_part(now);
  }

  // Gives the GPU as much of the sample as it can draw soon. More would stop the whole system, and some
  // end a context that keeps them busy for seconds.
  draw_part(now) {
    const {sample, gl} = this, {value: pass, done} = sample.parts.next();
    sample.part_ms = now;
    if (!done) {
      sample.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.flush();
      return false;
    }
    this.show();
    if (!this.has_drawn) mark("first frame");
    this.has_drawn = true;
    this.samples = sample.outdated ? 0 : this.samples + 1;
    this.stats.rays = sample.width * sample.height;
    this.reading = {...sample, pass};
    this.sample = null;
    return true;
  }

  get pools() {
    return [this.store.pool.texels, this.colors?.store.pool.texels];
  }

  show() {
    this.passes.show(this.light.exposure, this.canvas.width, this.canvas.height);
  }

  // Whether the sample is drawn.
  continue_sample(now) {
    const {sample, gl} = this;
    if (gl.getSyncParameter(sample.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(sample.fence);
    if (sample.pools.some((texels, i) => texels !== this.pools[i])) {  // one has grown: the rest would see its old texture
      this.sample = null;
      return true;
    }
    sample.busy_ms += this.pace.part_done(now - sample.part_ms);
    return this.draw_part(now);
  }

  uniforms(width, height, lod_height = height) {
    return picture_values(this, width, height, lod_height);
  }

  take_reading(now) {
    const {pass, part_ms, busy_ms, epoch, moving, full, width, height, outdated} = this.reading;
    this.reading = null;
    const read = read_feedback(pass.take());
    read.coarse_pixels *= this.size.height / height;  // pixels of the canvas
    this.stats.steps_mean = read.steps_mean;
    this.stats.steps_99 = read.steps_99;
    this.pace.frame_done(now - part_ms, busy_ms, width * height, moving || !full);
    for (const slot of read.slots) this.store.mark(slot, epoch, now);
    // Not while samples of a still picture are added up.
    if (read.exposure !== null && this.samples <= kSamples / 4) this.light.adjust(read, this.view.eye, moving);
    this.coarse_pixels = read.coarse_pixels;
    if (epoch === this.store.epoch) this.store.rounds++;
    if (this.loader.first_view?.stalls(now)) this.end_first_view();
    if (!this.loader.first_view && this.loader.demand(read.wanted, now) > 0) this.on_arrival();
    if (pass.colors) this.colors.take_reading(pass.colors.take(), epoch, now);
    else this.colors?.loader.replace_queue([], 0, now);
    if (epoch !== this.store.epoch) return;
    const lacking = this.loaders.reduce((sum, each) => sum + each.unmet, 0);
    if (!moving && !this.loader.first_view) this.pace.note_lacking(lacking, read.coarse_pixels);
    const nothing_comes = this.loaders.every((each) => each.is_idle && !each.awaits_retry);
    if (this.times.first_picture_ms === null && read.coarse_pixels < 16) {
      this.times.first_picture_ms = now - this.times.begin_ms;
      this.first_picture_bytes = this.source.fetched_bytes;
      mark("first picture");
    }
    // What arrived since the sample began may refer to more that is missing.
    if (!moving && nothing_comes && !outdated) this.quiet_rounds++;
    else if (!this.is_complete || read.coarse_pixels > kFinePixels) this.quiet_rounds = 0;
    this.full_drawn = full;
    if (this.is_complete && full && nothing_comes && this.improve_sun(now)) for (const resolve of this.waiting.splice(0)) resolve();
  }

  draw_empty() {
    const {passes, canvas} = this;
    passes.resize(canvas.width, canvas.height, canvas, false);
    passes.show(1, canvas.width, canvas.height);
    this.has_drawn = true;
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}

// A named time, for the tools of the browser.
function mark(name) {
  performance.mark(`voxdag: ${name}`);
}
