// Draws a file of any size by casting rays through the tiles that are there, asks for those that
// are missing, and does so within a budget of GPU memory (docs/view.md).

import {colorBudget, Colors} from "./colors/colors.js";
import {readFeedback, readHits} from "./gl/feedback.js";
import {createContext, WebGLUnavailable} from "./gl/gl_objects.js";
import {Passes} from "./gl/passes.js";
import {jitterOf, pictureValues} from "./gl/picture_values.js";
import {View} from "./gl/view.js";
import {Light} from "./light.js";
import {Pace} from "./pace.js";
import {kBlockBytes, statisticsOf} from "./statistics.js";
import {FirstView} from "./tiles/first_view.js";
import {TileLoader} from "./tiles/tile_loader.js";
import {TilePool} from "./tiles/tile_pool.js";
import {TileStore} from "./tiles/tile_store.js";
import {add, scale} from "./vector.js";

export {WebGLUnavailable};

const kMebibyte = 1 << 20;
const kBudgetBytes = 256 * kMebibyte, kPhoneBudgetBytes = 64 * kMebibyte;
const kMaxPixels = 8e6,
      kPhoneMaxPixels = 2e6;  // of the canvas: its targets are not part of the budget
const kMovingMs = 180;        // after the last change of the view
const kSamples = 16;          // per pixel of a still picture
const kLitShare = 0.35;       // of what is seen within a scene
const kSunTrials = 8;         // in which no fewer tiles are wanted that would say more
const kFinePixels = 3;        // wide is a cell whose tile may arrive late
const kFirstWaitMs = 400;     // for the tiles of the first view
const kQuietRounds = 2;       // readings without a missing tile until a view is complete

export class Renderer {
  // `begun`: what early.js has begun for this canvas, or null.
  constructor(canvas, source, {budgetBytes, onChange, begun = null} = {}) {
    this.canvas = canvas;
    this.source = source;
    this.onChange = onChange || (() => {});
    const phone =
        matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
    this.budgetBytes = budgetBytes || (phone ? kPhoneBudgetBytes : kBudgetBytes);
    this.maxPixels = phone ? kPhoneMaxPixels : kMaxPixels;
    this.options = {
      minLevel: 0,
      maxLevel: null,
      clip: null,
      ambientOcclusion: true,
      sunShadows: true,
      pixelTolerance: 1,
      wireLevel: null,
      color: true
    };
    this.view = null;
    this.firstPictureBytes = 0;
    this.sunTrials = 0;
    this.sunWanted = Infinity;  // tiles, at the least so far
    this.hasDrawn = false;      // since the context is there
    this.colors = null;         // of a file that has some
    this.sample = null;         // {parts, fence, partMs, busyMs, ...}: drawn in parts
    this.pace = new Pace();
    this.size = {
      width: canvas.width,
      height: canvas.height,
      cssWidth: canvas.width,
      cssHeight: canvas.height
    };
    this.times = {
      viewMs: -1e9,
      beginMs: begun?.beginMs ?? performance.now(),
      firstPictureMs: null,
      compileMs: 0
    };
    this.seed = 0;
    this.samples = 0;
    this.quietRounds = 0;
    this.coarsePixels = 0;
    this.fullDrawn = false;  // the last frame that was read had all pixels
    this.stats = {stepsMean: 0, steps99: 0, rays: 0};
    this.waiting = [];
    this.disposed = false;
    this.ready = false;   // programs, pool and root are there
    this.started = null;  // {resolve, reject} of start()
    this.gl = begun?.gl ?? createContext(canvas);
    if (!this.gl)
      throw new WebGLUnavailable("This browser or its graphics driver does not offer WebGL 2.");
    this.lost = this.gl.isContextLost();  // then onRestored() continues
    this.maxSize = 4096;
    canvas.addEventListener("webglcontextlost", this.onLost);
    canvas.addEventListener("webglcontextrestored", this.onRestored);
    if (!this.lost) this.createPrograms(begun?.passes);
  }

  // Resolves when the first picture can be drawn, of a source whose manifest is there. With a view
  // that was set before, its tiles are fetched at once.
  async start() {
    this.info = this.source.info;
    this.light = new Light(this.info);
    if (this.view) this.light.placeSun(this.view.eye, this.view.forward);
    await new Promise((resolve, reject) => {
      this.started = {resolve, reject};
      if (this.disposed) resolve();
      else if (!this.lost) this.load();
    });
  }

  // Another root of the same DAG, which has grown: the tiles that are there stay. Resolves to
  // whether it is shown.
  async showRoot(info) {
    const {loader, store} = this;
    if (!this.ready || !this.info.root || info.levels <= 2) return false;
    await loader.loadRoot(info.root.level, info.root.offset);
    if (store !== this.store || !this.ready) return false;
    this.info = info;
    this.rootPointer = store.root.pointer;
    this.beginEpoch();
    return true;
  }

  setView(placement) {
    const view = new View(placement);
    if (view.equals(this.view)) return;
    this.view = view;
    if (this.light?.turn === null) this.light.placeSun(view.eye, view.forward);
    this.endFirstView();
    this.times.viewMs = performance.now();
    this.beginEpoch();
  }

  setOptions(options) {
    Object.assign(this.options, options);
    if (this.light) this.light.readings = 0;  // how bright it is may change at once
    this.endFirstView();
    this.beginEpoch();
  }

  resize(cssWidth, cssHeight, deviceRatio) {
    const pixelRatio =
        Math.min(deviceRatio, Math.sqrt(this.maxPixels / Math.max(1, cssWidth * cssHeight)));
    const limit = this.maxSize,
          width = Math.min(limit, Math.max(1, Math.round(cssWidth * pixelRatio)));
    const height = Math.min(limit, Math.max(1, Math.round(cssHeight * pixelRatio)));
    const same =
        width === this.canvas.width && height === this.canvas.height && width === this.size.width;
    this.size = {width, height, cssWidth, cssHeight};
    if (same) return;
    this.canvas.width = width;
    this.canvas.height = height;
    if (this.ready && this.passes.targets)
      this.show();  // the old picture, until there is a new one
    this.beginEpoch();
  }

  // Draws a frame if there is something new to draw and the GPU is done with the last one.
  frame(nowMs) {
    const now = performance.now(), moving = now - this.times.viewMs < kMovingMs;
    if (!this.ready || !this.view)
      return {moving, complete: true};  // onChange() says when there is more
    this.pace.tick(now);
    if (this.empty) {
      this.drawEmpty();
      return {moving: false, complete: true};
    }
    if (!this.hasDrawn && this.waitsForTiles) return {moving, complete: false};
    if (this.sample && !this.continueSample(now)) return {moving, complete: false};
    if (this.reading) {
      if (!this.reading.pass.ready) return {moving, complete: false};
      this.takeReading(now);
    }
    if (!moving && this.samples >= kSamples &&
        ((this.isComplete && this.isDone) || this.rests(now)))
      return {moving, complete: true};
    this.draw(now, moving);
    return {moving, complete: false};
  }

  // Resolves when all tiles that the pixels of the canvas need have arrived, and the sun has its
  // place: within a scene not while the service is away, if that lacks tiles.
  complete() {
    if (this.ready && this.isComplete && this.fullDrawn && this.sunIsPlaced && !this.reading)
      return Promise.resolve();
    return new Promise((resolve) => {
      this.waiting.push(resolve);
      this.onChange();
    });
  }

  // What is seen at a point of the canvas, null for the sky.
  async pick(cssX, cssY) {
    const {passes} = this;
    if (!this.ready || this.empty || !await passes.compileLater()) return null;
    if (!this.ready || passes !== this.passes) return null;
    const {view, store} = this, {width, height} = this.size, {evicted} = store;
    const x = cssX / this.size.cssWidth * width, y = cssY / this.size.cssHeight * height;
    const values = this.uniforms(width, height);
    values.u_center = [width / 2 - x + 0.5, y - height / 2 + 0.5];
    const words = await passes.pickOne(values);
    if (!words || !this.ready || (words[1] >>> 23 & 1) === 0) return null;
    if (store.evicted !== evicted) return this.pick(cssX, cssY);  // what it refers to may have left
    const distance = new Float32Array(words.buffer, 0, 1)[0], log2Edge = words[1] >>> 16 & 31,
          axis = words[1] >>> 21 & 3;
    const direction = view.direction(x, y, width, height);
    const normal = axis === 3 ? direction.map((d) => -d) : [0, 0, 0];
    if (axis < 3) normal[axis] = direction[axis] > 0 ? -1 : 1;
    const node = words[2] !== 0 ? store.cutOffNode(words[2]) :
                                  store.bySlot[words[7]]?.tile || this.info.root;
    return {
      voxel: [...words.slice(4, 7)],
      level: this.info.levels - log2Edge,
      position: add(view.eye, scale(direction, distance)),
      distance,
      normal,
      nodeLevel: node.level,
      nodeOffset: String(node.offset)
    };
  }

  // Hits of a picture of any size with the tiles that are there, rows from the top.
  async capture({width, height}) {
    const isDrawn = this.ready && !this.empty,
          words = isDrawn ? this.passes.capture(this.uniforms(width, height), width, height) :
                            new Uint32Array(4 * width * height);
    return readHits(words, width, height, this.info?.levels);
  }

  statistics() {
    return statisticsOf(this);
  }

  // null, or {code, message} of what does not arrive, and why.
  get problem() {
    return this.loader?.problem || (this.options.color && this.colors?.loader.problem) || null;
  }

  dispose() {
    this.disposed = true;
    this.canvas.removeEventListener("webglcontextlost", this.onLost);
    this.canvas.removeEventListener("webglcontextrestored", this.onRestored);
    this.ready = false;
    this.loader?.dispose();
    this.passes?.dispose();
    this.store?.pool.dispose();
    this.colors?.dispose();
    this.started?.resolve();
  }

  createPrograms(begun) {
    this.maxSize = this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE) || 4096;
    const begin = begun ? this.times.beginMs : performance.now();
    if (this.passes) this.passes.disposed = true;  // with its context
    this.passes = begun ?? new Passes(this.gl);
    this.times.compileBeginMs = begin;
    this.canChooseSun = false;
    this.reading = null;
  }

  // Makes the renderer ready, from the beginning if the context was lost in between.
  async load() {
    const {passes} = this,
          isOver = () =>
              this.disposed || this.lost || passes !== this.passes || this.gl.isContextLost();
    try {
      const root = this.loadRoot();
      root.catch(() => {});  // reported below, unless the programs fail
      this.waitUntilMs = performance.now() + kFirstWaitMs;
      await passes.compile(Boolean(this.info.colors));
      if (isOver()) return;
      this.times.compileMs = performance.now() - this.times.compileBeginMs;
      mark("compiled");
      await root;
      if (isOver()) return;
      this.ready = true;
      this.beginEpoch();
      this.started.done = true;
      this.started.resolve();
    } catch (error) {
      if (isOver()) return;
      if (!this.started.done) return this.started.reject(error);
      console.error(error);
      this.loader?.fail(error);
      this.onChange();
    }
  }

  async loadRoot() {
    const {root, levels} = this.info;
    this.rootPointer = undefined;
    this.empty = !root && !this.info.root_brick;
    const forColors = colorBudget(this.info, this.budgetBytes);
    this.store = new TileStore(
        new TilePool(this.gl, this.poolBytes(this.budgetBytes - forColors)), this.info);
    this.colors = forColors > 0 ?
        new Colors(this.gl, this.source, forColors, (failed) => this.onArrival(failed)) :
        null;
    this.loader = new TileLoader(this.source, this.store, (failed) => this.onArrival(failed));
    if (root && levels > 2) {
      const words = await this.loader.loadRoot(root.level, root.offset);
      this.rootPointer = this.store.root?.pointer;  // none if the loader was disposed
      mark("root");
      if (words) this.seekFirstView(words);
    } else if (!this.empty) {
      this.rootPointer = this.store.addBrick(this.info.root_brick);
    }
  }

  // A small file needs less than the budget: at worst each voxel has a path of tiles. A growing DAG
  // has no number yet.
  poolBytes(budgetBytes) {
    const {voxels, levels, tile_levels} = this.info;
    return Math.min(
        budgetBytes,
        4 * kMebibyte + Number(voxels ?? Infinity) * kBlockBytes * Math.ceil(levels / tile_levels));
  }

  // Begins the picture again. What is missing is found sooner by a small picture than by the rest
  // of a large one.
  restart() {
    this.samples = 0;
    this.quietRounds = 0;
    if (this.reading) this.reading.outdated = true;
    if (!this.sample) return;
    this.sample.outdated = true;
    if (!this.sample.full || this.sample.moving) return;
    this.gl.deleteSync(this.sample.fence);
    this.sample = null;
  }

  beginEpoch() {
    this.restart();
    this.pace.beginView();
    this.store?.beginEpoch();
    this.loader?.beginEpoch();
    this.colors?.beginEpoch();
    this.onChange();
  }

  // Before anything is drawn the tiles of a view are found without a reading of the feedback.
  seekFirstView(rootWords) {
    if (!this.view || this.options.clip || this.times.firstPictureMs !== null) return;
    const {loader, store, info} = this,
                          finest = 2 **
        (info.levels - Math.min(info.levels, this.options.maxLevel ?? info.levels));
    loader.firstView = new FirstView(info, this.view, this.size, finest);
    loader.firstView.begin(store, store.root, rootWords);
    this.followFirstView();
  }

  followFirstView() {
    const {loader} = this, now = performance.now();
    if (loader.firstView.isOver) return this.endFirstView();  // the next reading replaces the queue
    loader.demand(loader.firstView.wanted, now);
    if (loader.isIdle || loader.awaitsRetry) this.endFirstView();
  }

  // A first picture that has its tiles is soon there; one without them only takes its time.
  get waitsForTiles() {
    return performance.now() < this.waitUntilMs &&
        (this.loader.firstView !== null || this.rootPointer === undefined);
  }

  endFirstView() {
    if (this.loader?.firstView) mark("tiles of the first view");
    if (this.loader) this.loader.firstView = null;
  }

  // A few fine tiles that arrive late do not begin the picture again: its other samples will have
  // them.
  onArrival(failed = false) {
    if (this.loader?.firstView) this.followFirstView();
    if (!failed && (!this.isComplete || this.coarsePixels > kFinePixels)) this.restart();
    this.onChange();
  }

  onLost = (event) => {
    event.preventDefault();
    this.lost = true;
    this.ready = this.hasDrawn = false;
    this.loader?.dispose();
    this.colors?.loader.dispose();
    this.reading = null;
    this.sample = null;
  };

  onRestored = () => {
    this.lost = false;
    this.createPrograms();
    if (this.started) this.load();
  };

  // Within a scene the sun takes a better place as soon as the first view is complete. Returns
  // whether the picture is final as far as the sun is concerned.
  improveSun(nowMs) {
    if (this.sunIsPlaced) return true;
    const {passes} = this, {width, height} = passes.targets;
    if (!this.canChooseSun) {
      passes.compileLater().then(
          (usable) => this.canChooseSun = usable && passes === this.passes,
          () => this.sunTrials = kSunTrials);
      return false;
    }
    const values = {...this.uniforms(width, height), u_turn: this.light.turn};
    const {place, wanted} = this.passes.chooseSun(values, kLitShare);
    this.sunTrials = wanted.size < this.sunWanted ? 0 : this.sunTrials + 1;
    this.sunWanted = Math.min(this.sunWanted, wanted.size);
    if (wanted.size > 0 && this.sunTrials < kSunTrials && !this.loader.isFull) {
      this.loader.demand(wanted, nowMs);
      return false;
    }
    this.sunTrials = kSunTrials;
    this.light.setSun(place);
    this.restart();
    this.light.readings = 0;
    return false;
  }

  get isComplete() {
    return this.quietRounds >= kQuietRounds;
  }

  get sunIsPlaced() {
    return this.light.outside || this.sunTrials >= kSunTrials || !this.options.sunShadows;
  }

  // Whether nobody waits for a complete view, and the sun has its place.
  get isDone() {
    return this.waiting.length === 0 && this.sunIsPlaced;
  }

  // Whether all that can be drawn is drawn until the service is asked again.
  rests(now) {
    return this.fullDrawn && this.loaders.some((each) => each.pauses(now)) &&
        this.loaders.every((each) => each.pauses(now) || each.isIdle);
  }
  get loaders() {
    return [this.loader, ...(this.colors && this.options.color ? [this.colors.loader] : [])];
  }

  // The internal resolution: lower while the camera moves and while tiles arrive, if frames take
  // long.
  internalSize(moving) {
    const {width, height} = this.size;
    const arrives = this.quietRounds === 0 ||
        (!this.isComplete && this.loaders.some((each) => each.requests > 0));
    const coarse = moving || (arrives && this.loaders.every((each) => each.outage.count === 0));
    const scale = moving ? this.pace.scale : coarse ? this.pace.seekingScale : 1;
    return {
      width: Math.max(1, Math.round(width * scale)),
      height: Math.max(1, Math.round(height * scale)),
      full: scale === 1
    };
  }

  draw(now, moving) {
    const {width, height, full} = this.internalSize(moving);
    const before = this.passes.targets;
    if (before?.width !== width || before.height !== height ||
        before.full.width !== this.size.width || before.full.height !== this.size.height)
      this.samples = 0;
    this.passes.resize(width, height, this.size, this.colors !== null);
    // Cells are as fine as the still picture needs, unless the camera moves.
    const lodHeight = moving ? height : this.size.height;
    const values = this.uniforms(width, height, lodHeight);
    const frame = this.samples;
    this.seed++;
    Object.assign(
        values, {u_frame: frame, u_seed: this.seed, u_jitter: jitterOf(full ? frame : this.seed)});
    this.sample = {
      parts: this.passes.draw(values, () => this.pace.partPixels),
      fence: null,
      partMs: now,
      busyMs: 0,
      epoch: this.store.epoch,
      moving,
      full,
      width,
      height,
      outdated: false,
      pools: this.pools
    };
    this.drawPart(now);
  }

  // Gives the GPU as much of the sample as it can draw soon. More would stop the whole system, and
  // some end a context that keeps them busy for seconds.
  drawPart(now) {
    const {sample, gl} = this, {value: pass, done} = sample.parts.next();
    sample.partMs = now;
    if (!done) {
      sample.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.flush();
      return false;
    }
    this.show();
    if (!this.hasDrawn) mark("first frame");
    this.hasDrawn = true;
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
  continueSample(now) {
    const {sample, gl} = this;
    if (gl.getSyncParameter(sample.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(sample.fence);
    if (sample.pools.some(
            (texels, i) =>
                texels !== this.pools[i])) {  // one has grown: the rest would see its old texture
      this.sample = null;
      return true;
    }
    sample.busyMs += this.pace.partDone(now - sample.partMs);
    return this.drawPart(now);
  }

  uniforms(width, height, lodHeight = height) {
    return pictureValues(this, width, height, lodHeight);
  }

  takeReading(now) {
    const {pass, partMs, busyMs, epoch, moving, full, width, height, outdated} = this.reading;
    this.reading = null;
    const read = readFeedback(pass.take());
    read.coarsePixels *= this.size.height / height;  // pixels of the canvas
    this.stats.stepsMean = read.stepsMean;
    this.stats.steps99 = read.steps99;
    this.pace.frameDone(now - partMs, busyMs, width * height, moving || !full);
    for (const slot of read.slots) this.store.mark(slot, epoch, now);
    // Not while samples of a still picture are added up.
    if (read.exposure !== null && this.samples <= kSamples / 4)
      this.light.adjust(read, this.view.eye, moving);
    this.coarsePixels = read.coarsePixels;
    if (epoch === this.store.epoch) this.store.rounds++;
    if (this.loader.firstView?.stalls(now)) this.endFirstView();
    if (!this.loader.firstView && this.loader.demand(read.wanted, now) > 0) this.onArrival();
    if (pass.colors) this.colors.takeReading(pass.colors.take(), epoch, now);
    else this.colors?.loader.replaceQueue([], 0, now);
    if (epoch !== this.store.epoch) return;
    const lacking = this.loaders.reduce((sum, each) => sum + each.unmet, 0);
    if (!moving && !this.loader.firstView) this.pace.noteLacking(lacking, read.coarsePixels);
    const nothingComes = this.loaders.every((each) => each.isIdle && !each.awaitsRetry);
    if (this.times.firstPictureMs === null && read.coarsePixels < 16) {
      this.times.firstPictureMs = now - this.times.beginMs;
      this.firstPictureBytes = this.source.fetchedBytes;
      mark("first picture");
    }
    // What arrived since the sample began may refer to more that is missing.
    if (!moving && nothingComes && !outdated) this.quietRounds++;
    else if (!this.isComplete || read.coarsePixels > kFinePixels) this.quietRounds = 0;
    this.fullDrawn = full;
    if (this.isComplete && full && nothingComes && this.improveSun(now))
      for (const resolve of this.waiting.splice(0)) resolve();
  }

  drawEmpty() {
    const {passes, canvas} = this;
    passes.resize(canvas.width, canvas.height, canvas, false);
    passes.show(1, canvas.width, canvas.height);
    this.hasDrawn = true;
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}

// A named time, for the tools of the browser.
function mark(name) {
  performance.mark(`voxdag: ${name}`);
}
