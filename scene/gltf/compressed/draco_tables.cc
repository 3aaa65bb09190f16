#include "scene/gltf/compressed/draco_tables.h"

#ifdef VOXDAG_HAS_DRACO

#include <draco/compression/bit_coders/rans_bit_decoder.h>
#include <draco/compression/config/compression_shared.h>
#include <draco/compression/entropy/rans_symbol_decoder.h>
#include <draco/compression/mesh/mesh_decoder.h>
#include <draco/core/varint_decoding.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "scene/gltf/compressed/codecs.h"

namespace voxdag::gltf {
namespace {

constexpr uint64_t kBytesPerSymbol = sizeof(uint32_t) + sizeof(draco::rans_sym);
constexpr int kTagBits = 5, kMaxRawBits = 18, kMaxTag = 32;
constexpr int kValenceContexts = 6;
constexpr int kCreaseContexts = 4;
constexpr uint64_t kOctahedralComponents = 2;
constexpr uint64_t kTypeBytes = 4;  // bytes per attribute: use, number type, components, normalized

[[noreturn]] void refuse_damaged() {
  throw BrokenData{"its Draco data are damaged: expected valid connectivity and symbol tables"};
}

// Walks through the data in a copy of Draco's buffer, so that Draco's own position does not change.
// Calls `admit` before it builds a table.
class Walker {
 public:
  Walker(const draco::DecoderBuffer& at, const AdmitTable& admit) : buffer_(at), admit_(admit) {}

  template <class T>
  T value() {
    T value;
    if (!buffer_.Decode(&value)) refuse_damaged();
    return value;
  }
  uint32_t varint() {
    uint32_t value;
    if (!draco::DecodeVarint(&value, &buffer_)) refuse_damaged();
    return value;
  }
  void skip(uint64_t bytes) {
    if (bytes > remaining()) refuse_damaged();
    buffer_.Advance(static_cast<int64_t>(bytes));
  }
  // Skips entropy-coded bits.
  void skip_bits() {
    draco::RAnsBitDecoder bits;
    if (!bits.StartDecoding(&buffer_)) refuse_damaged();
  }
  // Skips `entries` entries of `components` entropy-coded numbers.
  void skip_symbols(uint64_t entries, uint64_t components) {
    if (entries * components == 0) return;
    if (entries * components > UINT32_MAX) refuse_damaged();
    const auto scheme = value<uint8_t>();
    if (scheme == draco::SYMBOL_CODING_TAGGED)
      skip_tagged(entries, components);
    else if (scheme == draco::SYMBOL_CODING_RAW)
      skip_raw(value<uint8_t>(), std::make_integer_sequence<int, kMaxRawBits>());
    else
      refuse_damaged();
  }

 private:
  uint64_t remaining() const {
    return static_cast<uint64_t>(std::max<int64_t>(buffer_.remaining_size(), 0));
  }

  // Builds the table of an alphabet, after admit_ has accepted its memory. Moves the position past
  // the coded symbols, and returns a decoder of these symbols.
  template <int kBits>
  draco::RAnsSymbolDecoder<kBits> open_symbols() {
    draco::DecoderBuffer ahead = buffer_;
    uint32_t symbols;
    if (!draco::DecodeVarint(&symbols, &ahead) || symbols == 0 ||
        symbols / 64 > static_cast<uint64_t>(ahead.remaining_size()))
      refuse_damaged();
    constexpr int kPrecision = draco::ComputeRAnsPrecisionFromUniqueSymbolsBitLength(kBits);
    admit_(symbols * kBytesPerSymbol + (sizeof(uint32_t) << kPrecision));
    draco::RAnsSymbolDecoder<kBits> decoder;
    if (!decoder.Create(&buffer_) || !decoder.StartDecoding(&buffer_)) refuse_damaged();
    return decoder;
  }

  template <int... kBits>
  void skip_raw(int bits, std::integer_sequence<int, kBits...>) {
    if (bits < 1 || bits > kMaxRawBits) refuse_damaged();
    ((bits == kBits + 1 ? static_cast<void>(open_symbols<kBits + 1>()) : void()), ...);
  }

  // Skips entries that store the size of their numbers. First come the coded symbols, one for each
  // entry: the size in bits of each of the entry's numbers. Then come the bits of all numbers.
  // Draco accepts data that end before the last bit, so this function accepts them as well.
  void skip_tagged(uint64_t entries, uint64_t components) {
    auto tags = open_symbols<kTagBits>();
    uint64_t bits = 0;
    for (uint64_t i = 0; i < entries; ++i) {
      const uint32_t tag = tags.DecodeSymbol();
      if (tag > kMaxTag) refuse_damaged();
      bits += tag * components;
    }
    skip(std::min((bits + 7) / 8, remaining()));
  }

  draco::DecoderBuffer buffer_;
  const AdmitTable& admit_;
};

// Returns the number of vertices of the faces. Draco decodes one value per vertex, because its
// traversal of the faces visits each vertex once. The traversal could miss vertices if two
// neighboring faces did not share both vertices of their common edge. So the function refuses a
// corner table with such faces.
template <class CornerTable>
uint64_t count_vertices(const CornerTable& table) {
  std::vector<bool> is_counted(static_cast<size_t>(table.num_vertices()));
  uint64_t count = 0;
  for (draco::CornerIndex c(0); c < static_cast<uint32_t>(table.num_corners()); ++c) {
    const draco::VertexIndex vertex = table.Vertex(c);
    if (vertex.value() >= is_counted.size()) refuse_damaged();
    if (!is_counted[vertex.value()]) ++count;
    is_counted[vertex.value()] = true;
    const draco::CornerIndex opposite = table.Opposite(c);
    if (opposite == draco::kInvalidCornerIndex) continue;
    if (table.Vertex(table.Next(c)) != table.Vertex(table.Previous(opposite)) ||
        table.Vertex(table.Previous(c)) != table.Vertex(table.Next(opposite)))
      refuse_damaged();
  }
  return count;
}

// A group of attributes whose values are stored in the same order of vertices or corners.
struct Group {
  bool is_per_corner = false;
  std::vector<uint8_t> coders;  // draco::SequentialAttributeEncoderType of each attribute
};

std::vector<Group> read_groups(Walker& walker, draco::MeshDecoder& decoder) {
  std::vector<Group> groups(walker.value<uint8_t>());
  if (decoder.GetCornerTable())
    for (Group& group : groups) {
      walker.value<int8_t>();  // index of its connectivity
      group.is_per_corner = walker.value<uint8_t>() != draco::MESH_VERTEX_ATTRIBUTE;
      walker.value<uint8_t>();  // the traversal
    }
  for (Group& group : groups) {
    const uint32_t attributes = walker.varint();
    for (uint32_t i = 0; i < attributes; ++i) {
      walker.skip(kTypeBytes);
      walker.varint();  // its id
    }
    for (uint32_t i = 0; i < attributes; ++i) group.coders.push_back(walker.value<uint8_t>());
  }
  return groups;
}

uint64_t count_entries(const Group& group, int first_attribute, draco::MeshDecoder& decoder) {
  const draco::CornerTable* const table = decoder.GetCornerTable();
  if (!table) return decoder.point_cloud()->num_points();
  if (!group.is_per_corner) return count_vertices(*table);
  const draco::MeshAttributeCornerTable* const own =
      decoder.GetAttributeCornerTable(first_attribute);
  if (!own) refuse_damaged();  // two groups of attributes use the same connectivity
  return count_vertices(*own);
}

// Skips the parameters of the transform that undoes a prediction: one or two 32-bit numbers.
void skip_transform(Walker& walker, int transform) {
  walker.skip(transform == draco::PREDICTION_TRANSFORM_NORMAL_OCTAHEDRON ? 4 : 8);
}

void skip_prediction(Walker& walker, int method, int transform, const draco::CornerTable* table) {
  const bool is_wrapped = transform == draco::PREDICTION_TRANSFORM_WRAP;
  const auto check_count = [&](uint64_t count) {
    if (count > static_cast<uint64_t>(table->num_corners())) refuse_damaged();
  };
  if (!table || method < draco::MESH_PREDICTION_PARALLELOGRAM)
    return skip_transform(walker, transform);
  if (method == draco::MESH_PREDICTION_GEOMETRIC_NORMAL) {
    skip_transform(walker, transform);
    return walker.skip_bits();
  }
  if (is_wrapped && method == draco::MESH_PREDICTION_CONSTRAINED_MULTI_PARALLELOGRAM)
    for (int i = 0; i < kCreaseContexts; ++i) {
      const uint32_t flags = walker.varint();
      check_count(flags);
      if (flags > 0) walker.skip_bits();
    }
  if (is_wrapped && (method == draco::MESH_PREDICTION_TEX_COORDS_PORTABLE ||
                     method == draco::MESH_PREDICTION_TEX_COORDS_DEPRECATED)) {
    const bool is_varint = method == draco::MESH_PREDICTION_TEX_COORDS_DEPRECATED;
    check_count(is_varint ? walker.varint() : walker.value<uint32_t>());
    walker.skip_bits();
  }
  skip_transform(walker, transform);
}

// Skips the values of an attribute that is coded as integers.
void skip_integers(Walker& walker, bool is_octahedral, uint64_t entries, uint64_t components,
                   const draco::CornerTable* table) {
  const int method = walker.value<int8_t>();
  if (method < draco::PREDICTION_NONE || method >= draco::NUM_PREDICTION_SCHEMES) refuse_damaged();
  const int transform = method == draco::PREDICTION_NONE ? int{draco::PREDICTION_TRANSFORM_NONE}
                                                         : walker.value<int8_t>();
  const bool is_octahedron =
      transform == draco::PREDICTION_TRANSFORM_NORMAL_OCTAHEDRON ||
      transform == draco::PREDICTION_TRANSFORM_NORMAL_OCTAHEDRON_CANONICALIZED;
  const bool is_predicted =
      is_octahedral ? is_octahedron : transform == draco::PREDICTION_TRANSFORM_WRAP;
  if (walker.value<uint8_t>() > 0)
    walker.skip_symbols(entries, components);
  else
    walker.skip(walker.value<uint8_t>() * entries * components);
  if (is_predicted) skip_prediction(walker, method, transform, table);
}

void skip_group(Walker& walker, const Group& group, int index, draco::MeshDecoder& decoder) {
  const draco::AttributesDecoderInterface& attributes = *decoder.attributes_decoder(index);
  const auto attribute = [&](size_t i) -> const draco::PointAttribute& {
    return *decoder.point_cloud()->attribute(attributes.GetAttributeId(static_cast<int>(i)));
  };
  const uint64_t entries = count_entries(group, attributes.GetAttributeId(0), decoder);
  for (size_t i = 0; i < group.coders.size(); ++i) {
    const bool is_octahedral = group.coders[i] == draco::SEQUENTIAL_ATTRIBUTE_ENCODER_NORMALS;
    if (group.coders[i] == draco::SEQUENTIAL_ATTRIBUTE_ENCODER_GENERIC)
      walker.skip(entries * static_cast<uint64_t>(attribute(i).byte_stride()));
    else
      skip_integers(walker, is_octahedral, entries,
                    is_octahedral ? kOctahedralComponents : attribute(i).num_components(),
                    decoder.GetCornerTable());
  }
  for (size_t i = 0; i < group.coders.size(); ++i) {
    if (group.coders[i] == draco::SEQUENTIAL_ATTRIBUTE_ENCODER_QUANTIZATION)
      walker.skip(sizeof(float) * (attribute(i).num_components() + 1u));  // minima and range
    if (group.coders[i] >= draco::SEQUENTIAL_ATTRIBUTE_ENCODER_QUANTIZATION)
      walker.skip(1);  // the number of bits
  }
}

}  // namespace

void check_index_tables(const draco::DecoderBuffer& at, const AdmitTable& admit) {
  Walker walker(at, admit);
  const uint64_t faces = walker.varint();
  walker.varint();  // vertices
  if (walker.value<uint8_t>() == 0) walker.skip_symbols(3 * faces, 1);
}

void check_valence_tables(const draco::DecoderBuffer& at, const AdmitTable& admit) {
  Walker walker(at, admit);
  walker.varint();  // vertices
  const uint32_t faces = walker.varint();
  const int attributes = walker.value<uint8_t>();
  walker.varint();  // symbols
  walker.varint();  // split symbols
  const uint32_t splits = walker.varint();
  for (uint32_t i = 0; i < splits; ++i) {
    walker.varint();
    walker.varint();
  }
  walker.skip((uint64_t{splits} + 7) / 8);
  for (int i = 0; i < 1 + attributes; ++i) walker.skip_bits();  // first faces, attribute edges
  for (int i = 0; i < kValenceContexts; ++i) {
    const uint32_t symbols = walker.varint();
    if (symbols > faces) refuse_damaged();
    walker.skip_symbols(symbols, 1);
  }
}

uint64_t count_attributes(const draco::DecoderBuffer& at, draco::MeshDecoder& decoder) {
  const AdmitTable no_tables;
  Walker walker(at, no_tables);
  uint64_t attributes = 0;
  for (const Group& group : read_groups(walker, decoder)) attributes += group.coders.size();
  return attributes;
}

void check_attribute_tables(const draco::DecoderBuffer& at, draco::MeshDecoder& decoder,
                            const AdmitTable& admit) {
  Walker walker(at, admit);
  const std::vector<Group> groups = read_groups(walker, decoder);
  for (size_t i = 0; i < groups.size(); ++i)
    skip_group(walker, groups[i], static_cast<int>(i), decoder);
}

}  // namespace voxdag::gltf

#endif
