// JSON text being written in slices: each a whole object of its own that holds some elements of the
// root's arrays, small enough that a parser needs little memory for one at a time.
//
//   {"nodes":[{...},{...}]}   {"nodes":[{...}],"scenes":[...]}
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"

namespace voxdag::gltf {

struct JsonSlice {
  std::string text;
  uint64_t object_count = 0;
  uint64_t value_count = 0;  // objects and arrays included
};

class JsonSlices {
 public:
  // Texts are charged to `budget` under `what`.
  JsonSlices(MemoryBudget& budget, const std::string& what);

  // Inside an object, `key` is the value's name; elsewhere it is null.
  void value(const std::string* key, std::string_view text);
  void open(const std::string* key, char bracket);
  void close(char bracket);
  // Between two elements of the root's array `section`: begins a new slice if this one is large.
  void may_cut(const std::string& section);

  const std::vector<JsonSlice>& all() const { return slices_; }

 private:
  void charge_text();

  std::vector<JsonSlice> slices_;
  MemoryCharge charge_;
  std::string what_;
  uint64_t finished_bytes_ = 0;  // of all slices but the last
  bool separator_due_ = false;
};

}  // namespace voxdag::gltf
