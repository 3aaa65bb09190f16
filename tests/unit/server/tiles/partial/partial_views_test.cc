#include "server/tiles/partial/partial_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <latch>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/forwarding_files.h"
#include "scheduler/run_build.h"
#include "scheduler/state/work_folder.h"
#include "server/base/request_error.h"
#include "server/jobs/process/subvolume_map.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag::server {
namespace {

using Cells = std::set<std::array<uint32_t, 3>>;

constexpr uint64_t kResolution = 1024;
// Level of the cells of 16 voxels per edge, a quarter of a subvolume's edge.
constexpr uint32_t kCellDepth = 6;

void add_cells(const query::DagView& dag, uint64_t node, uint32_t depth,
               const std::array<uint32_t, 3>& at, Cells& cells) {
  if (depth == kCellDepth) {
    cells.insert(at);
    return;
  }
  const auto children = dag.children_of_node(depth, node);
  for (uint32_t i = 0; i < 8; ++i)
    if (children.has(static_cast<int>(i)))
      add_cells(dag, dag.offset(children, static_cast<int>(i)), depth + 1,
                {2 * at[0] + (i >> 2), 2 * at[1] + (i >> 1 & 1), 2 * at[2] + (i & 1)}, cells);
}

Cells cells_of(const query::DagView& dag, uint64_t root) {
  Cells cells;
  add_cells(dag, root, 0, {}, cells);
  return cells;
}

// Makes the list of subvolumes that a job's process writes, and cancels the build after `most`
// built subvolumes.
class ListedBuild : public NoProgress {
 public:
  explicit ListedBuild(int most) : most_(most) {}
  void set_grid(const std::array<double, 3>& origin, double edge) override {
    map_.set_grid(origin, edge);
  }
  void set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) override {
    map_.set(resolution, all);
  }
  void subvolume_built(const SubvolumeStatus&) override {
    if (++built_ == most_) cancel.cancel();
  }
  std::string list() const { return map_.json(); }

  CancelToken cancel;

 private:
  const int most_;
  int built_ = 0;
  SubvolumeMap map_;
};

class PartialViewsTest : public testing::Test {
 protected:
  // Builds until `most` subvolumes are built, and returns the list of all subvolumes. With `most`
  // -1, builds completely.
  std::string build(int most) {
    BuildSpec spec = spheres_build(scene_, job_.result());
    spec.run.work_folder = job_.work();
    spec.run.subvolume_edge = 64;
    spec.run.keep_work = true;
    ListedBuild listed(most);
    try {
      run_build(spec, {system_files(), listed, listed.cancel});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCanceled) << error.what();
    }
    return listed.list();
  }
  void write(const std::string& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
  }
  auto look(PartialViews& views) { return views.tiles("job", job_, kResolution); }
  // Requests the partial view repeatedly, for at most ten seconds, until condition(manifest) holds.
  // Returns the last view.
  template <class Condition>
  std::shared_ptr<const TileSource> look_until(PartialViews& views, const Condition& condition) {
    auto dag = look(views);
    for (int i = 0; i < 1000 && !condition(nlohmann::json::parse(dag->manifest({}))); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      dag = look(views);
    }
    const auto last = nlohmann::json::parse(dag->manifest({}));
    EXPECT_TRUE(condition(last)) << "not within ten seconds: " << last;
    return dag;
  }
  ErrorCode failure() {
    PartialViews views(system_files(), 1);
    return error_of([&] { look(views); }).code();
  }

  const TemporaryFolder folder_;
  const JobFolder job_{folder_.path()};
  const std::string scene_ = folder_.file("scene.glb");
};

TEST_F(PartialViewsTest, GrowWithTheBuildAndOutliveItsFolder) {
  write_spheres(scene_, 3000);
  EXPECT_EQ(failure(), ErrorCode::kNotFound) << "no folder";
  const std::string list = build(10);
  EXPECT_EQ(failure(), ErrorCode::kNotFound) << "no list";
  write(job_.subvolumes(), list.substr(0, list.size() / 2));
  EXPECT_EQ(failure(), ErrorCode::kCorrupt) << "half a list";
  write(job_.subvolumes(), list);

  PartialViews views(system_files(), 1);
  const auto early = look(views);
  const auto manifest = nlohmann::json::parse(early->manifest({}));
  ASSERT_TRUE(manifest["root"].is_object()) << manifest;
  EXPECT_LT(manifest["built"], manifest["total"]);
  EXPECT_EQ(manifest["camera"]["target"].size(), 3u);
  const uint64_t root = manifest["root"]["offset"];
  const Cells some = cells_of(early->dag(), root);

  build(-1);
  const voxdag_reader::File result(job_.result());
  for (size_t axis = 0; axis < 3; ++axis)
    EXPECT_EQ(manifest["origin"][axis], result.origin()[axis]);
  EXPECT_EQ(manifest["edge"], result.edge());
  const Cells all = cells_of(query::DagView(result), 0);
  EXPECT_LT(some.size(), all.size());
  EXPECT_TRUE(std::includes(all.begin(), all.end(), some.begin(), some.end()));
  const auto late =
      look_until(views, [&](const auto& now) { return now["built"] == manifest["total"]; });
  const auto now = nlohmann::json::parse(late->manifest({}));
  EXPECT_EQ(now["digest"], manifest["digest"]);
  EXPECT_EQ(cells_of(late->dag(), now["root"]["offset"]), all);
  EXPECT_EQ(cells_of(late->dag(), root), some) << "what lies at an address stays";

  std::filesystem::remove_all(job_.work());
  bool failed = false;
  for (int i = 0; i < 1000 && !failed; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    try {
      look(views);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kNotFound) << error.what();
      failed = true;
    }
  }
  EXPECT_TRUE(failed) << "the folder is gone";
  EXPECT_EQ(views.known("job", now["digest"]), late) << "what was read is still served";
  EXPECT_EQ(views.known("job", std::string(32, '0')), nullptr);
  EXPECT_EQ(views.known("other", now["digest"]), nullptr);
  std::filesystem::create_directory(job_.work());
  write(WorkFolder::store_path(job_.work()), std::string(10000, 'x'));
  EXPECT_TRUE(failure() == ErrorCode::kCorrupt || failure() == ErrorCode::kInvalidInput);
  views.close("job");
  EXPECT_EQ(views.known("job", now["digest"]), nullptr);
}

TEST_F(PartialViewsTest, BeginAgainWithAnotherScene) {
  write_spheres(scene_, 3000);
  write(job_.subvolumes(), build(10));
  PartialViews views(system_files(), 1);
  const auto first = look(views);
  const auto before = nlohmann::json::parse(first->manifest({}));
  std::filesystem::remove_all(job_.work());
  // The old view is returned until the folder is read again. Then the error is kNotFound until the
  // folder has a new plan.
  ErrorCode code = ErrorCode::kInvalidInput;
  for (int i = 0; i < 1000 && code != ErrorCode::kNotFound; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    try {
      look(views);
    } catch (const Error& error) {
      code = error.code();
    }
  }
  ASSERT_EQ(code, ErrorCode::kNotFound);
  write_spheres(scene_, 500, 3);
  const std::string list = build(5);
  write(job_.subvolumes(), list);
  nlohmann::json now;
  for (int i = 0; i < 1000 && now.is_null(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    try {
      now = nlohmann::json::parse(look(views)->manifest({}));
    } catch (const Error&) {
    }
  }
  ASSERT_TRUE(now.is_object());
  EXPECT_NE(now["digest"], before["digest"]);
  EXPECT_NE(now["edge"], before["edge"]);
  EXPECT_EQ(now["edge"], nlohmann::json::parse(list)["edge"]);
  EXPECT_EQ(now["origin"], nlohmann::json::parse(list)["origin"]);
}

// A build keeps its job store in memory for its first seconds. Until the store has bytes, the view
// has the planned subvolumes, none of which is built.
TEST_F(PartialViewsTest, AreEmptyUntilTheBuildRecordsItsProgress) {
  write_spheres(scene_, 3000);
  const std::string list = build(10);
  const std::string away = folder_.file("away.db"), store = WorkFolder::store_path(job_.work());
  std::filesystem::rename(store, away);
  EXPECT_EQ(failure(), ErrorCode::kNotFound) << "no plan";
  write(job_.subvolumes(), list);
  PartialViews views(system_files(), 1);
  const auto plan = nlohmann::json::parse(list);
  const auto cubes = nlohmann::json::parse(views.json("job", job_, kResolution));
  EXPECT_EQ(cubes["built"], 0);
  EXPECT_EQ(cubes["total"], plan["total"]);
  EXPECT_TRUE(cubes["cubes"].empty());
  const auto empty = nlohmann::json::parse(look(views)->manifest({}));
  EXPECT_TRUE(empty["root"].is_null());
  EXPECT_EQ(empty["edge"], plan["edge"]);
  write(store, "");
  EXPECT_EQ(nlohmann::json::parse(PartialViews(system_files(), 1).json("job", job_, kResolution)),
            cubes);
  std::filesystem::rename(away, store);
  const auto some = look_until(views, [](const auto& now) { return now["root"].is_object(); });
  EXPECT_EQ(some->digest(), empty["digest"]);
}

TEST_F(PartialViewsTest, HaveAnotherDigestWhenMostNodesHaveNoRoot) {
  write_spheres(scene_, 3000);
  write(job_.subvolumes(), build(1));
  PartialViews views(system_files(), 1, 1);
  const auto early = look(views);
  const auto before = nlohmann::json::parse(early->manifest({}));
  build(-1);
  const auto late =
      look_until(views, [&](const auto& now) { return now["built"] == now["total"]; });
  const auto now = nlohmann::json::parse(late->manifest({}));
  EXPECT_NE(now["digest"], before["digest"]) << "more than twice the nodes of before";
  EXPECT_EQ(late->digest(), now["digest"]);
  EXPECT_EQ(early->digest(), before["digest"]);
  EXPECT_EQ(cells_of(late->dag(), now["root"]["offset"]),
            cells_of(query::DagView(voxdag_reader::File(job_.result())), 0));
}

TEST_F(PartialViewsTest, AreForgottenWhenNobodyAsksForThem) {
  write_spheres(scene_, 500);
  write(job_.subvolumes(), build(10));
  PartialViews views(system_files(), 1);
  const std::string digest = look(views)->digest();
  EXPECT_THROW(views.json("other", job_, kResolution), RequestError) << "the first is being viewed";
  EXPECT_THROW(views.json("waiting", JobFolder{folder_.file("none")}, kResolution), Error)
      << "has no place among them";
  EXPECT_NE(views.known("job", digest), nullptr);
  views.close_stale(60);
  EXPECT_NE(views.known("job", digest), nullptr);
  views.close_stale(-1);
  EXPECT_EQ(views.known("job", digest), nullptr);
  EXPECT_NO_THROW(views.json("other", job_, kResolution));
}

// Simulates a work folder that exists when it is checked, and is missing when it is read.
class VanishingFiles : public ForwardingFiles {
 public:
  VanishingFiles() : ForwardingFiles(system_files()) {}
  bool exists(const std::string&) override { return ++asked_ <= 2; }

 private:
  int asked_ = 0;
};

TEST_F(PartialViewsTest, OfAFolderThatVanishesAreNotFound) {
  VanishingFiles files;
  PartialViews views(files, 1);
  EXPECT_EQ(error_of([&] { look(views); }).code(), ErrorCode::kNotFound);
}

// A disk on which exists() waits for `go_on` if `hangs` is true.
class HangingFiles : public ForwardingFiles {
 public:
  HangingFiles() : ForwardingFiles(system_files()) {}
  bool exists(const std::string& path) override {
    if (hangs) {
      begun.count_down();
      go_on.wait();
    }
    return ForwardingFiles::exists(path);
  }

  std::atomic<bool> hangs{false};
  std::latch begun{1}, go_on{1};
};

TEST_F(PartialViewsTest, AreThereForOthersWhileOneReadsTheFolder) {
  write_spheres(scene_, 500);
  write(job_.subvolumes(), build(10));
  HangingFiles files;
  PartialViews views(files, 1);
  const auto first = look(views);
  files.hangs = true;
  std::jthread reader([&] {
    while (!files.begun.try_wait()) look(views);
  });
  files.begun.wait();
  EXPECT_EQ(look(views), first);
  EXPECT_EQ(views.known("job", first->digest()), first);
  files.hangs = false;
  files.go_on.count_down();
}

TEST_F(PartialViewsTest, RefuseAListOfOtherCubes) {
  write_spheres(scene_, 500);
  const auto list = nlohmann::json::parse(build(10));
  for (const auto& cube : std::vector<std::vector<int64_t>>{{0, 0, 0, 2048, 1},
                                                            {0, 0, 0, 0, 1},
                                                            {0, 0, 0, 96, 1},
                                                            {0, 0, 0, 2, 1},
                                                            {0, 32, 0, 64, 1},
                                                            {0, 0, 1024, 64, 1},
                                                            {-64, 0, 0, 64, 1}}) {
    auto bad = list;
    bad["cubes"] = {cube};
    write(job_.subvolumes(), bad.dump());
    EXPECT_EQ(failure(), ErrorCode::kCorrupt) << bad["cubes"];
  }
}

}  // namespace
}  // namespace voxdag::server
