// Keeps promises of data until their data exceeds a limit of memory.

export class PromiseCache {
  constructor(maxBytes) {
    this.maxBytes = maxBytes;
    this.promises = new Map();  // key -> promise, in order of use
    this.bytes = 0;             // size of the data of the promises that are resolved
  }

  // Returns the promise of a key, and makes it the most recently used one; undefined if there is
  // none.
  get(key) {
    const loads = this.promises.get(key);
    if (loads) {
      this.promises.delete(key);
      this.promises.set(key, loads);
    }
    return loads;
  }

  has(key) {
    return this.promises.has(key);
  }

  // Adds a promise. sizeOf(data) must return the size of its data in bytes; the promise is removed
  // if this is 0, or if the promise is rejected.
  add(key, loads, sizeOf) {
    this.promises.set(key, loads);
    const finish = (byteSize) => {
      if (this.promises.get(key) !== loads) return;
      loads.byteSize = byteSize;
      this.bytes += byteSize;
      if (byteSize === 0) this.delete(key);
    };
    loads.then((data) => finish(sizeOf(data)), () => finish(0));
  }

  delete(key) {
    this.bytes -= this.promises.get(key)?.byteSize ?? 0;
    this.promises.delete(key);
  }

  // Removes the least recently used promises until the data of the remaining ones is within the
  // limit. Keeps promises that are still loading, because the size of their data is unknown.
  evict() {
    for (const [key, {byteSize}] of this.promises) {
      if (this.bytes <= this.maxBytes) return;
      if (byteSize) this.delete(key);
    }
  }
}
