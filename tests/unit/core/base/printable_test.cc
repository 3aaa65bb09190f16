#include "core/base/text/printable.h"

#include <gtest/gtest.h>

#include <utility>

namespace voxdag {
namespace {

TEST(Printable, KeepsOrdinaryText) {
  for (const std::string text : {"", "a b.glb", "\"quoted\"", "gr\xc3\xbc\xc3\x9f", "\xe7\x95\x8c",
                                 "\xf0\x9f\x98\x80", "\xc2\xa0", "\xef\xbf\xbd"}) {
    EXPECT_EQ(printable_line(text), text);
    EXPECT_EQ(printable_lines(text), text);
    EXPECT_EQ(printable_json(text), text);
    EXPECT_TRUE(is_printable(text)) << text;
  }
}

// Control characters, line separators and bidirectional controls become one question mark each.
TEST(Printable, ReplacesControls) {
  for (const std::string& control :
       {std::string("\x01"), std::string(1, '\0'), std::string("\x1b"), std::string("\r"),
        std::string("\x7f"), std::string("\xc2\x80"), std::string("\xc2\x85"),
        std::string("\xc2\x9b"), std::string("\xc2\x9f"), std::string("\xd8\x9c"),
        std::string("\xe2\x80\x8e"), std::string("\xe2\x80\x8f"), std::string("\xe2\x80\xa8"),
        std::string("\xe2\x80\xa9"), std::string("\xe2\x80\xaa"), std::string("\xe2\x80\xae"),
        std::string("\xe2\x81\xa6"), std::string("\xe2\x81\xa9")}) {
    SCOPED_TRACE(testing::PrintToString(control));
    EXPECT_EQ(printable_line("a" + control + "b"), "a?b");
    EXPECT_EQ(printable_lines("a" + control + "b"), "a?b");
    EXPECT_FALSE(is_printable("a" + control));
  }
}

TEST(Printable, KeepsLinesOnlyInLines) {
  EXPECT_EQ(printable_line("a\n\tb"), "a??b");
  EXPECT_EQ(printable_lines("a\n\tb"), "a\n\tb");
  EXPECT_FALSE(is_printable("a\n"));
}

// Each byte that is not UTF-8 becomes a question mark. Overlong forms and surrogates are not UTF-8,
// although a lax decoder would read control characters from them.
TEST(Printable, ReplacesBytesThatAreNotUtf8) {
  for (const auto& [text, shown] :
       std::initializer_list<std::pair<std::string, std::string>>{{"\xff", "?"},
                                                                  {"\x80", "?"},
                                                                  {"\xc2", "?"},
                                                                  {"\xc0\x9b", "??"},
                                                                  {"\xc1\xbf", "??"},
                                                                  {"\xe0\x82\x9b", "???"},
                                                                  {"\xf0\x80\x82\x9b", "????"},
                                                                  {"\xed\xa0\x80", "???"},
                                                                  {"\xf4\x90\x80\x80", "????"},
                                                                  {"\xf5\x80\x80\x80", "????"},
                                                                  {"\xe2\x80", "??"},
                                                                  {"\xe2\x80z", "??z"}})
    EXPECT_EQ(printable_line(text), shown) << testing::PrintToString(text);
}

// printable_json() replaces control characters by escapes, which preserve the string's value. Only
// a byte that is not UTF-8 becomes U+FFFD.
TEST(Printable, EscapesInJson) {
  EXPECT_EQ(printable_json("{\"a\":\"\xc2\x9b\xe2\x80\xae\x7f\xff\"}"),
            "{\"a\":\"\\u009b\\u202e\\u007f\\ufffd\"}");
  EXPECT_EQ(printable_json("{\n}\n"), "{\n}\n");
}

}  // namespace
}  // namespace voxdag
