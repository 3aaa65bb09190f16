// octomap_leaves FILE.bt: reads the file with OctoMap's own library. Writes for each leaf, as
// 32-bit integers: the x, y, z keys (OctoMap's integer coordinates) of its low corner, its edge,
// and whether it is occupied. Tests compare exports with this output.
#include <octomap/OcTree.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  octomap::OcTree tree(1);
  if (!tree.readBinary(std::string(argv[1]))) return 1;
  std::ifstream file(argv[1], std::ios::binary);
  std::string word;
  while (file >> word && word != "size") {
  }
  size_t size = 0;
  if (!(file >> size) || size != tree.size()) {
    std::fprintf(stderr, "the header says %zu nodes, but there are %zu\n", size, tree.size());
    return 1;
  }
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    const octomap::OcTreeKey key = leaf.getIndexKey();
    const int32_t numbers[] = {key[0], key[1], key[2], 1 << (16 - leaf.getDepth()),
                               tree.isNodeOccupied(*leaf)};
    std::fwrite(numbers, sizeof(numbers), 1, stdout);
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}
