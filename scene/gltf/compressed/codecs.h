// The two decoders of compressed geometry. Each is there if voxdag was built with its library;
// otherwise documents that need it are refused before anything is decoded.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "core/base/memory_budget.h"
#include "scene/gltf/document/compression.h"

namespace voxdag::gltf {

// Data that break their format. The message does not name the file.
struct BrokenData {
  std::string message;
};

// Decodes into `out` of view.decoded_bytes(). Throws BrokenData.
void decode_meshopt(const MeshoptView& view, std::span<const std::byte> compressed,
                    std::span<std::byte> out);

// Hands the decoded bytes of a part to `write`, from the first to the last. The decoder's memory is
// charged to `charge` before it is allocated, and what it frees stays charged. `compressed` is
// overwritten. Throws BrokenData, or Error{kOutOfMemory} for a part that does not fit the budget.
void decode_draco(const DracoPart& part, std::span<std::byte> compressed, MemoryCharge& charge,
                  const std::function<void(std::span<const std::byte>)>& write);

}  // namespace voxdag::gltf
