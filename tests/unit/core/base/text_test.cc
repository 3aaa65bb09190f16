#include "core/base/text.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "core/base/text/percent.h"

namespace voxdag {
namespace {

// Units are powers of 1024, with or without an "i". A text that is not a size is refused.
TEST(Text, ParsesSizes) {
  EXPECT_EQ(parse_size("1000000", "--memory"), 1000000u);
  EXPECT_EQ(parse_size("64M", "--memory"), uint64_t{64} << 20);
  EXPECT_EQ(parse_size("1.5 GiB", "--memory"), uint64_t{3} << 29);
  for (const char* text : {"", "GiB", "-1", "1X", "1e30", "nan", "12 34"})
    EXPECT_THROW(parse_size(text, "--memory"), Error) << text;
}

TEST(Text, WritesHexadecimal) {
  EXPECT_EQ(hex_text({}), "");
  const unsigned char bytes[] = {0x00, 0x09, 0xaf, 0xff};
  EXPECT_EQ(hex_text(bytes), "0009afff");
}

// Escapes can be anywhere, in upper or lower case. A broken escape is refused.
TEST(Text, DecodesPercentEscapes) {
  EXPECT_EQ(percent_decoded(""), "");
  EXPECT_EQ(percent_decoded("a%20b%2Fc%2f%C3%A9"), "a b/c/\xc3\xa9");
  EXPECT_EQ(percent_decoded("%00"), std::string(1, '\0'));
  EXPECT_EQ(percent_encoded("a b/c-._~%&\xc3\xa9"), "a%20b%2fc-._~%25%26%c3%a9");
  for (const char* text : {"%", "a%2", "%2g", "%g2", "%-1", "100%"})
    EXPECT_EQ(percent_decoded(text), std::nullopt) << text;
}

// A list must have exactly the requested number of numbers, without other text before, between or
// after them.
TEST(Text, ParsesListsOfNumbers) {
  const auto three = parse_numbers<double, 3>("1,-2.5,3e2", ',');
  ASSERT_TRUE(three);
  EXPECT_EQ(*three, (std::array<double, 3>{1, -2.5, 300}));
  EXPECT_EQ((parse_numbers<int, 2>("1280x720", 'x')), (std::array<int, 2>{1280, 720}));
  for (const char* text :
       {"", "1", "1,2", "1,2,3,", "1,2,3,4", ",1,2,3", "1,,3", "1, 2,3", "1;2;3"})
    EXPECT_FALSE((parse_numbers<double, 3>(text, ','))) << text;
}

TEST(Popcount8, CountsEveryByte) {
  for (int bits = 0; bits < 256; ++bits) EXPECT_EQ(popcount8(bits), __builtin_popcount(bits));
  EXPECT_EQ(popcount8(0x1ff), 8);
}

}  // namespace
}  // namespace voxdag
