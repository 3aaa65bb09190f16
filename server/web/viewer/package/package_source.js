// Reads tiles and color pages from a package (docs/format.md, "Packages"), which any web server can
// serve. PackageSource has the same functions as TileSource, which reads them from the voxdag
// service. The address of a tile is {level, offset}; in a package, `offset` is the number of the
// tile among the tiles of its level.

import {checkManifest, TileError} from "../tile_source.js";
import {tileShape} from "../tiles/tile_format.js";

import {decodeColorBlock, gunzip, mortonCode, TileBlock} from "./block_format.js";
import {Directory} from "./directory.js";
import {PromiseCache} from "./promise_cache.js";
import {Segments} from "./segments.js";

const kFormat = "voxdag package", kVersion = 3;
const kBlockTiles = 64;
const kMaxCachedBytes = 32 << 20;  // limit for decompressed blocks in memory
const kMaxTileBatches = 2, kMaxBatchTiles = 512;
const kLookAgainMs = 5000;

const kReplaced = {
  code: "replaced",
  message: "The files were replaced by other ones: reload the page."
};
const kRemoved = {
  code: "removed",
  message: "The files were removed: their missing parts cannot be loaded."
};

export class PackageSource {
  // `files` is a PackageFiles, or an object with the same functions (EmbeddedFiles).
  constructor(files) {
    this.files = files;
    this.segments = new Segments(files);
    this.info = null;
    this.ended = null;  // {code, message} once the package was removed or replaced
    this.damage = {
      code: "damaged",
      message:
          "Part of the files is missing or damaged and drawn coarse: run voxdag publish --check."
    };
    this.blocks = new PromiseCache(kMaxCachedBytes);  // decoded blocks
    this.lookedMs = -Infinity;
    this.looking = null;
  }

  get timeoutMs() {
    return this.files.timeoutMs;
  }
  get fetchedBytes() {
    return this.files.fetchedBytes;
  }
  get requestCount() {
    return this.files.requestCount;
  }
  get batchMax() {
    return this.info.batch_max;
  }
  // Limits of TileLoader. Batches are larger than for the service, because one request can fetch
  // the blocks of many tiles, if these blocks are close together.
  get tileLimits() {
    return {maxRequests: kMaxTileBatches, maxBatch: kMaxBatchTiles};
  }

  async manifest() {
    const index = await this.fetchIndex();
    checkManifest(index.manifest);
    this.info = index.manifest;
    this.packs = index.packs;
    this.bands = index.bands;
    this.directory = new Directory(this.files, index);
    this.warmUp();
    return this.info;
  }

  // Begins to load the head and the first page of the directory, because every view needs them.
  // Without a head, loads the first pack instead.
  warmUp() {
    const file = this.directory.head ?? this.packs[0];
    if (file) this.files.read(file, 0, file.bytes).catch(() => {});
    if (this.packs.length > 0) this.directory.page(0).catch(() => {});
  }

  // True if the first picture of the camera in the manifest needs the tile.
  isFirstTile({level, offset}) {
    return this.bands.some((band) => band.level === level && offset < band.head_tiles);
  }
  // True if the package knows the tiles of the first picture.
  get knowsFirstTiles() {
    return this.directory.head !== null;
  }

  async fetchIndex(signal) {
    const index = await this.fetchAnyIndex(signal);
    if (index?.version !== kVersion)
      throw new TileError(
          200, `package.json is not the index of a package of version ${kVersion}.`);
    return index;
  }

  // Resolves to the index of a package of any version, or to null if the file is not an index.
  async fetchAnyIndex(signal) {
    const text = await this.files.text("package.json", signal);
    try {
      const index = JSON.parse(text);
      return index?.format === kFormat ? index : null;
    } catch {
      return null;
    }
  }

  // Resolves to a list with the words of each tile of `nodes`, in the same order. If the block of a
  // tile is missing or damaged, the tile's element is a TileError instead. Throws TileError if the
  // server does not answer.
  fetchTiles(nodes, options = {}) {
    return this.fetchItems(nodes, options, async ({level, offset}) => {
      const band = this.bandOf(level, "tiles");
      if (!(offset < this.bands[band].tiles))
        throw new TileError(404, `Level ${level} has no tile ${offset}.`);
      return this.directory.tileBlock(band, offset);
    }, (block, {offset}) => block.tile(offset % kBlockTiles));
  }

  // Like fetchTiles(), for color pages.
  fetchColors(pages, options = {}) {
    return this.fetchItems(
        pages, options,
        ({level, position}) =>
            this.directory.colorBlock(this.bandOf(level, "pages"), mortonCode(position), options),
        (block, {position}) => block.get(mortonCode(position)) ?? new Uint32Array(1));
  }

  bandOf(level, kind) {
    const band = this.bands.findIndex((each) => each.level === level && each[kind] !== undefined);
    if (band < 0) throw new TileError(404, `The package has no ${kind} of level ${level}.`);
    return band;
  }

  async fetchItems(items, options, blockOf, take) {
    const blocks = await Promise.all(items.map((item) => outcomeOf(blockOf(item))));
    const numbers = new Set(blocks.filter(({error}) => !error).map(({value}) => value));
    await this.load([...numbers], options);
    const results = await Promise.all(blocks.map(
        ({value, error}) => error ? {error} : outcomeOf(this.blocks.get(value) ?? missing(value))));
    const failure = results.find(({error}) => error && !isOfOneItem(error));
    if (failure) throw failure.error;
    if (results.some(({error}) => error?.isMissing)) await this.lookAgain(options.signal);
    const answers = results.map(({value, error}, i) => {
      try {
        return error ?? take(value, items[i]);
      } catch (damage) {
        return new TileError(200, damage.message);
      }
    });
    this.blocks.evict();
    return answers;
  }

  // Begins to load the blocks of the list `blocks` that are not in this.blocks.
  async load(blocks, options) {
    const wanted = [];
    for (const block of blocks)
      if (!this.blocks.get(block)) wanted.push(this.begin(block));
    const places = await Promise.all(wanted.map(async (request) => {
      const {value, error} = await outcomeOf(this.directory.place(request.block, options));
      if (error) request.reject(error);
      return {...request, ...value, error};
    }));
    const known = places.filter(({error}) => !error);
    try {
      const reads = this.segments.read(known, options);
      known.forEach((place, i) => place.resolve(this.decodeRead(place, reads[i], options)));
    } catch (error) {
      for (const place of known) place.reject(error);
    }
  }

  // Decodes the bytes of a place. If they are damaged and no answer to a range request was correct
  // so far, the server possibly sends wrong ranges. In this case, fetches the complete file.
  async decodeRead(place, reads, options) {
    const bytes = await reads, {files} = this;
    try {
      return await this.decode(place.block, bytes);
    } catch (error) {
      if (!bytes.isRange || files.rangesAreProven) throw error;
    }
    files.hasRanges = false;
    this.segments.forget(place);
    return this.decode(place.block, await this.segments.read([place], options)[0]);
  }

  // Adds a promise of the block to this.blocks. This is done before the block is requested, so that
  // concurrent calls do not request it again. Returns {block, resolve, reject}, with the functions
  // of the promise.
  begin(block) {
    const request = {block};
    const loads = new Promise((resolve, reject) => Object.assign(request, {resolve, reject}));
    this.blocks.add(block, loads, ({byteSize}) => byteSize);
    return request;
  }

  async decode(block, bytes) {
    try {
      const plain = await gunzip(bytes), decoded = this.parse(block, plain);
      if (bytes.isRange) this.files.rangesAreProven = true;
      decoded.byteSize = plain.length;
      return decoded;
    } catch (error) {
      throw new TileError(200, `Block ${block} of the package is damaged: ${error.message}`);
    }
  }

  parse(block, plain) {
    const {band, index} = this.directory.bandOf(block), {level, tiles} = this.bands[band];
    if (tiles === undefined) return decodeColorBlock(plain);
    const count = Math.min(kBlockTiles, tiles - index * kBlockTiles);
    return new TileBlock(plain, level, tileShape(this.info, level), count);
  }

  // Called after a file was not found. Checks whether the package still exists, and sets `ended` if
  // the package was removed or replaced.
  async lookAgain(signal) {
    if (this.ended || performance.now() < this.lookedMs + kLookAgainMs) return;
    this.looking ??= this.look(signal).finally(() => this.looking = null);
    await this.looking;
  }

  async look(signal) {
    try {
      const index = await this.fetchAnyIndex(signal);
      // Later versions can store the digest elsewhere, but their files are others in any case.
      const isSame = index?.version === kVersion && index.manifest?.digest === this.info.digest;
      if (index && !isSame) this.ended = kReplaced;
      this.lookedMs = performance.now();
    } catch (error) {
      if (error.isMissing) this.ended = kRemoved;
    }
  }
}

// Resolves to {value}, or to {error} if the promise is rejected.
async function outcomeOf(promise) {
  try {
    return {value: await promise};
  } catch (error) {
    return {error};
  }
}

function missing(block) {
  return Promise.reject(new TileError(200, `Block ${block} of the package is damaged.`));
}

// True if the error concerns one file or block. Other files and blocks can still be loaded.
function isOfOneItem(error) {
  return error instanceof TileError && (error.isMissing || error.status === 200);
}
