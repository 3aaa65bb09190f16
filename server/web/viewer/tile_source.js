// Fetches the manifest, tiles and color pages of one file. They are immutable for a digest, so the browser's cache
// answers a request that was answered before.

const kTimeoutMs = 30000;
const kBatchDefault = 64;

// `status` is the HTTP status, 0 when there was no answer. `replaced`: the file is another one now.
export class TileError extends Error {
  constructor(status, detail) {
    super(detail);
    this.status = status;
  }
  get replaced() {
    return this.status === 410;
  }
  // Whether the same request may succeed later.
  get is_transient() {
    return this.status === 0 || this.status === 408 || this.status === 429 || this.status >= 500;
  }
}

export class TileSource {
  // `base`: path before "/tiles", without a slash at its end. `headers`: of every request.
  constructor({base, headers = {}}) {
    this.base = base;
    this.headers = headers;
    this.info = null;
    this.fetched_bytes = 0;
    this.request_count = 0;
  }

  async manifest() {
    const response = await this.request("/tiles", {cache: "no-store"});
    const info = await response.json();
    if (!Number.isInteger(info.levels) || info.levels < 2 || info.levels > 20)
      throw new TileError(200, `The manifest's levels are ${info.levels}; expected 2 to 20.`);
    this.info = info;
    return info;
  }

  // The tiles of the nodes [{level, offset}], as words, in the same order. All or a TileError.
  async fetchTiles(nodes) {
    const digest = encodeURIComponent(this.info.digest);
    if (nodes.length === 1) {
      const {level, offset} = nodes[0];
      const bytes = await this.bytes(`/tiles/${level}/${offset}?v=${digest}`);
      return [words_of(bytes, 0, bytes.byteLength)];
    }
    const list = nodes.map(({level, offset}) => `${level}.${offset}`).join(",");
    const bytes = await this.bytes(`/tiles/batch?v=${digest}&nodes=${list}`);
    return split_batch(bytes, nodes.length);
  }

  // Color pages [{level, position: [x, y, z]}], in the same way.
  async fetchColors(pages) {
    const list = pages.map(({level, position}) => [level, ...position].join(".")).join(",");
    const bytes = await this.bytes(`/tiles/colors?v=${encodeURIComponent(this.info.digest)}&pages=${list}`);
    return split_batch(bytes, pages.length);
  }

  get batch_max() {
    return this.info?.batch_max || kBatchDefault;
  }

  async bytes(path) {
    const response = await this.request(path, {});
    try {
      const bytes = await response.arrayBuffer();
      // Of the body as sent, which may be compressed.
      this.fetched_bytes += Number(response.headers.get("Content-Length")) || bytes.byteLength;
      return bytes;
    } catch {
      throw new TileError(0, "The service stopped in the middle of an answer.");
    }
  }

  async request(path, options) {
    this.request_count++;
    let response;
    try {
      response = await fetch(this.base + path, {...options, headers: this.headers, signal: AbortSignal.timeout(kTimeoutMs)});
    } catch {
      throw new TileError(0, "The service does not answer.");
    }
    if (response.ok) return response;
    const problem = await response.json().catch(() => ({}));
    throw new TileError(response.status, problem.detail || `The service answered ${response.status}.`);
  }
}

function words_of(bytes, begin, length) {
  if (length % 4 !== 0 || begin + length > bytes.byteLength)
    throw new TileError(200, "A tile's length is wrong.");
  return new Uint32Array(bytes, begin, length / 4);
}

function split_batch(bytes, count) {
  const view = new DataView(bytes);
  const tiles = [];
  let at = 0;
  for (let i = 0; i < count; ++i) {
    if (at + 4 > bytes.byteLength) throw new TileError(200, "A batch ends before its last tile.");
    const length = view.getUint32(at, true);
    tiles.push(words_of(bytes, at + 4, length));
    at += 4 + length;
  }
  if (at !== bytes.byteLength) throw new TileError(200, "A batch has bytes after its last tile.");
  return tiles;
}
