// Runs the whole pipeline in this process, from a .glb file to the global file, and reads the
// result back through the reader that engines use.
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

// The arrays of a global file, child offsets turned back into indices; hashes are not in the file.
struct FileDag {
  std::vector<uint64_t> bricks;
  std::vector<std::vector<oracle::Node>> levels;  // from the bricks' parents up
};
FileDag read_dag(const voxdag_reader::File& file);

// Checks counts and node arrays of a file against the oracle's; on small grids also every single
// voxel, by its position.
void expect_file_equals(const std::string& path, const oracle::Voxels& voxels, int hash_bits);

// The bytes of a file.
std::string contents(const std::string& path);

// A folder, scenes written into it, builds of them.
class Reference : public testing::Test {
 protected:
  // A spec for a scene in lattice units on a grid of R voxels: the cube is given, so that the
  // product snaps every vertex to where it was.
  voxdag::BuildSpec spec_for(const Triangles& scene, int64_t resolution, int copies = 1);
  // Builds under a unique name.
  voxdag::BuildReport run(voxdag::BuildSpec spec);
  // Builds a scene in lattice units, and compares with the oracle.
  voxdag::BuildReport expect_right(const Triangles& scene, int resolution, voxdag::BuildSpec spec);

  voxdag::TemporaryFolder folder_{fast_disk()};

 private:
  // Hundreds of small builds wait for the disk only: where there is a disk in memory, they use it.
  static std::string fast_disk();

  int files_ = 0;
};

}  // namespace reference
