// Jobs share subvolumes through the cache folder in the data folder (setting `jobs.cache`).
#include <filesystem>

#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

class SharedCache : public RunningService {
 protected:
  // Runs a job to its end. Returns the member `subvolumes` of its report.
  Json subvolumes() {
    const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
    EXPECT_TRUE(until_state(id, "succeeded"));
    return Json::parse(http_->get("/api/v1/jobs/" + id + "/report").body).at("subvolumes");
  }
};

TEST_F(SharedCache, ALaterJobTakesTheSubvolumesOfAnEarlierOne) {
  config_.jobs.cache_bytes = 64 << 20;
  start();
  put_scene("m.glb", scene_bytes());
  EXPECT_EQ(subvolumes()["cached"], 0);
  const Json second = subvolumes();
  EXPECT_GT(second["total"], 0);
  EXPECT_EQ(second["cached"], second["total"]);
}

TEST_F(SharedCache, IsNotThereByDefault) {
  start();
  put_scene("m.glb", scene_bytes());
  subvolumes();
  EXPECT_EQ(subvolumes()["cached"], 0);
  EXPECT_FALSE(std::filesystem::exists(config_.data_folder + "/cache"));
}

}  // namespace
}  // namespace voxdag::server
