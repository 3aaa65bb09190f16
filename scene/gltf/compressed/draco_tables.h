// The tables of Draco's entropy decoder, 12 bytes for each symbol of an alphabet and up to 4 MiB in
// addition. A byte of compressed data can declare 64 symbols, so that a file of 1 MiB can ask for
// 768 MiB in the middle of being decoded, which no header says. While a DracoTables exists, what
// this thread decodes charges its tables before they are allocated; the linker puts our function
// before Draco's (--wrap in CMakeLists.txt).
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"

namespace voxdag::gltf {

class DracoTables {
 public:
  explicit DracoTables(MemoryCharge& charge);
  DracoTables(const DracoTables&) = delete;
  DracoTables& operator=(const DracoTables&) = delete;
  ~DracoTables();

  // What the charge would have had to be for tables that did not fit the budget, with which
  // decoding has failed; 0 if all did.
  uint64_t refused_bytes() const { return refused_bytes_; }
  // Whether `bytes` fit the budget in addition to what is charged. They are charged until
  // release().
  bool admit(uint64_t bytes);
  void release();

 private:
  MemoryCharge& charge_;
  uint64_t bytes_before_ = 0, refused_bytes_ = 0;
};

}  // namespace voxdag::gltf
