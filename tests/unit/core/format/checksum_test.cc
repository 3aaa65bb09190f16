#include "core/format/checksum.h"

#include <gtest/gtest.h>

#include <string>

#include "core/format/global/voxdag_reader.h"

namespace voxdag {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

// The checksums equal published test vectors.
TEST(ChecksumTest, KnownValues) {
  EXPECT_EQ(checksum64({}), 0xef46db3751d8e999u);
  EXPECT_EQ(checksum64(bytes_of("abc")), 0x44bc2cf5ad770999u);
  Sha256 digest;
  digest.add(bytes_of("a"));
  digest.add(bytes_of("bc"));
  EXPECT_EQ(digest.finish(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// The reader's implementation of XXH64 equals the library's, for every length below 300 bytes.
TEST(ChecksumTest, ReaderAgreesWithTheLibrary) {
  std::string text;
  for (int size = 0; size < 300; ++size) {
    const auto* data = reinterpret_cast<const unsigned char*>(text.data());
    EXPECT_EQ(voxdag_reader::xxh64(data, text.size()), checksum64(bytes_of(text))) << size;
    text += static_cast<char>(size * 37 + 11);
  }
}

}  // namespace
}  // namespace voxdag
