// The arrays of a .glb file: their bufferViews and accessors, in the order of the BIN chunk. Array
// i is accessor i.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>

namespace voxdag {

struct GlbArrays {
  nlohmann::json views = nlohmann::json::array(), accessors = nlohmann::json::array();
  uint64_t offset = 0;  // size of the BIN chunk so far

  // Adds an array. `padded_bytes` is its size in the file, a multiple of 4. `target` is the
  // "target" of its bufferView, or 0 if the view has none.
  void add(uint64_t bytes, uint64_t padded_bytes, int target, nlohmann::json accessor) {
    accessor["bufferView"] = views.size();
    add_view(bytes, padded_bytes, target);
    accessors.push_back(std::move(accessor));
  }
  // Adds bytes without an accessor, such as an image.
  void add_view(uint64_t bytes, uint64_t padded_bytes, int target = 0) {
    nlohmann::json view = {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}};
    if (target) view["target"] = target;
    views.push_back(std::move(view));
    offset += padded_bytes;
  }
};

inline constexpr int kGlbFloat = 5126, kGlbUint32 = 5125, kGlbUint16 = 5123,
                     kGlbUint8 = 5121;                           // componentType
inline constexpr int kGlbVertices = 34962, kGlbIndices = 34963;  // target of a bufferView

}  // namespace voxdag
