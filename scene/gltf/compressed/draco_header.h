// The head of Draco data of a mesh (Draco bitstream 2.2): what says how much memory the decoder
// will take, read before it is called.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxdag::gltf {

struct DracoHeader {
  bool is_edgebreaker = false;  // else the faces are stored one after the other
  uint64_t faces = 0;
  // Attributes whose values are shared by fewer corners than positions are, each with a table of
  // its own; edgebreaker only.
  uint64_t attribute_tables = 0;
  // Where data without metadata begin: the header was moved there, past the metadata.
  size_t begin = 0;
};

// Throws BrokenData. Moves the header of data that have metadata, which no vertex depends on.
DracoHeader read_draco_header(std::span<std::byte> data);

}  // namespace voxdag::gltf
