// Runs complete builds in the test's process, from a .glb file to the global file. Reads the result
// with voxdag_reader.h, the reader that game engines use.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "scheduler/run_build.h"
#include "tests/oracle/dag.h"
#include "tests/oracle/scenes.h"
#include "tests/reference/scene_file.h"
#include "tests/support/temporary_folder.h"

namespace reference {

constexpr uint64_t kMebibyte = uint64_t{1} << 20;

// The nodes of a global file, with child indices instead of the file's child offsets, so that they
// can be compared with the oracle's. Hashes are not in the file.
struct FileDag {
  std::vector<uint64_t> bricks;
  std::vector<std::vector<oracle::Node>> levels;  // from the bricks' parents up
};
FileDag read_dag(const voxdag_reader::File& file);

// Checks that the counts and the node arrays of a file equal the oracle's. In small grids also
// looks up every voxel by its position.
void expect_file_equals(const std::string& path, const oracle::Voxels& voxels, int hash_bits);

// Returns the bytes of a file.
std::string contents(const std::string& path);

// Writes scenes to a temporary folder, and builds them there.
class Reference : public testing::Test {
 protected:
  // Returns the spec of a build of `scene`, whose coordinates are in lattice units (256 per voxel),
  // in a grid of `resolution` voxels per edge. The spec gives the grid's cube, so that the build
  // snaps every vertex to exactly its lattice coordinates. The scene file has `copies` copies of
  // each triangle.
  voxdag::BuildSpec spec_for(const Triangles& scene, int64_t resolution, int copies = 1);
  // Builds to a new output file, whose path is in the report.
  voxdag::BuildReport run(voxdag::BuildSpec spec);
  // Builds `scene`, whose coordinates are in lattice units, and checks that the file equals the
  // oracle's.
  voxdag::BuildReport expect_right(const Triangles& scene, int resolution, voxdag::BuildSpec spec);

  voxdag::TemporaryFolder folder_{fast_disk()};

 private:
  // Returns a folder on a disk in memory if one has enough free space, because hundreds of small
  // builds spend most of their time waiting for a real disk.
  static std::string fast_disk();

  int files_ = 0;
};

}  // namespace reference
