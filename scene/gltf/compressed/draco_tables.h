// Bounds the memory of Draco's entropy decoder before it runs.
//
// The decoder allocates 12 bytes per symbol of an alphabet, and up to 4 MiB in addition. One byte
// of compressed data can declare 64 symbols, so a file of 1 MiB can request 768 MiB in the middle
// of the decoding, without a header that states this size. The functions below go through the data
// as Draco 1.5 does (bitstream 2.2), with Draco's public classes, but skip all data except the
// tables. They throw BrokenData for data that Draco would refuse.
#pragma once

#include <cstdint>
#include <functional>

namespace draco {
class DecoderBuffer;
class MeshDecoder;
}  // namespace draco

namespace voxdag::gltf {

// Called with the memory of each table before it is built. Throws to refuse the table. Draco never
// has more than one table in memory.
using AdmitTable = std::function<void(uint64_t bytes)>;

// Checks the table of a sequential mesh's indices. `at` is the start of its connectivity.
void check_index_tables(const draco::DecoderBuffer& at, const AdmitTable& admit);

// Checks the tables of an edgebreaker mesh with valence coding. `at` is the start of its
// connectivity.
void check_valence_tables(const draco::DecoderBuffer& at, const AdmitTable& admit);

// Returns the number of attributes. `at` is the start of the attribute section; `decoder` has
// decoded the connectivity.
uint64_t count_attributes(const draco::DecoderBuffer& at, draco::MeshDecoder& decoder);

// Checks the tables of all attributes. `at` is the start of the attribute section; `decoder` has
// decoded the connectivity and the attributes' headers.
void check_attribute_tables(const draco::DecoderBuffer& at, draco::MeshDecoder& decoder,
                            const AdmitTable& admit);

}  // namespace voxdag::gltf
