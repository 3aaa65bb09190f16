// Files with damaged colors. The reader detects the damage only when it reads the colors.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "core/format/global/open_global.h"
#include "query/render/renderer.h"
#include "query/render/views.h"
#include "scheduler/run_build.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

namespace voxdag {
namespace {

uint64_t number_at(const std::string& bytes, uint64_t at) {
  uint64_t value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

query::Picture render(const std::string& path) {
  const auto file = open_global_file(path);
  const query::DagView dag(*file);
  NoProgress progress;
  const CancelToken cancel;
  query::RenderOptions options;
  options.width = 32;
  options.height = 24;
  options.threads = 2;
  options.colors = file.get();
  return render_picture(dag, query::named_view("iso", dag, 4.0 / 3, {}, cancel), options, progress,
                        cancel);
}

// Rendering a file with damaged colors fails, and the error names the damaged region.
TEST(DamagedColors, EndARender) {
  const TemporaryFolder folder;
  BuildSpec spec;
  spec.geometry.scenes = {PaintedScene::write(folder.path())};
  spec.geometry.resolution = 32;
  spec.geometry.attributes.add(Attribute::kColor);
  spec.run.output = folder.file("out.vdag");
  build_now(spec);
  render(spec.run.output);
  std::string bytes;
  {
    std::ifstream in(spec.run.output, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  // Removes all cells of the finest level from the only color region.
  const uint64_t section = number_at(bytes, 1152 + 8), size = number_at(bytes, 1152 + 16);
  const uint64_t directory = section + 16 * number_at(bytes, section + size - 32 + 8);
  std::memset(bytes.data() + directory + 16, 0, sizeof(uint32_t));
  const std::string damaged = folder.file("damaged.vdag");
  std::ofstream(damaged, std::ios::binary) << bytes;
  const Error error = error_of([&] { render(damaged); });
  EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
  EXPECT_NE(error.message().find("colors: the region of level 0 with Morton code 0 is missing or "
                                 "damaged"),
            std::string::npos)
      << error.message();
}

}  // namespace
}  // namespace voxdag
