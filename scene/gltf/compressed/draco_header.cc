#include "scene/gltf/compressed/draco_header.h"

#include <algorithm>
#include <string>

#include "scene/gltf/compressed/codecs.h"

namespace voxdag::gltf {
namespace {

// The header: "DRACO", u8 major version, u8 minor version, u8 geometry type, u8 method, u16 flags.
constexpr size_t kDracoHeaderBytes = 11;
constexpr uint8_t kMesh = 1;
constexpr uint8_t kSequential = 0, kEdgebreaker = 1;
constexpr uint8_t kValenceConnectivity = 2;
constexpr uint8_t kMetadataFlag = 0x80;  // in the high byte of the flags

class Bytes {
 public:
  Bytes(std::span<std::byte> data, size_t at) : data_(data), at_(at) {}

  size_t position() const { return at_; }
  uint8_t next() {
    if (at_ >= data_.size()) refuse_short();
    return std::to_integer<uint8_t>(data_[at_++]);
  }
  void skip(uint64_t count) {
    if (count > data_.size() - at_) refuse_short();
    at_ += static_cast<size_t>(count);
  }
  // Reads an integer of seven bits per byte, lowest bits first. Only the last byte is below 128.
  uint32_t varint() {
    uint64_t value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {
      const uint8_t byte = next();
      value |= uint64_t{byte & 0x7fu} << shift;
      if (byte < 0x80 && value <= UINT32_MAX) return static_cast<uint32_t>(value);
    }
    throw BrokenData{"its Draco data have a number of over 32 bits before byte " +
                     std::to_string(at_) + ", expected at most 32"};
  }

 private:
  [[noreturn]] void refuse_short() const {
    throw BrokenData{"its Draco data end within their header: they have " +
                     std::to_string(data_.size()) + " bytes, expected more"};
  }

  std::span<std::byte> data_;
  size_t at_;
};

// Skips the metadata blocks of the attributes, and the mesh's block. A block can contain named
// blocks; `open` is the number of blocks that remain to be skipped.
void skip_metadata(Bytes& bytes) {
  const auto skip_block = [&]() -> uint64_t {
    for (uint32_t entries = bytes.varint(); entries > 0; --entries) {
      bytes.skip(bytes.next());    // the name
      bytes.skip(bytes.varint());  // the value
    }
    return bytes.varint();
  };
  const auto skip_tree = [&] {
    for (uint64_t open = skip_block(); open > 0; --open) {
      bytes.skip(bytes.next());  // the name
      open += skip_block();
    }
  };
  for (uint32_t attributes = bytes.varint(); attributes > 0; --attributes) {
    bytes.varint();  // its id
    skip_tree();
  }
  skip_tree();
}

}  // namespace

DracoHeader read_draco_header(std::span<std::byte> data) {
  static constexpr char kMagic[] = {'D', 'R', 'A', 'C', 'O'};
  Bytes bytes(data, 0);
  for (const char c : kMagic)
    if (bytes.next() != static_cast<uint8_t>(c))
      throw BrokenData{
          "its data do not begin with the signature DRACO, expected compressed data of Draco"};
  const uint8_t major = bytes.next(), minor = bytes.next();
  if (major != 2 || minor != 2)
    throw BrokenData{"its data have Draco version " + std::to_string(major) + "." +
                     std::to_string(minor) + ", expected 2.2"};
  const uint8_t type = bytes.next(), method = bytes.next();
  if (type != kMesh)
    throw BrokenData{"its Draco data are of the type " + std::to_string(type) +
                     ", expected 1, a mesh"};
  if (method != kSequential && method != kEdgebreaker)
    throw BrokenData{"its Draco data have the unknown method " + std::to_string(method) +
                     ", expected 0 or 1"};
  bytes.next();
  DracoHeader header;
  if (bytes.next() & kMetadataFlag) {
    skip_metadata(bytes);
    header.begin = bytes.position() - kDracoHeaderBytes;
    std::copy_backward(data.begin(), data.begin() + kDracoHeaderBytes,
                       data.begin() + static_cast<ptrdiff_t>(bytes.position()));
    data[bytes.position() - 1] &= static_cast<std::byte>(~kMetadataFlag);
  }
  header.is_edgebreaker = method == kEdgebreaker;
  if (header.is_edgebreaker) {
    header.has_valences = bytes.next() == kValenceConnectivity;
    header.vertices = bytes.varint();
  }
  header.faces = bytes.varint();
  if (header.is_edgebreaker)
    header.attribute_tables = bytes.next();
  else
    header.vertices = bytes.varint();
  return header;
}

}  // namespace voxdag::gltf
