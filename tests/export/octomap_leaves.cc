// octomap_leaves FILE.bt: writes, for each leaf that OctoMap's own library finds, the x, y, z of
// its low corner (as keys), its edge, and whether it is occupied, as 32-bit integers.
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
