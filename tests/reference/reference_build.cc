#include "tests/reference/reference_build.h"

#include <bit>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

namespace reference {
namespace {

std::map<uint64_t, uint32_t> index_of_offset(const voxdag_reader::File& file, uint32_t level) {
  std::map<uint64_t, uint32_t> index;
  const voxdag_reader::Level& l = file.level(level);
  const bool bricks = level == file.brick_level();
  const uint64_t pointer_words = bricks ? 0 : file.level(level + 1).pointer_bits / 32;
  for (uint64_t word = 0; word < l.word_count;) {
    index.emplace(word, static_cast<uint32_t>(index.size()));
    word += bricks ? 2 : 1 + pointer_words * static_cast<uint64_t>(std::popcount(l.words[word]));
  }
  return index;
}

void expect_nodes_equal(const std::vector<oracle::Node>& got,
                        const std::vector<oracle::Node>& want) {
  ASSERT_EQ(got.size(), want.size());
  for (size_t i = 0; i < got.size(); ++i) {
    ASSERT_EQ(got[i].mask, want[i].mask) << "node " << i;
    ASSERT_EQ(got[i].children, want[i].children) << "node " << i;
  }
}

void expect_voxels_equal(const voxdag_reader::File& file, const oracle::Voxels& voxels) {
  uint64_t missing = 0, extra = 0;
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z) {
        const bool set = file.voxel(x, y, z);
        missing += !set && voxels.at(x, y, z);
        extra += set && !voxels.at(x, y, z);
      }
  EXPECT_EQ(missing, 0u);
  EXPECT_EQ(extra, 0u);
}

}  // namespace

FileDag read_dag(const voxdag_reader::File& file) {
  FileDag dag;
  if (file.empty()) return dag;
  auto below = index_of_offset(file, file.brick_level());
  for (const auto& [offset, index] : below) dag.bricks.push_back(file.brick(offset));
  for (uint32_t l = file.brick_level(); l-- > 0;) {
    auto here = index_of_offset(file, l);
    auto& nodes = dag.levels.emplace_back();
    for (const auto& [offset, index] : here) {
      const voxdag_reader::Node node = file.node(l, offset);
      oracle::Node& to = nodes.emplace_back();
      to.mask = node.child_mask;
      for (int c = 0; c < std::popcount(node.child_mask); ++c)
        to.children.push_back(below.at(node.child(c)));
    }
    below = std::move(here);
  }
  return dag;
}

void expect_file_equals(const std::string& path, const oracle::Voxels& voxels, int hash_bits) {
  const oracle::Dag truth = oracle::build_dag(voxels, hash_bits);
  const voxdag_reader::File file(path);
  EXPECT_EQ(file.first_damaged_block(), 0u);
  EXPECT_EQ(file.resolution(), voxels.edge());
  EXPECT_EQ(file.voxels(), truth.voxels);
  EXPECT_EQ(file.svo_nodes(), truth.svo_nodes);
  EXPECT_EQ(file.dag_nodes(), truth.dag_nodes);
  EXPECT_EQ(file.hash_bits(), static_cast<uint32_t>(hash_bits));
  const FileDag dag = read_dag(file);
  EXPECT_TRUE(dag.bricks == truth.bricks) << "the brick level differs";
  ASSERT_EQ(dag.levels.size(), truth.levels.size());
  for (size_t l = 0; l < dag.levels.size(); ++l) {
    SCOPED_TRACE(testing::Message() << l + 1 << " levels above the bricks");
    expect_nodes_equal(dag.levels[l], truth.levels[l]);
  }
  if (voxels.edge() <= 128) expect_voxels_equal(file, voxels);
}

std::string contents(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  EXPECT_TRUE(in) << path;
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string Reference::fast_disk() {
  std::error_code none;
  const auto space = std::filesystem::space("/dev/shm", none);
  return !none && space.available > 4096 * kMebibyte ? "/dev/shm" : testing::TempDir();
}

voxdag::BuildSpec Reference::spec_for(const Triangles& scene, int64_t resolution, int copies) {
  const std::string path = folder_.file("scene" + std::to_string(files_++) + ".glb");
  write_glb(path, as_world(scene), copies);
  voxdag::BuildSpec spec;
  spec.geometry.scenes = {path};
  spec.geometry.resolution = static_cast<uint64_t>(resolution);
  spec.geometry.bounds = {0, 0, 0, static_cast<double>(resolution)};
  spec.run.threads = 1;
  return spec;
}

voxdag::BuildReport Reference::run(voxdag::BuildSpec spec) {
  spec.run.output = folder_.file("out" + std::to_string(files_++) + ".vdag");
  voxdag::NoProgress progress;
  voxdag::CancelToken never;
  const auto report = voxdag::run_build(spec, {voxdag::system_files(), progress, never});
  EXPECT_FALSE(std::filesystem::exists(spec.run.output + ".work")) << "the work folder was left";
  const voxdag_reader::File file(spec.run.output);
  EXPECT_EQ(report.merge.voxels, file.voxels());
  EXPECT_EQ(report.merge.svo_nodes, file.svo_nodes());
  EXPECT_EQ(report.merge.dag_nodes, file.dag_nodes());
  EXPECT_EQ(report.bytes, file.file_bytes());
  return report;
}

voxdag::BuildReport Reference::expect_right(const Triangles& scene, int resolution,
                                            voxdag::BuildSpec spec) {
  const auto report = run(std::move(spec));
  expect_file_equals(report.output, oracle::voxelize(scene, {{0, 0, 0}, resolution}),
                     static_cast<int>(report.hash_bits));
  return report;
}

}  // namespace reference
