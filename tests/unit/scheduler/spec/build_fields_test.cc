#include "scheduler/spec/build_fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "scene/formats/formats.h"

namespace voxdag {
namespace {

// The help is a constant; the endings come from the table of formats.
TEST(BuildFields, SceneHelpListsAllEndings) {
  EXPECT_THAT(std::string(kSceneField.help),
              testing::HasSubstr("(" + list_scene_endings(", ", ", ") + ")"));
}

}  // namespace
}  // namespace voxdag
