#include "query/attributes/material_names.h"

#include <map>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "core/color/cell_values.h"
#include "core/format/color/color_layout.h"

namespace voxdag::query {
namespace {

// Counts how often each name has occurred.
class Occurrences {
 public:
  // Returns the name, and the number of earlier calls with this name.
  std::pair<std::string_view, uint32_t> next(std::string_view name) {
    return {name, counts_[name]++};
  }

 private:
  std::map<std::string_view, uint32_t> counts_;
};

}  // namespace

JoinedNames join_names(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  JoinedNames joined;
  joined.names.assign(a.begin(), a.end() - 1);
  std::map<std::pair<std::string_view, uint32_t>, uint32_t> known;
  Occurrences in_a, in_b;
  for (uint32_t i = 0; i + 1 < a.size(); ++i) known[in_a.next(a[i])] = i;
  for (uint32_t i = 0; i + 1 < b.size(); ++i) {
    const auto [at, is_new] =
        known.try_emplace(in_b.next(b[i]), static_cast<uint32_t>(joined.names.size()));
    if (is_new) joined.names.push_back(b[i]);
    joined.b.push_back(at->second);
  }
  joined.b.push_back(static_cast<uint32_t>(joined.names.size()));
  joined.names.emplace_back();
  if (joined.names.size() > color_layout::kMaxMaterials ||
      list_bytes(joined.names) > color_layout::kMaxNamesBytes)
    throw Error(ErrorCode::kLimit, "the files together have " +
                                       std::to_string(joined.names.size()) +
                                       " materials: expected at most 2^20 materials with names of "
                                       "64 MiB in total");
  return joined;
}

}  // namespace voxdag::query
