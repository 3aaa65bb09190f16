// The source of tiles for a page that does not show a job. A page of `voxdag publish` calls
// setPublished() before it loads the other modules. All other pages read tiles from the server of
// `voxdag view`.

import {TileSource} from "./tile_source.js";

let makePublished = null;

// Makes sourceOfPage() return makeSource(), the source of a package.
export function setPublished(makeSource) {
  makePublished = makeSource;
}

// True if the page shows a package of `voxdag publish`.
export function isPublished() {
  return makePublished !== null;
}

export function sourceOfPage(headers = {}) {
  return makePublished ? makePublished() :
                         new TileSource({base: "/api/v1/view", headers, isJob: false});
}
