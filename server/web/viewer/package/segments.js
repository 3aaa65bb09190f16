// Reads parts of files in segments of 32 KiB. The blocks that a view needs are close together in a
// pack, but the view does not need all of them at the same time. So the segments of the first
// blocks usually contain later blocks too, which need no further requests.

import {PromiseCache} from "./promise_cache.js";

const kSegmentBytes = 32 * 1024;
const kMaxGap = 4;               // maximum number of unneeded segments between two of one request
const kMaxRequestSegments = 32;  // maximum number of segments of one request
const kMaxCachedBytes = 16 << 20;

export class Segments {
  // `files` is a PackageFiles, or an object with the same functions.
  constructor(files) {
    this.files = files;
    // Segments that are loading or are from range requests. Complete files are not kept here,
    // because PackageFiles keeps them.
    this.loaded = new PromiseCache(kMaxCachedBytes);
  }

  // Begins to read the `places`, {file, offset, bytes}. Returns a promise of the bytes of each
  // place. With options.cache === "reload", does not use known segments. The property `isRange` of
  // the bytes is true if they are from the answers to range requests.
  read(places, options) {
    if (options.cache === "reload") places.forEach((place) => this.forget(place));
    const missing = new Map();
    for (const segment of places.flatMap(segmentsOf))
      if (!this.loaded.get(segment.key)) missing.set(segment.key, segment);
    for (const run of this.runsOf([...missing.values()])) this.fetch(run, options);
    const reads = places.map(
        (place) => joined(place, segmentsOf(place).map(({key}) => this.loaded.get(key))));
    this.loaded.evict();
    return reads;
  }

  // Removes the segments of a place.
  forget(place) {
    for (const {key} of segmentsOf(place)) this.loaded.delete(key);
  }

  // Fetches the segments first to last of a file with one request.
  fetch({file, first, last}, options) {
    const begin = first * kSegmentBytes, end = Math.min(file.bytes, (last + 1) * kSegmentBytes);
    const reads = this.files.read(file, begin, end - begin, options);
    for (let index = first; index <= last; ++index) {
      const at = (index - first) * kSegmentBytes;
      this.loaded.add(
          keyOf(file, index), reads.then((bytes) => partOf(bytes, at)),
          ({length, isRange}) => isRange ? length : 0);
    }
  }

  // Divides segments that are not loaded into runs {file, first, last}, each for one request. The
  // segments of a run are close together in one file, and none between them is loaded.
  runsOf(segments) {
    segments.sort((a, b) => a.file.name.localeCompare(b.file.name) || a.index - b.index);
    const runs = [];
    for (const {file, index} of segments) {
      const run = runs.at(-1);
      if (run?.file === file && index - run.first < kMaxRequestSegments &&
          this.isGap(file, run.last + 1, index))
        run.last = index;
      else runs.push({file, first: index, last: index});
    }
    return runs;
  }

  // True if the segments begin to end - 1 are few, and none of them is loaded.
  isGap(file, begin, end) {
    if (end - begin > kMaxGap) return false;
    for (let index = begin; index < end; ++index)
      if (this.loaded.has(keyOf(file, index))) return false;
    return true;
  }
}

const keyOf = (file, index) => `${file.name}:${index}`;

// Returns the segments of a place, as a list of {key, file, index}.
function segmentsOf({file, offset, bytes}) {
  const first = Math.floor(offset / kSegmentBytes);
  const last = Math.max(first, Math.floor((offset + bytes - 1) / kSegmentBytes));
  return Array.from({length: last - first + 1}, (_, i) => {
    const index = first + i;
    return {key: keyOf(file, index), file, index};
  });
}

// Returns the segment that begins at the offset `at` of `bytes`. A segment of a range is a copy, so
// that it does not keep the memory of the complete answer.
function partOf(bytes, at) {
  const end = at + kSegmentBytes;
  const part = bytes.isRange ? bytes.slice(at, end) : bytes.subarray(at, end);
  part.isRange = bytes.isRange;
  return part;
}

// Resolves to the bytes of a place. `segments` are the promises of its segments.
async function joined({offset, bytes}, segments) {
  const parts = await Promise.all(segments);
  const from = offset % kSegmentBytes;
  const isRange = parts.every((part) => part.isRange);
  let all = parts[0];
  if (parts.length > 1) {
    all = new Uint8Array(parts.reduce((sum, {length}) => sum + length, 0));
    parts.forEach((part, i) => all.set(part, i * kSegmentBytes));
  }
  const result = all.subarray(from, from + bytes);
  result.isRange = isRange;
  return result;
}
