// Warnings about options that affect no file of a scene.
#include <gtest/gtest.h>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

// Opens files with all options that some scenes do not use. Returns the messages of the warnings
// with the code "unused-option".
std::vector<std::string> unused_of(const std::vector<std::string>& names) {
  MemoryFiles files;
  SceneBuilder plain = one_triangle(), bent = one_triangle();
  plain.root["extensionsUsed"] = {"ACME_bent"};
  bent.root["extensionsUsed"] = bent.root["extensionsRequired"] = {"ACME_bent"};
  files.contents["plain.glb"] = plain.glb();
  files.contents["bent.glb"] = bent.glb();
  files.contents["mesh.obj"] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  files.contents["points.xyz"] = "1 2 3\n";
  files.contents["points.ply"] =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n1 2 3\n";
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  const auto scene = open_scene(
      files, names, {.point_radius = 1, .columns = "x,y,z", .ignored_extensions = {"ACME_bent"}},
      budget, cancel);
  EXPECT_EQ(triangles_of(*scene).size(), scene->declared_triangles());
  EXPECT_EQ(scene->files().size(), names.size());
  std::vector<std::string> messages;
  for (const Warning& warning : scene->warnings())
    if (warning.code == "unused-option") messages.push_back(warning.message);
  return messages;
}

// An option is used if it affects one of the files.
TEST(UnusedOptions, AreNamed) {
  const std::string
      radius = "--point-radius has no effect: no file of the scene is a file of points",
      columns = "--columns has no effect: no file of the scene is a text file with points",
      extension =
          "--ignore-extension ACME_bent has no effect: no glTF file of the scene requires this "
          "extension, or voxdag reads it";
  using Messages = std::vector<std::string>;
  EXPECT_EQ(unused_of({"mesh.obj"}), (Messages{radius, columns, extension}));
  EXPECT_EQ(unused_of({"mesh.obj", "plain.glb"}), (Messages{radius, columns, extension}));
  EXPECT_EQ(unused_of({"bent.glb"}), (Messages{radius, columns}));
  EXPECT_EQ(unused_of({"points.ply"}), (Messages{columns, extension}));
  EXPECT_EQ(unused_of({"points.xyz"}), (Messages{extension}));
  EXPECT_EQ(unused_of({"mesh.obj", "points.xyz", "bent.glb"}), Messages{});
}

TEST(UnusedOptions, DefaultsCauseNoWarning) {
  OpenScene open(one_triangle().glb(), {});
  EXPECT_TRUE(open.source->warnings().empty());
}

}  // namespace
}  // namespace voxdag::test
