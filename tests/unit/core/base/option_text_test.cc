#include "core/base/options/option_text.h"

#include <gtest/gtest.h>

namespace voxdag {
namespace {

TEST(OptionTextTest, SpellsForTheCommandLineByDefault) {
  EXPECT_EQ(option_text("hash_bits"), "--hash-bits");
  EXPECT_EQ(option_text("level", "11"), "--level 11");
  EXPECT_EQ(option_text("region", "0,0,0,4,4,4"), "--region 0,0,0,4,4,4");
}

TEST(OptionTextTest, SpellsMembersOfJson) {
  EXPECT_EQ(spell_as_member("hash_bits", ""), "'hash_bits'");
  EXPECT_EQ(spell_as_member("level", "11"), "\"level\": 11");
  EXPECT_EQ(spell_as_member("region", "0,-1,0.5,4,4,4"), "\"region\": [0,-1,0.5,4,4,4]");
  EXPECT_EQ(spell_as_member("grid", "mask"), "\"grid\": \"mask\"");
}

TEST(OptionTextTest, SpellsKeywordsOfPython) {
  EXPECT_EQ(spell_as_keyword("hash_bits", ""), "hash_bits");
  EXPECT_EQ(spell_as_keyword("level", "11"), "level=11");
  EXPECT_EQ(spell_as_keyword("region", "0,0,0,4,4,4"), "region=(0,0,0,4,4,4)");
  EXPECT_EQ(spell_as_keyword("grid", "mask"), "grid=\"mask\"");
}

TEST(OptionTextTest, SpellsCommands) {
  EXPECT_EQ(command_text("verify"), "voxdag verify");
  EXPECT_EQ(command_text("build", "color"), "voxdag build --color");
  EXPECT_EQ(command_text("build", "solid", "winding"), "voxdag build --solid winding");
  EXPECT_EQ(spell_python_call("plan", "", ""), "voxdag.plan()");
  EXPECT_EQ(spell_python_call("build", "color", ""), "voxdag.build(color=True)");
  EXPECT_EQ(spell_python_call("reorder", "order", "hash"), "voxdag.reorder(order=\"hash\")");
  EXPECT_EQ(spell_python_call("verify", "", ""), "the shell command voxdag verify");
  EXPECT_EQ(spell_python_call("info", "json", ""), "the shell command voxdag info --json");
}

TEST(OptionTextTest, WordsFollowTheAudience) {
  EXPECT_EQ(repeat_text(), "run the same command again");
  set_audience(kPythonUsers);
  EXPECT_EQ(option_text("level"), "level");
  EXPECT_EQ(repeat_text(), "make the same call again");
  EXPECT_EQ(command_text("plan"), "voxdag.plan()");
  set_audience(kCommandLineUsers);
  EXPECT_EQ(option_text("level"), "--level");
}

}  // namespace
}  // namespace voxdag
