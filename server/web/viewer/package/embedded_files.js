// The files of a package that are part of the page itself (`voxdag publish --single-file`). Has the
// functions of PackageFiles.

import {TileError} from "../tile_source.js";

export class EmbeddedFiles {
  constructor() {
    this.timeoutMs = Infinity;
    this.hasRanges = false;
    this.rangesAreProven = false;
    this.fetchedBytes = 0;
    this.requestCount = 0;
    this.decoded = new Map();  // name -> bytes
  }

  async text(name) {
    return new TextDecoder().decode(this.bytesOf(name));
  }

  async read({name}, offset, length) {
    return this.bytesOf(name).subarray(offset, offset + length);
  }

  bytesOf(name) {
    if (!this.decoded.has(name)) this.decoded.set(name, decode(name));
    return this.decoded.get(name);
  }
}

function decode(name) {
  const element = document.querySelector(`script[data-file="${CSS.escape(name)}"]`);
  if (!element) throw new TileError(404, `The page does not contain ${name}.`);
  const text = atob(element.textContent);
  element.remove();  // the bytes replace the text in memory
  return Uint8Array.from(text, (character) => character.charCodeAt(0));
}
