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
  // Number of vertices. Edgebreaker counts the vertices at one position once, even if the faces
  // there give them different values of other attributes. The decoded mesh then has several
  // vertices at this position.
  uint64_t vertices = 0;
  // Number of attributes that have their own connectivity table. An attribute needs one if corners
  // with the same position can have different values of it. Edgebreaker only.
  uint64_t attribute_tables = 0;
  // Offset at which Draco's decoder must begin: 0 if the data have no metadata. Otherwise
  // read_draco_header() has overwritten the last bytes of the metadata with a copy of the header,
  // and `begin` is the offset of this copy.
  size_t begin = 0;
};

// Reads the header. Removes the metadata from `data` (see `begin`), because voxdag does not use it.
// Throws BrokenData.
DracoHeader read_draco_header(std::span<std::byte> data);

}  // namespace voxdag::gltf
