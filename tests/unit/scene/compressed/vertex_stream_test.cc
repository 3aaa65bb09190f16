// Vertex streams of version 1 decode to the elements that were written.
#include "scene/gltf/compressed/vertex_stream.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "tests/unit/scene/compressed/vertex_stream_writer.h"

namespace voxdag::test {
namespace {

// Returns false if the stream is not valid.
bool decode(const std::vector<unsigned char>& stream, size_t stride, std::string& out) {
  return gltf::decode_vertex_stream_1(std::as_bytes(std::span(stream)), stride,
                                      std::as_writable_bytes(std::span(out)));
}

std::string smooth_bytes(size_t count, std::mt19937& random) {
  std::string bytes(count, '\0');
  for (size_t i = 0; i < count; ++i)
    bytes[i] = static_cast<char>(random() % 16 == 0 ? random() : i / 90 + random() % 3);
  return bytes;
}

TEST(VertexStream, EveryForm) {
  std::mt19937 random(1);
  for (const size_t stride : {4, 8, 12, 16, 20, 36, 64, 128, 256})
    for (const size_t count : {1, 5, 16, 17, 255, 256, 300, 1000}) {
      const std::string bytes = smooth_bytes(stride * count, random);
      std::vector<uint8_t> modes(stride / 4);
      for (uint8_t& mode : modes) mode = std::array<uint8_t, 5>{0, 1, 2, 0x72, 0xf2}[random() % 5];
      std::string out(bytes.size(), 'x');
      EXPECT_TRUE(decode(write_vertex_stream_1(bytes, stride, modes, random()), stride, out));
      EXPECT_EQ(out, bytes) << stride << " " << count;
    }
}

TEST(VertexStream, IsRecognizedByItsFirstByte) {
  const std::vector<unsigned char> stream = {0xa0, 0};
  EXPECT_FALSE(gltf::is_vertex_stream_1(std::as_bytes(std::span(stream))));
  EXPECT_FALSE(gltf::is_vertex_stream_1({}));
  const auto written = write_vertex_stream_1("abcd", 4, {0}, 1);
  EXPECT_TRUE(gltf::is_vertex_stream_1(std::as_bytes(std::span(written))));
}

// Decodes the specification's example of four-bit deltas. They belong to the first byte of 16
// elements; the other bytes are 0.
TEST(VertexStream, ExampleOfTheSpecification) {
  const std::vector<unsigned char> stream = {
      0xa1, 0xa8, 3, 0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5, 0, 0, 0, 0, 0, 0,
      0,    0,    0, 0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0, 0, 0, 0, 0};
  const int deltas[] = {-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0};
  std::string out(64, 'x');
  ASSERT_TRUE(decode(stream, 4, out));
  uint8_t sum = 0;
  for (size_t i = 0; i < 16; ++i) {
    sum = static_cast<uint8_t>(sum + deltas[i]);
    EXPECT_EQ(static_cast<uint8_t>(out[4 * i]), sum) << i;
    EXPECT_EQ(out.substr(4 * i + 1, 3), std::string(3, '\0'));
  }
}

// Truncated streams, surplus bytes and unknown channel modes are refused. With flipped bits, the
// decoder reads no byte beyond the stream (the address sanitizer checks this).
TEST(VertexStream, DamagedStreams) {
  std::mt19937 random(2);
  const std::string bytes = smooth_bytes(300 * 12, random);
  const auto stream = write_vertex_stream_1(bytes, 12, {0, 1, 2}, 5);
  std::string out(bytes.size(), 'x');
  for (size_t size = 0; size < stream.size(); ++size) {
    const std::vector<unsigned char> cut(stream.begin(),
                                         stream.begin() + static_cast<ptrdiff_t>(size));
    EXPECT_FALSE(decode(cut, 12, out)) << size;
  }
  auto longer = stream;
  longer.insert(longer.begin() + 1, 0);
  EXPECT_FALSE(decode(longer, 12, out));
  for (int i = 0; i < 2000; ++i) {
    auto damaged = stream;
    damaged[random() % damaged.size()] ^= static_cast<unsigned char>(1 << random() % 8);
    decode(damaged, 12, out);
  }
  for (const uint8_t mode : {3, 0x10, 0x21}) {
    auto unknown = stream;
    unknown.back() = mode;
    EXPECT_FALSE(decode(unknown, 12, out)) << int{mode};
  }
}

}  // namespace
}  // namespace voxdag::test
