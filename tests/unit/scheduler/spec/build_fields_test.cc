#include "scheduler/spec/build_fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <type_traits>

#include "scene/formats/formats.h"

namespace voxdag {
namespace {

// The help text of the scene lists all file endings of the table of formats. The text is a
// constant, so it could become outdated.
TEST(BuildFields, SceneHelpListsAllEndings) {
  EXPECT_THAT(std::string(kSceneField.help),
              testing::HasSubstr("(" + list_scene_endings(", ", ", ") + ")"));
}

// Parses `text` into the field with this name, and stores whether the text is valid.
struct OneOption {
  std::string_view name;
  std::string text;
  bool is_valid = false;

  template <class T>
  void operator()(const Field& field, T& value) {
    // parse_text() parses neither flags nor lists.
    if constexpr (!IsVector<T>::value && !std::is_same_v<T, bool>)
      if (name == field.name) is_valid = parse_text(field, text, value);
  }
  void object(const char*, const auto&) {}
};

// The option `thin` is part of the build's key only if it is set, so that the keys of other builds
// are the same as before this option existed.
TEST(BuildFields, ThinIsInTheKeyOnlyIfGiven) {
  GeometryOptions options;
  options.resolution = 64;
  EXPECT_EQ(geometry_json(options).find("thin"), std::string::npos);
  EXPECT_EQ(options.rule(), VoxelRule::kShell);
  options.thin = true;
  EXPECT_NE(geometry_json(options).find(R"("thin":true)"), std::string::npos);
  EXPECT_EQ(options.rule(), VoxelRule::kThin);
}

TEST(BuildFields, ZeroAndEmptyMeanTheDefault) {
  BuildSpec spec;
  spec.geometry.resolution = 64;
  const auto accepts = [&](const char* name, const char* text) {
    OneOption option{name, text};
    fields(option, spec);
    return option.is_valid;
  };
  for (const char* name : {"threads", "subvolume", "color_resolution"})
    EXPECT_TRUE(accepts(name, "0")) << name;
  for (const char* name : {"method", "attributes"}) EXPECT_TRUE(accepts(name, "")) << name;
  check_options(spec);
  for (const char* name : {"memory", "hash_bits", "voxel_size"})
    EXPECT_FALSE(accepts(name, "0")) << name;
  EXPECT_FALSE(accepts("backend", ""));
}

TEST(BuildFields, UnknownEnumerationsAreRefused) {
  BuildSpec spec;
  spec.geometry.resolution = 64;
  spec.run.backend = static_cast<BackendName>(99);
  try {
    check_options(spec);
    ADD_FAILURE() << "was accepted";
  } catch (const FieldError& error) {
    EXPECT_EQ(error.field, "backend");
    EXPECT_THAT(error.message(), testing::HasSubstr("expected one of auto, "));
  }
}

}  // namespace
}  // namespace voxdag
