// list_voxels FILE SHIFT: writes x, y, z of the voxels of a .vdag file, shifted right by SHIFT
// bits, to the standard output as 32-bit integers. What exports are compared with: it shares
// nothing with them but the file, which it reads with the standalone reader.
#include <cstdio>
#include <cstdlib>

#include "core/format/global/voxdag_reader.h"

namespace {

struct Lister {
  int shift;
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
          }
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const voxdag_reader::File file(argv[1]);
  file.walk(Lister{std::atoi(argv[2])});
  return std::fflush(stdout) == 0 ? 0 : 1;
}
