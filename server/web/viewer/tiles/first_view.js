// Finds the tiles of the first view while the shaders compile, by descending through the loaded
// tiles. The feedback would find the tiles only level by level. The search does not know which
// surfaces are hidden, so it fetches some tiles that are not needed. To limit their number, it does
// not refine cells narrower than kPixels, and it ends after kMaxTiles tiles, or if no tile arrives
// within kStallMs.

const kPixels = 15;  // cells wider than this number of canvas pixels are refined
const kMaxTiles = 1500;
const kStallMs = 1500;                // the search ends if no tile arrives within this time
const kHeadWords = 4, kCutWords = 4;  // in a tile (docs/format.md)

export class FirstView {
  // Searches for the tiles that `view` (gl/view.js) needs in a picture of this size. Cells with an
  // edge of `finest` voxels are not refined. If `isFirst` is given, requests only the tiles for
  // which isFirst({level, offset}) is true.
  constructor({levels}, view, {width, height}, finest, isFirst = () => true) {
    Object.assign(this, {levels, view, finest, isFirst});
    this.pixel = view.pixel(height);
    // Slopes of the sides of the picture: the tangents of half the horizontal and vertical field of
    // view.
    this.slopes = [view.tangent * width / height, view.tangent];
    this.known = new Map();   // key -> words of a tile
    this.places = new Map();  // tile key -> low corners of all cubes that consist of this tile
    this.wanted = new Map();  // texel of a cut-off node -> width in pixels of its widest cell
    this.takenMs = 0;         // time of the last tile
  }

  get isOver() {
    return this.wanted.size === 0 || this.known.size > kMaxTiles;
  }

  // True if no tile has arrived for so long that the search should end.
  stalls(nowMs) {
    return nowMs - this.takenMs > kStallMs;
  }

  begin(store, tile, words) {
    this.places.set(tile.key, [[0, 0, 0]]);
    this.take(store, tile, words);
  }

  // Takes the words of a tile that the store has loaded, and continues the search below the tile.
  take(store, tile, words) {
    this.takenMs = performance.now();
    if (this.known.has(tile.key)) return;
    this.known.set(tile.key, words);
    for (const corner of this.places.get(tile.key) ?? []) this.walk(store, tile, words, corner);
  }

  // Adds to `wanted` the tiles that the view needs below a tile. `corner` is the low corner of the
  // tile's cube; a tile that is shared has several cubes.
  walk(store, tile, words, corner) {
    if ((words[1] >>> 16 & 1) === 1) return;  // bricks
    const leafEdge = 2 ** (this.levels - tile.level - tile.levels), cell = leafEdge / 4;
    if (cell <= this.finest) return;
    const leaves = kHeadWords + words[2];
    const visit = (at, edge, x, y, z, isLeaf) => {
      if (!this.needs(x, y, z, edge, cell)) return;
      if (isLeaf) {
        const from = leaves + at * kCutWords,
              pixels = this.coarsePixels(words[from + 2], words[from + 3], x, y, z, cell);
        if (pixels > kPixels) this.want(store, store.leaf(tile, at), pixels, [x, y, z]);
        return;
      }
      const half = edge / 2;
      for (let child = 0, next = kHeadWords + at + 1, mask = words[kHeadWords + at]; child < 8;
           ++child)
        if (mask >>> child & 1)
          visit(
              words[next++], half, x + half * (child >> 2), y + half * (child >> 1 & 1),
              z + half * (child & 1), half === leafEdge);
    };
    visit(0, 2 ** (this.levels - tile.level), ...corner, false);
  }

  want(store, node, pixels, corner) {
    if (!this.isFirst(node)) return;
    this.wanted.set(node.texel, Math.max(pixels, this.wanted.get(node.texel) || 0));
    const places = this.places.get(node.key);
    if (places) places.push(corner);
    else this.places.set(node.key, [corner]);
    const words = this.known.get(node.key), tile = store.get(node.level, node.offset);
    if (words && tile)
      this.walk(store, tile, words, corner);  // tile is undefined if it was evicted
  }

  // True if a cube is possibly in the picture and the cells in it are wider than kPixels. `cell` is
  // the cells' edge in voxels. A ball around the cube's center contains the cube if its radius is
  // 0.867 (just over √3/2) times the cube's edge.
  needs(x, y, z, edge, cell) {
    return this.pixelsOf(x, y, z, edge, cell) > kPixels &&
        this.isSeen(x + edge / 2, y + edge / 2, z + edge / 2, edge * 0.867);
  }

  // Returns the width in pixels that a cell with the edge `cell` has at the distance of a cube
  // (from the eye to the nearest point of the cube).
  pixelsOf(x, y, z, edge, cell) {
    const [ex, ey, ez] = this.view.eye;
    const far = Math.hypot(
        Math.max(x - ex, 0, ex - x - edge), Math.max(y - ey, 0, ey - y - edge),
        Math.max(z - ez, 0, ez - z - edge));
    return cell / Math.max(far * this.pixel, 1e-9);
  }

  // True if a part of a ball is possibly in the picture.
  isSeen(x, y, z, radius) {
    const {eye, forward, right, up} = this.view, dx = x - eye[0], dy = y - eye[1], dz = z - eye[2];
    const along = (axis) => axis[0] * dx + axis[1] * dy + axis[2] * dz;
    const depth = along(forward);
    return [right, up].every(
        (axis, i) => Math.abs(along(axis)) <=
            depth * this.slopes[i] + radius * Math.hypot(1, this.slopes[i]));
  }

  // Returns the width in pixels of the widest visible cell of a coarse brick.
  coarsePixels(low, high, x, y, z, cell) {
    let most = 0;
    for (let bit = 0; bit < 64; ++bit) {
      if (((bit < 32 ? low : high) >>> (bit & 31) & 1) === 0) continue;
      const cx = x + cell * (bit >> 4 & 2 | bit >> 2 & 1),
            cy = y + cell * (bit >> 3 & 2 | bit >> 1 & 1), cz = z + cell * (bit >> 2 & 2 | bit & 1);
      const pixels = this.pixelsOf(cx, cy, cz, cell, cell);
      if (pixels > most && pixels > kPixels &&
          this.isSeen(cx + cell / 2, cy + cell / 2, cz + cell / 2, cell * 0.867))
        most = pixels;
    }
    return most;
  }
}
