// The names that the usemtl statements of an OBJ file use, numbered in the order of their first
// use. Number 0 is the name "", the material of faces before any usemtl.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <unordered_map>

#include "core/base/memory_budget.h"
#include "scene/growing_charge.h"

namespace voxdag::obj {

class UsedMaterials {
 public:
  struct Use {
    std::string name;
    uint64_t line = 0;   // number of the first line that uses the name
    uint64_t faces = 0;  // number of faces with this material
    // Number of these faces with a corner whose texture coordinates are missing or do not exist.
    uint64_t faces_without_texture = 0;
  };

  UsedMaterials(MemoryBudget& budget, const std::string& path)
      : charge_(budget, "the material names of " + path) {
    add("", 0);
  }

  // Returns the number of a name. Adds the name if it is new.
  uint32_t add(std::string_view name, uint64_t line) {
    const auto known = numbers_.find(name);
    if (known != numbers_.end()) return known->second;
    charge_.add(name.size() + sizeof(Use) + kNodeBytes);
    uses_.push_back({std::string(name), line});
    return numbers_[uses_.back().name] = static_cast<uint32_t>(uses_.size()) - 1;
  }
  // Returns the number of a name that has been added; 0 for any other.
  uint32_t number_of(std::string_view name) const {
    const auto known = numbers_.find(name);
    return known == numbers_.end() ? 0 : known->second;
  }
  std::deque<Use>& all() { return uses_; }
  const std::deque<Use>& all() const { return uses_; }

 private:
  static constexpr uint64_t kNodeBytes = 64;  // bytes of a hash table's node

  GrowingCharge charge_;
  std::deque<Use> uses_;
  std::unordered_map<std::string_view, uint32_t> numbers_;  // keys are the names in uses_
};

}  // namespace voxdag::obj
