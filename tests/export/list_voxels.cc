// list_voxels FILE SHIFT [colors]: writes the x, y, z of the voxels of a .vdag file, shifted
// right by SHIFT bits, to standard output as 32-bit integers. With `colors`, it also writes the
// color of the cell with these coordinates as red * 65536 + green * 256 + blue. Tests compare
// exports with this output. The program uses the standalone reader and shares no code with the
// exports.
#include <cstdio>
#include <cstdlib>

#include "core/format/global/voxdag_reader.h"

namespace {

struct Lister {
  int shift;
  voxdag_reader::ColorCursor* colors;
  uint32_t level;
  static bool node(uint32_t, int64_t, int64_t, int64_t, uint64_t) { return true; }
  void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) const {
    for (int64_t i = 0; i < 4; ++i)
      for (int64_t j = 0; j < 4; ++j)
        for (int64_t k = 0; k < 4; ++k)
          if (mask >> voxdag_reader::File::brick_bit(i, j, k) & 1) {
            const int32_t voxel[] = {static_cast<int32_t>((x + i) >> shift),
                                     static_cast<int32_t>((y + j) >> shift),
                                     static_cast<int32_t>((z + k) >> shift)};
            std::fwrite(voxel, sizeof(voxel), 1, stdout);
            if (!colors) continue;
            const auto color = colors->color(voxel[0], voxel[1], voxel[2], level);
            if (!color) std::exit(1);
            const int32_t packed = color->r << 16 | color->g << 8 | color->b;
            std::fwrite(&packed, sizeof(packed), 1, stdout);
          }
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) return 2;
  const voxdag_reader::File file(argv[1]);
  const int shift = std::atoi(argv[2]);
  voxdag_reader::ColorCursor colors(file);
  file.walk(Lister{shift, argc == 4 ? &colors : nullptr,
                   file.grid_levels() - static_cast<uint32_t>(shift)});
  return std::fflush(stdout) == 0 ? 0 : 1;
}
