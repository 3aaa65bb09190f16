// Joins the lists of materials of two files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace voxdag::query {

// `names` is the list of the combined file. b[i] is the index in `names` of material i of the
// second file. The materials of the first file keep their indices, except that its last material,
// which stands for surfaces without a material, is the last of `names`: it has the index
// names.size() - 1.
struct JoinedNames {
  std::vector<std::string> names;
  std::vector<uint32_t> b;
};

// Materials with the same name become one material. If a list has a name several times, the first
// occurrences in both lists are joined, then the second ones, and so on. Both lists end with the
// material of surfaces without a material. Throws Error{kLimit} if the list would be too long for
// the file.
JoinedNames join_names(const std::vector<std::string>& a, const std::vector<std::string>& b);

}  // namespace voxdag::query
