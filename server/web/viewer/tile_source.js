// Fetches the manifest, tiles and color pages of one file. The tiles and pages of a digest never
// change. So the browser's cache answers repeated requests for single tiles, and for the first
// batches when a page is reloaded. Later batches depend on the view and are seldom requested twice.

const kTimeoutMs = 30000;   // maximum time between two bytes; a complete answer may take longer
const kMaxBytes = 2 ** 26;  // maximum size of an answer; the largest possible batch has 44 MB
const kLookAgainMs = 5000;  // minimum time between two checks that the file still exists
const kMaxTileLevels = 5, kMaxBatch = 4096;

const kReplaced = {
  code: "replaced",
  message: "The file was replaced by another one: reload the page."
};
const kRemoved = {
  code: "removed",
  message: "The file was removed: its missing parts cannot be loaded."
};
const kDamaged = {
  code: "damaged",
  message: "Part of the file is damaged and drawn coarse: run voxdag verify."
};
// The users of a service have no file, so they cannot verify it.
const kResultDamaged = {
  code: "damaged",
  message: "Part of the result is damaged and drawn coarse: submit a new job of the scene."
};

// `status` is the HTTP status: 0 if there was no answer, 200 for an answer that makes no sense.
// `code` is the error code from the service.
export class TileError extends Error {
  constructor(status, detail, {code = "", retryAfterMs = 0, timedOut = false} = {}) {
    super(detail);
    Object.assign(this, {status, code, retryAfterMs, timedOut});
  }
  // True if the same request can succeed later.
  get isTransient() {
    if (this.code === "corrupt" || this.code === "unsupported_version") return false;
    return this.status === 0 || this.status === 408 || this.status === 429 || this.status >= 500;
  }
  // True if the token was refused.
  get isDenied() {
    return this.status === 401 || this.status === 403;
  }
  // True if the service is busy.
  get isBusy() {
    return (this.status === 503 || this.status === 429) &&
        (this.code === "busy" || this.retryAfterMs > 0);
  }
  // True if something was not found: one tile, or the complete file.
  get isMissing() {
    return this.status === 404 || this.status === 409;
  }
  // True if one of the requested items possibly caused the error, although the service does not
  // report this.
  get isSuspicious() {
    return this.status === 200 || (this.status === 500 && this.isTransient);
  }
}

export class TileSource {
  // `base`: the path before "/tiles", without a slash at its end. `headers`: header fields that
  // every request has. `isJob`: the file is the result of a job, perhaps unfinished.
  constructor({base, headers = {}, isJob = true}) {
    this.damage = isJob ? kResultDamaged : kDamaged;
    this.base = base;
    this.headers = headers;
    this.info = null;
    this.ended = null;  // {code, message} after the file was removed or replaced
    this.timeoutMs = kTimeoutMs;
    this.looking = null;
    this.lookedMs = -Infinity;
    this.fetchedBytes = 0;
    this.requestCount = 0;
  }

  async manifest() {
    const info = await this.fetchManifest();
    checkManifest(info);
    this.info = info;
    return info;
  }

  // Resolves to the words of the tiles of `nodes`, [{level, offset}...], in the same order. Throws
  // TileError unless all tiles arrive. `options`: {signal, cache}.
  async fetchTiles(nodes, options) {
    const digest = encodeURIComponent(this.info.digest);
    if (nodes.length === 1) {
      const {level, offset} = nodes[0];
      const bytes = await this.request(`/tiles/${level}/${offset}?v=${digest}`, options);
      return [wordsOf(bytes, 0, bytes.byteLength)];
    }
    const list = nodes.map(({level, offset}) => `${level}.${offset}`).join(",");
    const bytes = await this.request(`/tiles/batch?v=${digest}&nodes=${list}`, options);
    return splitBatch(bytes, nodes.length);
  }

  // Like fetchTiles(), for color pages [{level, position: [x, y, z]}].
  async fetchColors(pages, options) {
    const list = pages.map(({level, position}) => [level, ...position].join(".")).join(",");
    const bytes = await this.request(
        `/tiles/colors?v=${encodeURIComponent(this.info.digest)}&pages=${list}`, options);
    return splitBatch(bytes, pages.length);
  }

  get batchMax() {
    return this.info.batch_max;
  }

  // Checks, after a tile was not found, whether the file still exists. Sets `ended` if the file was
  // removed or replaced. Does nothing within kLookAgainMs after the last successful check.
  async lookAgain(signal) {
    if (this.ended || performance.now() < this.lookedMs + kLookAgainMs) return;
    this.looking ??= this.look(signal).finally(() => this.looking = null);
    await this.looking;
  }

  async look(signal) {
    try {
      const info = await this.fetchManifest(signal);
      if (info.digest !== this.info.digest) this.ended = kReplaced;
      this.lookedMs = performance.now();
    } catch (error) {
      // These codes come from the service, not from a proxy in front of it.
      if (error.code === "not_found" || error.code === "conflict") this.ended = kRemoved;
    }
  }

  async fetchManifest(signal) {
    const text =
        new TextDecoder().decode(await this.request("/tiles", {cache: "no-store", signal}));
    try {
      return JSON.parse(text);
    } catch {
      throw new TileError(200, "The manifest is not JSON.");
    }
  }

  // Resolves to the bytes of an answer. Throws TileError.
  async request(path, {cache, signal} = {}) {
    this.requestCount++;
    const ending = new AbortController(), end = () => ending.abort();
    let timer = 0, timedOut = false, response = null;
    const heard = () => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        timedOut = true;
        end();
      }, this.timeoutMs);
    };
    heard();
    signal?.addEventListener("abort", end);
    if (signal?.aborted) end();
    try {
      response =
          await fetch(this.base + path, {cache, headers: this.headers, signal: ending.signal});
      heard();
      const bytes = await bodyOf(response, heard);
      // Content-Length is the length of the body as sent, which may be compressed.
      this.fetchedBytes += Number(response.headers.get("Content-Length")) || bytes.byteLength;
      if (response.ok) return bytes;
      throw problemOf(response, bytes);
    } catch (error) {
      if (error instanceof TileError) {
        if (error.status === 410) this.ended = kReplaced;
        throw error;
      }
      const detail = response ? "The service stopped in the middle of an answer." :
                                "The service does not answer.";
      throw new TileError(0, detail, {timedOut});
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener("abort", end);
    }
  }
}

// Resolves to all bytes of an answer. Calls `heard` after each piece that arrives.
async function bodyOf(response, heard) {
  const reader = response.body?.getReader(), parts = [];
  let length = 0;
  while (reader) {
    const {done, value} = await reader.read();
    if (done) break;
    heard();
    parts.push(value);
    length += value.length;
    if (length <= kMaxBytes) continue;
    reader.cancel().catch(() => {});
    throw new TileError(200, `An answer has more than ${kMaxBytes} bytes.`);
  }
  const bytes = new Uint8Array(length);
  length = 0;
  for (const part of parts) {
    bytes.set(part, length);
    length += part.length;
  }
  return bytes.buffer;
}

function problemOf({status, headers}, bytes) {
  let problem = null;
  try {
    problem = JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    // The answer was not sent by the service, so only the HTTP status is used.
  }
  const retryAfterMs = 1000 * Math.max(0, Number(headers.get("Retry-After")) || 0);
  return new TileError(
      status, String(problem?.detail || `The service answered ${status}.`),
      {code: String(problem?.code ?? ""), retryAfterMs});
}

// Checks those values of the manifest on which GPU memory sizes and loop bounds depend.
export function checkManifest(info) {
  const expect = (isTrue, name) => {
    if (!isTrue)
      throw new TileError(
          200, `The manifest's ${name} cannot be used: ${JSON.stringify(info?.[name])}.`);
  };
  const isCount = (value, least, most) =>
      Number.isInteger(value) && value >= least && value <= most;
  const isWord = (value) => isCount(value, 0, 2 ** 32 - 1);
  expect(isCount(info?.levels, 2, 20), "levels");
  expect(info.resolution === 2 ** info.levels, "resolution");
  expect(isCount(info.tile_levels, 1, kMaxTileLevels), "tile_levels");
  expect(isCount(info.batch_max, 1, kMaxBatch), "batch_max");
  expect(typeof info.digest === "string" && info.digest !== "", "digest");
  // A partial result has no voxel count and no colors.
  const isGrowing = info.voxels === undefined && !info.colors;
  expect(isGrowing || (typeof info.voxels === "string" && /^\d+$/.test(info.voxels)), "voxels");
  expect(
      !info.root || (info.root.level === 0 && isCount(info.root.offset, 0, 2 ** 40 - 1)), "root");
  const {root_brick, colors} = info, needsBrick = Boolean(info.root) && info.levels === 2;
  expect(
      root_brick ?
          Array.isArray(root_brick) && root_brick.length === 2 && root_brick.every(isWord) :
          !needsBrick,
      "root_brick");
  expect(
      !colors ||
          (isCount(colors.levels, 0, info.levels) && isCount(colors.batch_max, 1, kMaxBatch)),
      "colors");
}

function wordsOf(bytes, begin, length) {
  if (length % 4 !== 0 || begin + length > bytes.byteLength)
    throw new TileError(200, "A tile's length is wrong.");
  return new Uint32Array(bytes, begin, length / 4);
}

// Splits an answer into its `count` parts.
export function splitBatch(bytes, count) {
  const view = new DataView(bytes);
  const tiles = [];
  let at = 0;
  for (let i = 0; i < count; ++i) {
    if (at + 4 > bytes.byteLength) throw new TileError(200, "A batch ends before its last tile.");
    const length = view.getUint32(at, true);
    tiles.push(wordsOf(bytes, at + 4, length));
    at += 4 + length;
  }
  if (at !== bytes.byteLength) throw new TileError(200, "A batch has bytes after its last tile.");
  return tiles;
}
