// Reads STL files. The first byte of an input selects one of three forms of the rest: the
// statements of an ASCII file after its first two lines, a binary file whose size and number of
// facets are corrected to agree, or a file without changes.
#include <algorithm>

#include "tests/fuzz/support/scene_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  std::string rest(reinterpret_cast<const char*>(data + 1), size - 1);
  if (data[0] % 3 == 0) {
    rest = "solid a\nfacet normal 0 0 1\n" + rest;
  } else if (data[0] % 3 == 1 && rest.size() >= 84) {
    const size_t facets = std::min<size_t>((rest.size() - 84) / 50, 255);
    rest.resize(84 + 50 * facets);
    rest.replace(80, 4, {static_cast<char>(facets), '\0', '\0', '\0'});
  }
  voxdag::fuzz::check_scene(rest);
  return 0;
}
