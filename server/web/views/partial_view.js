// Shows the subvolumes that a running job has built. Each subvolume is drawn as the occupied cells
// of its coarse brick, a mask of 4x4x4 cells that divide the subvolume.

import {CubesView} from "./cubes_view.js";

const kMaxDetailed = 1500;  // with more subvolumes, they are drawn as plain cubes

export class PartialView extends CubesView {
  setEmpty(empty) {
    super.setEmpty(empty);
    if (!empty) this.element.hidden = false;
  }

  sayWhyEmpty(ended, known) {
    super.sayWhyEmpty(ended, known);
    this.element.hidden = ended;
  }

  // `cubes` comes from the service. Each entry is [x, y, z, edge, low, high]: the low corner and
  // edge of a subvolume in voxels, and the low and high 32 bits of its coarse brick.
  show({resolution, built, total, cubes}) {
    const parts = cubes.length <= kMaxDetailed ? cubes.flatMap(cellsOf) :
                                                 cubes.map(([x, y, z, edge]) => [x, y, z, edge, 1]);
    super.show({resolution, built, total, cubes: parts});
  }
}

// Returns the occupied cells of a subvolume, each as a built cube for CubesView.show(). The 64 bits
// of a coarse brick are in the order of docs/format.md.
function cellsOf([x, y, z, edge, ...halves]) {
  const cells = [];
  for (let bit = 0; bit < 64; ++bit) {
    if (!(halves[bit >> 5] >>> (bit & 31) & 1)) continue;
    const along = (axis) => (2 * (bit >> 5 - axis & 1) + (bit >> 2 - axis & 1)) * edge / 4;
    cells.push([x + along(0), y + along(1), z + along(2), edge / 4, 1]);
  }
  return cells;
}
