// Draws a file of any size within a budget of GPU memory. Casts rays through the loaded tiles, and
// requests the tiles that the rays miss (docs/view.md).
//
// Each part of the renderer has its own class and lifetime:
//   - GraphicsContext: until the renderer is disposed
//   - TileStream: until the context loses its memory
//   - the samples of a FrameAccumulator: until the picture starts again
//   - ViewProgress and SunSearch: while the view remains the same

import {readFeedback, readHits} from "../gl/feedback.js";
import {WebGLUnavailable} from "../gl/gl_objects.js";
import {jitterOf, pictureValues} from "../gl/picture_values.js";
import {View} from "../gl/view.js";

import {FrameAccumulator} from "./frame_accumulator.js";
import {GraphicsContext} from "./graphics_context.js";
import {Light} from "./light.js";
import {Pace} from "./pace.js";
import {pickVoxel} from "./picker.js";
import {mark, Statistics} from "./statistics.js";
import {SunSearch} from "./sun_search.js";
import {TileStream} from "./tile_stream.js";
import {ViewProgress} from "./view_progress.js";

export {WebGLUnavailable};

const kBudgetBytes = 256 << 20, kPhoneBudgetBytes = 64 << 20;
// Maximum number of canvas pixels. The budget does not include the render targets for these pixels.
const kMaxPixels = 8e6, kPhoneMaxPixels = 2e6;
const kMovingMs = 180;  // the camera counts as moving until this time after its last change
const kSamples = 16;    // number of samples per pixel of a still picture
// Statistics record the time of the first picture in which all cells with missing tiles are
// narrower than this number of pixels.
const kFirstPicturePixels = 16;

export class Renderer {
  // `begun`: the context that early.js has created for this canvas, or null. onChange() is called
  // when there is something new for frame() to draw. Throws WebGLUnavailable.
  constructor(canvas, source, {budgetBytes, onChange, begun = null} = {}) {
    this.canvas = canvas;
    this.source = source;
    this.onChange = onChange || (() => {});
    const isPhone =
        matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
    this.budgetBytes = budgetBytes || (isPhone ? kPhoneBudgetBytes : kBudgetBytes);
    this.maxPixels = isPhone ? kPhoneMaxPixels : kMaxPixels;
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
    const {width, height} = canvas;
    this.size = {width, height, cssWidth: width, cssHeight: height};
    this.info = this.light = this.sun = this.stream = null;  // set by start()
    this.view = null;
    this.viewMs = -Infinity;  // the time of the last change of the view
    this.isReady = false;     // programs, pool and root are loaded
    this.started = null;      // {resolve, reject, isDone} of the promise of start()
    this.measured = new Statistics(begun?.beginMs ?? performance.now());
    this.pace = new Pace();
    this.progress = new ViewProgress();
    this.context = new GraphicsContext(canvas, begun, {
      onLost: () => this.handleLoss(),
      onRestored: () => this.started && this.load(),
    });
    this.frames = new FrameAccumulator(this.context, this.pace, () => this.show());
  }

  // Resolves when the first picture can be drawn. The manifest of the source must be loaded before
  // the call. If the view is set before the call, the tiles of the view are requested immediately.
  async start() {
    this.info = this.source.info;
    this.light = new Light(this.info);
    this.sun = new SunSearch(this.context, this.light);
    if (this.view) this.light.placeSun(this.view.eye, this.view.forward);
    await new Promise((resolve, reject) => {
      this.started = {resolve, reject, isDone: false};
      if (this.context.isDisposed) resolve();
      else if (!this.context.isLost) this.load();
    });
  }

  // Shows another root of the same DAG, after the DAG has grown. Loaded tiles remain. Resolves to
  // true if the new root is shown.
  async showRoot(info) {
    const {stream} = this;
    if (!this.isReady || !this.info.root || info.levels <= 2) return false;
    await stream.loader.loadRoot(info.root.level, info.root.offset);
    if (stream !== this.stream || !this.isReady) return false;
    this.info = info;
    stream.useRoot(info);
    this.beginEpoch();
    return true;
  }

  setView(placement) {
    const view = new View(placement);
    if (view.equals(this.view)) return;
    this.view = view;
    if (this.light?.turn === null) this.light.placeSun(view.eye, view.forward);
    this.stream?.endFirstView();
    this.viewMs = performance.now();
    this.beginEpoch();
  }

  setOptions(options) {
    Object.assign(this.options, options);
    this.light?.forgetReadings();
    this.stream?.endFirstView();
    this.beginEpoch();
  }

  resize(cssWidth, cssHeight, deviceRatio) {
    const ratio =
        Math.min(deviceRatio, Math.sqrt(this.maxPixels / Math.max(1, cssWidth * cssHeight)));
    const pixels = (css) => Math.min(this.context.maxSize, Math.max(1, Math.round(css * ratio)));
    const {canvas} = this, width = pixels(cssWidth), height = pixels(cssHeight);
    const isSame = width === canvas.width && height === canvas.height && width === this.size.width;
    this.size = {width, height, cssWidth, cssHeight};
    if (isSame) return;
    canvas.width = width;
    canvas.height = height;
    if (this.isReady && this.context.passes.targets) this.show();  // until there is a new picture
    this.beginEpoch();
  }

  // Draws a frame if there is something new to draw and the GPU has finished the previous frame.
  // Returns {moving, complete}: whether the camera moves, and whether the picture is complete.
  frame() {
    const now = performance.now(), moving = now - this.viewMs < kMovingMs;
    if (!this.isReady || !this.view) return {moving, complete: true};
    this.pace.tick(now);
    if (this.stream.isEmpty) {
      this.drawEmpty();
      return {moving: false, complete: true};
    }
    if (!this.takesNewFrame(now)) return {moving, complete: false};
    if (!moving && this.isPictureFinal(now)) return {moving, complete: true};
    this.draw(now, moving);
    return {moving, complete: false};
  }

  // Continues the sample that is being drawn, and takes the reading of its feedback. Returns true
  // if both are done.
  takesNewFrame(now) {
    const {frames, stream} = this;
    if (!frames.hasDrawn && stream.awaitsFirstTiles) return false;
    if (frames.drawing && !frames.continue(now, stream.poolTextures)) return false;
    if (!frames.reading) return true;
    const sample = frames.takeReading();
    if (sample) this.takeReading(sample, now);
    return sample !== null;
  }

  // True if further samples would not change the picture before a tile arrives.
  isPictureFinal(now) {
    if (this.frames.samples < kSamples) return false;
    const {progress} = this;
    return (progress.isComplete && progress.waiting.length === 0 && this.isSunPlaced) ||
        (progress.isFullSize && this.stream.isPaused(now));
  }

  // Resolves when all tiles for the canvas pixels have arrived and the sun is placed. Inside a
  // scene, placing the sun needs further tiles. So the promise remains pending while the service
  // does not answer.
  complete() {
    if (this.isReady && this.isComplete && this.progress.isFullSize && this.isSunPlaced &&
        !this.frames.reading)
      return Promise.resolve();
    return new Promise((resolve) => {
      this.progress.waiting.push(resolve);
      this.onChange();
    });
  }

  // Resolves to the voxel at a point of the canvas; to null for the sky.
  pick(cssX, cssY) {
    return pickVoxel(this, cssX, cssY);
  }

  // Resolves to the hits of a picture of any size, drawn with the loaded tiles. Rows are from the
  // top.
  async capture({width, height}) {
    const words = this.canPick ?
        this.context.passes.capture(this.uniforms(width, height), width, height) :
        new Uint32Array(4 * width * height);
    return readHits(words, width, height, this.info?.levels);
  }

  statistics() {
    return this.measured.report(this);
  }

  // The reason why a part of the picture does not arrive, {code, message}; null without one.
  get problem() {
    return this.stream?.problem ?? null;
  }

  get hasDrawn() {
    return this.frames.hasDrawn;
  }

  get canPick() {
    return this.isReady && !this.stream.isEmpty;
  }

  get isComplete() {
    return this.progress.isComplete;
  }

  get isSunPlaced() {
    return this.sun.isOver || !this.options.sunShadows;
  }

  dispose() {
    this.isReady = false;
    this.context.dispose();
    this.stream?.dispose();
    this.started?.resolve();
  }

  // Loads the file into the current context, for the first time or after the previous context was
  // lost.
  async load() {
    const {context, info} = this, {passes} = context;
    try {
      const root = this.loadRoot();
      root.catch(() => {});  // the error is reported below, unless the programs fail first
      if (!await context.compile(Boolean(info.colors))) return;
      mark("compiled");
      await root;
      if (!context.owns(passes)) return;
      this.isReady = true;
      this.beginEpoch();
      this.started.isDone = true;
      this.started.resolve();
    } catch (error) {
      if (!context.owns(passes)) return;
      if (!this.started.isDone) return this.started.reject(error);
      console.error(error);
      this.stream?.fail(error);
      this.onChange();
    }
  }

  async loadRoot() {
    const stream = this.stream = new TileStream(
        this.context.gl, this.source, this.info, this.options, this.budgetBytes,
        (failed) => this.handleArrival(failed));
    const words = await stream.loadRoot();
    if (words && this.view && !this.options.clip && !this.measured.hasFirstPicture)
      stream.seekFirstView(words, this.view, this.size);
  }

  handleLoss() {
    this.isReady = false;
    this.stream?.stop();
    this.frames.reset();
  }

  // Called when a tile or page has arrived, or when a request has failed.
  handleArrival(hasFailed = false) {
    this.stream.continueFirstView();
    if (!hasFailed && this.progress.needsRestartOnArrival) this.restart();
    this.onChange();
  }

  restart() {
    this.frames.restart();
    this.progress.restart();
  }

  beginEpoch() {
    this.restart();
    this.pace.beginView();
    this.stream?.beginEpoch();
    this.onChange();
  }

  // Returns the resolution at which frames are rendered. If frames take long, this resolution is
  // lower while the camera moves and while tiles arrive.
  internalSize(moving) {
    const scale = this.resolutionScale(moving);
    const scaled = (pixels) => Math.max(1, Math.round(pixels * scale));
    return {width: scaled(this.size.width), height: scaled(this.size.height), isFull: scale === 1};
  }
  resolutionScale(moving) {
    const {progress, stream, pace} = this;
    if (moving) return pace.scale;
    const isSeeking = progress.quietReadings === 0 || (!progress.isComplete && stream.isLoading);
    return isSeeking && !stream.hasOutage ? pace.seekingScale : 1;
  }

  draw(now, isMoving) {
    const {frames, stream, size, context: {passes}} = this;
    const {width, height, isFull} = this.internalSize(isMoving);
    if (!passes.hasTargets(width, height, size)) frames.samples = 0;
    passes.resize(width, height, size, stream.colors !== null);
    // A smaller picture of a still view uses cells as fine as the full-size picture, so that it
    // requests the same tiles.
    const values = this.uniforms(width, height, isMoving ? height : size.height);
    frames.seed++;
    Object.assign(values, {
      u_frame: frames.samples,
      u_seed: frames.seed,
      u_jitter: jitterOf(isFull ? frames.samples : frames.seed)
    });
    const {poolTextures, store: {epoch}} = stream;
    frames.begin(values, {width, height, isFull, isMoving, epoch, poolTextures}, now);
  }

  show() {
    this.context.passes.show(this.light.exposure, this.canvas.width, this.canvas.height);
  }

  uniforms(width, height, lodHeight = height) {
    return pictureValues(this, width, height, lodHeight);
  }

  // Takes the feedback of a drawn sample.
  takeReading(sample, now) {
    const {pass, epoch, isMoving, isFull, width, height} = sample, {stream, progress, pace} = this;
    const read = readFeedback(pass.take());
    read.coarsePixels *= this.size.height / height;  // converts to pixels of the canvas
    this.measured.noteFrame(read, width * height);
    pace.frameDone(now - sample.partMs, sample.busyMs, width * height, isMoving || !isFull);
    // The light changes only during the first quarter of the samples of a still picture.
    if (read.exposure !== null && this.frames.samples <= kSamples / 4)
      this.light.adjust(read, this.view.eye, isMoving);
    progress.coarsePixels = read.coarsePixels;
    stream.takeReading(read, pass.colors, epoch, now);
    if (epoch !== stream.store.epoch) return;
    if (!isMoving && !stream.loader.firstView)
      pace.noteLacking(stream.missingCount, read.coarsePixels);
    if (read.coarsePixels < kFirstPicturePixels)
      this.measured.noteFirstPicture(now, this.source.fetchedBytes);
    this.judgeProgress(sample, now);
  }

  // Records whether a sample's reading has no missing tiles. Once the view is complete, places the
  // sun. An outdated sample cannot show that the view is complete: tiles have arrived since the
  // sample began, and these tiles can refer to further missing tiles.
  judgeProgress({isMoving, isFull, isOutdated}, now) {
    const {progress} = this, {isQuiet} = this.stream;
    progress.takeReading(!isMoving && isQuiet && !isOutdated, isFull);
    if (!progress.isComplete || !isFull || !isQuiet) return;
    if (this.isSunPlaced) progress.resolveWaiting();
    else this.improveSun(now);
  }

  improveSun(now) {
    const {width, height} = this.context.passes.targets;
    if (!this.sun.run(this.uniforms(width, height), this.stream.loader, now)) return;
    this.restart();
    this.light.forgetReadings();
  }

  drawEmpty() {
    const {canvas, context: {passes}} = this;
    passes.resize(canvas.width, canvas.height, canvas, false);
    passes.show(1, canvas.width, canvas.height);
    this.frames.hasDrawn = true;
    this.progress.resolveWaiting();
  }
}
