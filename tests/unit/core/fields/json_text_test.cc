#include "core/fields/json_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace voxdag {
namespace {

using nlohmann::json, nlohmann::ordered_json;

TEST(JsonTextTest, IndentsOnRequest) {
  EXPECT_EQ(json_text(ordered_json{{"b", 1}, {"a", 2}}), R"({"b":1,"a":2})");
  EXPECT_EQ(json_text(json{{"b", 1}, {"a", 2}}), R"({"a":2,"b":1})");
  EXPECT_EQ(json_text(json{{"a", 2}}, 1), "{\n \"a\": 2\n}");
  EXPECT_EQ(exact_json_text(json{{"a", 2}}, 1), "{\n \"a\": 2\n}");
}

TEST(JsonTextTest, ReplacesOrRefusesInvalidUtf8) {
  const json broken = "a\xff";
  EXPECT_EQ(json_text(broken), "\"a\ufffd\"");
  EXPECT_EQ(ascii_json_text(broken), "\"a\\ufffd\"");
  EXPECT_THROW(exact_json_text(broken), json::type_error);
  EXPECT_EQ(exact_json_text(json("\u00e9")), "\"\u00e9\"");
}

TEST(JsonTextTest, ReportsTextThatIsNotJson) {
  EXPECT_EQ(parse_json<json>("[1]"), json::array({1}));
  EXPECT_THROW(parse_json<json>("[1"), json::parse_error);
  EXPECT_THROW(parse_json<ordered_json>(""), json::parse_error);
  EXPECT_TRUE(try_parse_json<ordered_json>("[1").is_discarded());
  EXPECT_EQ(try_parse_json<ordered_json>("null"), ordered_json());
}

TEST(JsonTextTest, FindsARepeatedMember) {
  EXPECT_EQ(repeated_member(R"({"a": {"b": 1, "b": 2}})"), "b");
  EXPECT_EQ(repeated_member(R"([{"a": 1}, {"a": 1, "c": {"a": 2}}])"), std::nullopt);
  EXPECT_EQ(repeated_member(R"({"a": 1, "a": )"), std::nullopt);
}

}  // namespace
}  // namespace voxdag
