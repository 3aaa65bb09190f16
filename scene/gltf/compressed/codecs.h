// The two decoders of compressed geometry. If voxdag was built without a decoder's library,
// check_compressed() refuses documents that need this decoder before anything is decoded.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "core/base/memory_budget.h"
#include "scene/gltf/document/compression.h"

namespace voxdag::gltf {

// Thrown for compressed data that violate their format. The message does not name the file.
struct BrokenData {
  std::string message;
};

// Maximum number of triangles that a strip may declare per Draco face. A strip declares more
// triangles than it has faces, because it counts the degenerate triangles that join its pieces.
constexpr uint64_t kMaxStripTrianglesPerFace = 8;

// Decodes a meshopt view. `out` must have view.decoded_bytes() bytes. Throws BrokenData.
void decode_meshopt(const MeshoptView& view, std::span<const std::byte> compressed,
                    std::span<std::byte> out);

// Passes the decoded bytes of a part to `write`, from first to last. If the part declares more
// vertices than the data have, the surplus vertices are zeros. Charges the decoder's memory
// to `charge` before it is allocated, and does not reduce the charge afterwards. Overwrites
// `compressed`. Throws BrokenData, or Error{kOutOfMemory} for a part that does not fit the budget.
void decode_draco(const DracoPart& part, std::span<std::byte> compressed, MemoryCharge& charge,
                  const std::function<void(std::span<const std::byte>)>& write);

// Decodes only the connectivity and returns the number of vertices. Errors, memory and `compressed`
// are as in decode_draco().
uint64_t count_draco_vertices(std::span<std::byte> compressed, MemoryCharge& charge);

}  // namespace voxdag::gltf
