// Prints the digest of all voxels of a file:
//
//     digest_voxels vdag|faces FILE.vdag [X0 Y0 Z0 X1 Y1 Z1]
//     digest_voxels FORMAT FILE ORIGIN_X ORIGIN_Y ORIGIN_Z VOXEL LEVELS
//
// vdag and faces read the file with voxdag_reader.h. With a region, they use only the voxels in the
// region. `faces` counts the faces between voxels and empty cells, which are the contents of a glb
// file. Prints the number of voxels or faces, and the hashes. The exit status is 1 for a file that
// breaks its format, 2 for a format without a decoder.
#include <algorithm>

#include "core/format/global/voxdag_reader.h"
#include "tests/export/whole/formats.h"

namespace voxdag::test {
namespace {

using voxdag_reader::File;

struct Walk {
  const File& file;
  std::array<int64_t, 3> low, high;
  bool faces;
  Digest& digest;

  bool node(uint32_t level, int64_t x, int64_t y, int64_t z, uint64_t) const {
    const int64_t edge = file.resolution() >> level;
    return x < high[0] && y < high[1] && z < high[2] && x + edge > low[0] && y + edge > low[1] &&
           z + edge > low[2];
  }
  void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) const {
    const auto in_brick = [&](int64_t i, int64_t j, int64_t k) {
      return (mask >> File::brick_bit(i, j, k) & 1) != 0;
    };
    for (int64_t i = 0; i < 4; ++i)
      for (int64_t j = 0; j < 4; ++j)
        for (int64_t k = 0; k < 4; ++k) {
          if (!in_brick(i, j, k) || !inside(x + i, y + j, z + k)) continue;
          if (!faces) {
            digest.add(x + i, y + j, z + k);
            continue;
          }
          for (uint64_t face = 0; face < 6; ++face) {
            std::array<int64_t, 3> next = {i, j, k};
            next[face / 2] += face % 2 ? 1 : -1;
            const bool near = ((next[0] | next[1] | next[2]) & ~int64_t{3}) == 0;
            const auto [a, b, c] = next;
            if (!inside(x + a, y + b, z + c) ||
                !(near ? in_brick(a, b, c) : file.voxel(x + a, y + b, z + c)))
              digest.add(x + i, y + j, z + k, 1 + face);
          }
        }
  }
  bool inside(int64_t x, int64_t y, int64_t z) const {
    return x >= low[0] && x < high[0] && y >= low[1] && y < high[1] && z >= low[2] && z < high[2];
  }
};

void digest_vdag(const File& file, bool faces, int numbers, char** number, Digest& digest) {
  Walk walk{file, {0, 0, 0}, {}, faces, digest};
  walk.high.fill(file.resolution());
  if (numbers == 6)
    for (int i = 0; i < 6; ++i)
      (i < 3 ? walk.low : walk.high)[static_cast<size_t>(i % 3)] = std::atoll(number[i]);
  file.walk(walk);
}

constexpr struct {
  const char* name;
  void (*digest)(const std::string& path, const Grid& grid, Digest& digest);
} kFormats[] = {
    {"bt", digest_bt},           {"ply", digest_ply},     {"npz", digest_npz},
    {"hashdag", digest_hashdag}, {"svdag", digest_svdag}, {"voxel", digest_voxel},
    {"vox", digest_vox},         {"glb", digest_glb},
#ifdef VOXDAG_HAS_OPENVDB
    {"vdb", digest_vdb},
#endif
#ifdef VOXDAG_HAS_NANOVDB
    {"nvdb", digest_nvdb},
#endif
};

int run(int argc, char** argv) {
  const std::string kind = argc > 2 ? argv[1] : "";
  Digest digest;
  if (kind == "vdag" || kind == "faces") {
    digest_vdag(File(argv[2]), kind == "faces", argc - 3, argv + 3, digest);
  } else {
    const auto* const format =
        std::ranges::find_if(kFormats, [&](const auto& known) { return kind == known.name; });
    if (format == std::end(kFormats) || argc != 8) return 2;
    format->digest(argv[2],
                   {{std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5])},
                    std::atof(argv[6]),
                    std::atoi(argv[7])},
                   digest);
  }
  digest.print();
  return 0;
}

}  // namespace
}  // namespace voxdag::test

int main(int argc, char** argv) { return voxdag::test::run(argc, argv); }
