// Reads the files of a package from a web server.
//
// Many servers do not answer a range request with the range: they send the complete file, an error,
// or a range of the compressed file. So the length and the position of each answer are checked.
// After the first wrong answer, all files are fetched completely.

import {TileError} from "../tile_source.js";

const kTimeoutMs = 30000;         // maximum time without new data of an answer
const kSmallFile = 64 * 1024;     // files up to this size are fetched completely
const kMaxWholeBytes = 64 << 20;  // limit for complete files in memory; the newest may exceed it
const kMaxRequests = 6;           // maximum number of concurrent requests

export class PackageFiles {
  // `base` is the URL of the folder of the package. It must end with a slash.
  constructor(base) {
    this.base = base;
    this.timeoutMs = kTimeoutMs;
    this.hasRanges = true;         // false after a wrong answer to a range request
    this.rangesAreProven = false;  // true after a range had the right header field or contents
    this.whole = new Map();        // complete files: name -> promise of bytes, in order of use
    this.wholeBytes = 0;
    this.fetchedBytes = 0;
    this.requestCount = 0;
    this.running = 0;
    this.waiting = [];
  }

  // Resolves to the text of a file. The file may change on the server, so the browser must not use
  // a cached copy without asking the server.
  async text(name, signal) {
    const {bytes} = await this.request(name, {cache: "no-cache", signal});
    return new TextDecoder().decode(bytes);
  }

  // Resolves to the bytes [offset, offset + length) of the file {name, bytes}. Throws TileError.
  async read(file, offset, length, {signal, cache} = {}) {
    const isSmall = file.bytes <= kSmallFile || length === file.bytes;
    if (this.hasRanges && !isSmall && !this.whole.has(file.name)) {
      const part = await this.readRange(file, offset, length, {signal, cache});
      if (part) return part;
    }
    if (cache === "reload") this.forget(file.name);
    return (await this.readWhole(file, {signal, cache})).subarray(offset, offset + length);
  }

  // Resolves to a range of a file, fetched by a range request. Resolves to null if the server does
  // not answer with this range.
  async readRange(file, offset, length, {signal, cache}) {
    // Until a range request has succeeded, all other range requests wait for it. Otherwise a server
    // without ranges would answer each of them with the complete file.
    if (!this.rangesAreProven) {
      while (this.probe) await this.probe;
      if (!this.hasRanges) return null;
    }
    const range = `bytes=${offset}-${offset + length - 1}`;
    const reads = this.request(file.name, {headers: {Range: range}, cache, signal});
    if (!this.rangesAreProven) this.probe = reads.then(() => {}, () => {});
    let answer = null;
    try {
      answer = await reads;
    } catch (error) {
      // These errors can mean that the server, a proxy, or the rules for other origins (CORS)
      // reject range requests. Then all files are fetched completely.
      const isRefused = error.status === 416 || (error.status === 0 && !error.timedOut);
      if (!isRefused || this.rangesAreProven || signal?.aborted) throw error;
    } finally {
      this.probe = null;
    }
    if (answer?.status === 206 && isRange(answer, file, offset, length)) {
      if (answer.range !== null) this.rangesAreProven = true;
      answer.bytes.isRange = true;
      return answer.bytes;
    }
    this.hasRanges = false;
    if (answer?.status === 200 && answer.bytes.length === file.bytes)
      this.remember(file, Promise.resolve(answer.bytes));
    return null;
  }

  async readWhole(file, options) {
    const known = this.whole.get(file.name);
    if (known) {
      this.whole.delete(file.name);
      this.whole.set(file.name, known);
      return known;
    }
    const reads = this.request(file.name, options).then(({bytes}) => {
      if (bytes.length === file.bytes) return bytes;
      throw new TileError(200, `${file.name} has ${bytes.length} bytes; expected ${file.bytes}.`);
    });
    reads.catch(() => this.forget(file.name));
    this.remember(file, reads);
    return reads;
  }

  remember(file, reads) {
    reads.fileBytes = file.bytes;
    this.whole.set(file.name, reads);
    this.wholeBytes += file.bytes;
    for (const name of this.whole.keys()) {
      if (this.wholeBytes <= kMaxWholeBytes || name === file.name) break;
      this.forget(name);
    }
  }

  forget(name) {
    const reads = this.whole.get(name);
    if (!reads) return;
    this.whole.delete(name);
    this.wholeBytes -= reads.fileBytes;
  }

  // Fetches a file. Resolves to {status, range, bytes} of a successful answer; `range` is the
  // header field Content-Range, or null. Throws TileError.
  async request(name, {headers, cache, signal} = {}) {
    while (this.running >= kMaxRequests) await new Promise((resolve) => this.waiting.push(resolve));
    this.running++;
    this.requestCount++;
    try {
      return await this.fetchBytes(name, headers, cache, signal);
    } finally {
      this.running--;
      this.waiting.shift()?.();
    }
  }

  async fetchBytes(name, headers, cache, signal) {
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
      response = await fetch(this.base + name, {headers, cache, signal: ending.signal});
      const bytes = await bodyOf(response, heard);
      this.fetchedBytes += Number(response.headers.get("Content-Length")) || bytes.length;
      if (!response.ok)
        throw new TileError(response.status, `The server answered ${response.status} for ${name}.`);
      return {status: response.status, range: response.headers.get("Content-Range"), bytes};
    } catch (error) {
      if (error instanceof TileError) throw error;
      const detail =
          response ? `The server stopped in the middle of ${name}.` : "The server does not answer.";
      throw new TileError(0, detail, {timedOut});
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener("abort", end);
    }
  }
}

// True if the answer has the length and, as far as known, the position of the requested range. A
// server of another origin may hide Content-Range; then the checksums of the blocks detect a wrong
// range.
function isRange({range, bytes}, file, offset, length) {
  return bytes.length === length &&
      (range === null || range === `bytes ${offset}-${offset + length - 1}/${file.bytes}`);
}

async function bodyOf(response, heard) {
  const reader = response.body?.getReader(), parts = [];
  let length = 0;
  while (reader) {
    const {done, value} = await reader.read();
    if (done) break;
    heard();
    parts.push(value);
    length += value.length;
  }
  const bytes = new Uint8Array(length);
  length = 0;
  for (const part of parts) {
    bytes.set(part, length);
    length += part.length;
  }
  return bytes;
}
