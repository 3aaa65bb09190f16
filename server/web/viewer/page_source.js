// The source of tiles of a page that shows no job. Pages of `voxdag publish` set a source before
// they load the other modules; all other pages use the server of `voxdag view`.

import {TileSource} from "./tile_source.js";

let makePublished = null;

// Makes the page use the sources that makeSource() returns.
export function setPublished(makeSource) {
  makePublished = makeSource;
}

// True if `voxdag publish` has written the page.
export function isPublished() {
  return makePublished !== null;
}

export function sourceOfPage(headers = {}) {
  return makePublished ? makePublished() : new TileSource({base: "/api/v1/view", headers});
}
