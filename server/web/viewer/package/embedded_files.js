// Reads the files of a package from the page itself, into which `voxdag publish --single-file` has
// written them. Has the same functions as PackageFiles.

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
  element.remove();  // frees the memory of the text
  return Uint8Array.from(text, (character) => character.charCodeAt(0));
}
