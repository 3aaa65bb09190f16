// The header of Draco mesh data (bitstream 2.2), read before the decoder runs. Its counts determine
// the decoder's memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxdag::gltf {

struct DracoHeader {
  bool is_edgebreaker = false;  // false: the faces are stored one after another
  bool has_valences = false;    // edgebreaker with one context per vertex valence
  uint64_t faces = 0;
  // Number of vertices. Edgebreaker does not count a position twice if its other attributes differ
  // from face to face, so the decoded mesh can have more.
  uint64_t vertices = 0;
  // Number of attributes with a separate connectivity table, because fewer corners share a value
  // than share a position. Edgebreaker only.
  uint64_t attribute_tables = 0;
  // Offset at which the header begins. If there are metadata, read_draco_header() overwrites their
  // end with a copy of the header.
  size_t begin = 0;
};

// Reads the header, and removes metadata, which does not affect vertices. Throws BrokenData.
DracoHeader read_draco_header(std::span<std::byte> data);

}  // namespace voxdag::gltf
