// count_voxels FILE.vdag: reads the file into memory, and prints three numbers: the voxels
// according to its header, the voxels found in its DAG, and the bricks without a color.
// portable_test.py compiles this program without exceptions, also for Windows.
#define VOXDAG_READER_NO_EXCEPTIONS
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "voxdag_reader.h"

namespace {

struct Counter {
  const voxdag_reader::File& file;
  unsigned long long voxels = 0, uncolored = 0;

  void visit(uint32_t level, uint64_t offset, int64_t x, int64_t y, int64_t z) {
    if (level < file.brick_level()) {
      const voxdag_reader::Node node = file.node(level, offset);
      const int64_t half = file.resolution() >> (level + 1);
      for (int i = 0; i < 8; ++i)
        if (node.child_mask >> i & 1)
          visit(level + 1, voxdag_reader::File::child(node, i), x + (i & 4 ? half : 0),
                y + (i & 2 ? half : 0), z + (i & 1 ? half : 0));
      return;
    }
    for (uint64_t mask = file.brick(offset); mask != 0; mask &= mask - 1) ++voxels;
    if (!file.color(x / 4, y / 4, z / 4, file.brick_level())) ++uncolored;
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  voxdag_reader::error_handler = [](voxdag_reader::Problem problem, const char* message) {
    std::printf("problem %d: %s\n", static_cast<int>(problem), message);
    std::fflush(stdout);
    std::_Exit(3);
  };
  std::FILE* const file = std::fopen(argv[1], "rb");
  if (!file) return 2;
  std::vector<uint64_t> words;
  uint64_t word = 0, size = 0;
  while (const size_t count = std::fread(&word, 1, sizeof(word), file)) {
    words.push_back(word);
    size += count;
  }
  std::fclose(file);
  const voxdag_reader::File dag(words.data(), size, "packed.vdag");
  Counter counter{dag};
  if (!dag.empty()) counter.visit(0, 0, 0, 0, 0);
  // If the bytes in memory are not aligned, the reader makes an aligned copy.
  std::vector<unsigned char> unaligned(static_cast<size_t>(size) + 1);
  std::memcpy(unaligned.data() + 1, words.data(), static_cast<size_t>(size));
  const voxdag_reader::File copied(unaligned.data() + 1, size);
  const voxdag_reader::File opened(argv[1]);
  copied.verify_checksums();
  opened.verify_checksums();
  if (opened.voxels() != dag.voxels() || copied.voxels() != dag.voxels()) return 1;
  std::printf("%llu %llu %llu\n", static_cast<unsigned long long>(dag.voxels()), counter.voxels,
              counter.uncolored);
  return 0;
}
