// The tiles and color pages of one file in one graphics context. Loads the root, then the tiles of
// the first view, and then the tiles that each reading of the feedback (gl/feedback.js) reports as
// missing. A new context gets a new stream.

import {GridSpace} from "../camera_text.js";
import {colorBudget, Colors} from "../colors/colors.js";
import {View} from "../gl/view.js";
import {FirstView} from "../tiles/first_view.js";
import {TileLoader} from "../tiles/tile_loader.js";
import {TilePool} from "../tiles/tile_pool.js";
import {TileStore} from "../tiles/tile_store.js";

import {kBlockBytes, mark} from "./statistics.js";

const kMinPoolBytes = 4 << 20;  // size of the pool for the smallest file
const kMaxFirstWaitMs = 400;  // maximum time that the first frame waits for the first view's tiles

export class TileStream {
  // `options` are the renderer's options. Color pages are loaded only if options.color is true.
  // onArrival() is called when a tile or page has arrived. onArrival(true) is called when a request
  // has failed or the state of retries has changed.
  constructor(gl, source, info, options, budgetBytes, onArrival) {
    this.info = info;
    this.options = options;
    this.onArrival = onArrival;
    this.isEmpty = !info.root && !info.root_brick;
    this.rootPointer = undefined;
    this.waitUntilMs = performance.now() + kMaxFirstWaitMs;
    const colorBytes = colorBudget(info, budgetBytes);
    const poolBytes = poolBudget(info, budgetBytes - colorBytes);
    this.store = new TileStore(new TilePool(gl, poolBytes), info);
    this.colors = colorBytes > 0 ? new Colors(gl, source, colorBytes, onArrival) : null;
    this.loader = new TileLoader(source, this.store, onArrival);
  }

  // Loads the root. Resolves to the words of the root tile; to undefined if the file has no tiles
  // (an empty grid or a grid of one brick) or the stream has ended.
  async loadRoot() {
    const {root, levels, root_brick: brick} = this.info;
    if (root && levels > 2) {
      const words = await this.loader.loadRoot(root.level, root.offset);
      this.rootPointer = this.store.root?.pointer;
      mark("root");
      return words;
    }
    if (!this.isEmpty) this.rootPointer = this.store.addBrick(brick);
    return undefined;
  }

  // Uses another root that the loader has loaded.
  useRoot(info) {
    this.info = info;
    this.rootPointer = this.store.root.pointer;
  }

  beginEpoch() {
    this.store.beginEpoch();
    this.loader.beginEpoch();
    this.colors?.beginEpoch();
  }

  // Finds the tiles of the first view, beginning with the words of the root. Does not need the
  // feedback of a frame.
  seekFirstView(rootWords, view, size) {
    const {levels} = this.info, finestLevel = Math.min(levels, this.options.maxLevel ?? levels);
    this.loader.firstView =
        new FirstView(this.info, view, size, 2 ** (levels - finestLevel), this.firstTiles(view));
    this.loader.firstView.begin(this.store, this.store.root, rootWords);
    this.continueFirstView();
  }

  // Returns a function that is true for the tiles that a view needs first; undefined if the source
  // of the tiles does not know them.
  firstTiles(view) {
    const {info, loader: {source}} = this;
    if (!source.knowsFirstTiles || !info.camera) return undefined;
    const camera = new View(new GridSpace(info).placement(info.camera));
    return view.isNear(camera, info.resolution) ? (node) => source.isFirstTile(node) : undefined;
  }

  // Requests more tiles of the first view, unless it is complete.
  continueFirstView() {
    const {firstView} = this.loader;
    if (!firstView) return;
    if (firstView.isOver) return this.endFirstView();  // the next reading replaces the queue
    this.loader.demand(firstView.wanted, performance.now());
    if (this.loader.isIdle || this.loader.awaitsRetry) this.endFirstView();
  }

  endFirstView() {
    if (this.loader.firstView) mark("tiles of the first view");
    this.loader.firstView = null;
  }

  // True while the first frame should wait for the tiles of the first view. A frame with these
  // tiles is almost complete. A frame without them would show little and delay the next frame.
  get awaitsFirstTiles() {
    return performance.now() < this.waitUntilMs &&
        (this.loader.firstView !== null || this.rootPointer === undefined);
  }

  // Takes the reading of a frame that was drawn for `epoch` (tile_store.js). Requests the tiles and
  // pages that were missing in the frame, and marks the tiles and pages that it used.
  // `pageFeedback` is the reading of the color feedback; null if no colors are shown.
  takeReading(read, pageFeedback, epoch, nowMs) {
    const {loader, store, colors} = this;
    for (const slot of read.slots) store.mark(slot, epoch, nowMs);
    if (epoch === store.epoch) store.rounds++;
    if (loader.firstView?.stalls(nowMs)) this.endFirstView();
    if (!loader.firstView && loader.demand(read.wanted, nowMs) > 0) this.onArrival();
    if (pageFeedback) colors.takeReading(pageFeedback.take(), epoch, nowMs);
    else colors?.loader.replaceQueue([], 0, nowMs);
  }

  get loaders() {
    return [this.loader, ...(this.colors && this.options.color ? [this.colors.loader] : [])];
  }

  // Number of tiles and pages that were missing in the last reading and can still arrive.
  get missingCount() {
    return this.loaders.reduce((sum, each) => sum + each.unmet, 0);
  }

  // True if no request is queued or in progress, and no request waits for a retry.
  get isQuiet() {
    return this.loaders.every((each) => each.isIdle && !each.awaitsRetry);
  }

  get isLoading() {
    return this.loaders.some((each) => each.requests > 0);
  }

  get hasOutage() {
    return this.loaders.some((each) => each.outage.count > 0);
  }

  // True if nothing arrives until the next retry.
  isPaused(nowMs) {
    return this.loaders.some((each) => each.pauses(nowMs)) &&
        this.loaders.every((each) => each.pauses(nowMs) || each.isIdle);
  }

  // The textures of the pools. When a pool grows, its texture is replaced.
  get poolTextures() {
    return [this.store.pool.texels, this.colors?.store.pool.texels];
  }

  // The reason why a part of the picture does not arrive, {code, message}; null without one.
  get problem() {
    return this.loader.problem || (this.options.color && this.colors?.loader.problem) || null;
  }

  fail(error) {
    this.loader.fail(error);
  }

  // Ends all requests. Does not free the memory on the GPU, which remains in use or was lost with
  // the context.
  stop() {
    this.loader.dispose();
    this.colors?.loader.dispose();
  }

  dispose() {
    this.loader.dispose();
    this.store.pool.dispose();
    this.colors?.dispose();
  }
}

// Returns the size of the pool in bytes. A small file needs less than the budget: in the worst
// case, each voxel needs a separate tile at each step from the root to the bricks. For a growing
// DAG the number of voxels is unknown, so its pool gets the complete budget.
function poolBudget({voxels, levels, tile_levels: tileLevels}, budgetBytes) {
  const pathBlocks = Math.ceil(levels / tileLevels);
  return Math.min(
      budgetBytes, kMinPoolBytes + Number(voxels ?? Infinity) * kBlockBytes * pathBlocks);
}
