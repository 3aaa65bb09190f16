#include "scheduler/state/job_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "core/base/error.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

class JobStoreTest : public testing::Test {
 protected:
  std::string path() const { return folder_.path() + "/job.db"; }
  static std::vector<StoredSubvolume> plan(size_t count) {
    std::vector<StoredSubvolume> plan(count);
    for (size_t i = 0; i < count; ++i) {
      plan[i].cube = {3, {static_cast<uint32_t>(i), 1, 2}};
      plan[i].weight = static_cast<double>(10 * i);
    }
    return plan;
  }
  static StoredSubvolume built(const StoredSubvolume& planned) {
    StoredSubvolume s = planned;
    s.artifact = {7, 1ull << 40, 12345, (1ull << 40) + 99, 0xfedcba9876543210ull};
    s.summary = {1ull << 50, 1ull << 45, 77, 0x8000000000000001ull};
    return s;
  }

  TemporaryFolder folder_;
  const JobIdentity job_{"abc", "{\"resolution\":4}", 1};
};

// When the store is opened again, all recorded rows exist with unchanged numbers.
TEST_F(JobStoreTest, RemembersJobPlanAndResults) {
  {
    JobStore store(path(), JobStore::Access::kBuild);
    EXPECT_FALSE(store.job().has_value());
    store.start(job_, plan(3));
    store.record_built(std::vector{built(store.leaves()[1])});
    store.add_stage_time({"build", 1.5, 2.5, 0.25});
  }
  JobStore store(path(), JobStore::Access::kBuild);
  EXPECT_EQ(store.job(), job_);
  const auto leaves = store.leaves();
  ASSERT_EQ(leaves.size(), 3u);
  EXPECT_EQ(leaves[0].state, SubvolumeState::kPlanned);
  EXPECT_EQ(leaves[1].state, SubvolumeState::kBuilt);
  const StoredSubvolume expected = built(leaves[1]);
  EXPECT_EQ(leaves[1].artifact, expected.artifact);
  EXPECT_EQ(leaves[1].summary.voxels, expected.summary.voxels);
  EXPECT_EQ(leaves[1].summary.root_hash, expected.summary.root_hash);
  EXPECT_EQ(leaves[2].weight, 20);
  ASSERT_EQ(store.stage_times().size(), 1u);
  EXPECT_EQ(store.stage_times()[0].cpu_s, 2.5);
  EXPECT_EQ(store.stage_times()[0].largest_thread_share, 0.25);
}

// A store that is opened with kBuildLater keeps its rows in memory until a row must survive the
// process. Then it creates its file, which also has all earlier rows. Before that, it makes the
// names of the folder durable.
TEST_F(JobStoreTest, CreatesItsFileWhenARowMustSurvive) {
  int synced = 0;
  {
    JobStore store(path(), JobStore::Access::kBuildLater, [&] {
      EXPECT_FALSE(std::filesystem::exists(path()));
      ++synced;
    });
    store.start(job_, plan(3));
    store.add_stage_time({"scan", 1.5, 2.5, 0.25});
    store.add_warning({"code", "place", "message"});
    store.record_result({});
    EXPECT_TRUE(store.is_in_memory());
    EXPECT_FALSE(std::filesystem::exists(path()));
    EXPECT_EQ(synced, 0);
    store.record_built(std::vector{built(store.leaves()[1])});
    EXPECT_FALSE(store.is_in_memory());
    EXPECT_EQ(synced, 1);
    // Other processes can now read the rows; this object writes later rows to the file.
    EXPECT_EQ(JobStore(path(), JobStore::Access::kRead).leaves()[1].state, SubvolumeState::kBuilt);
    store.add_stage_time({"build", 1, 1, 1});
  }
  JobStore store(path(), JobStore::Access::kBuildLater);
  EXPECT_FALSE(store.is_in_memory());
  EXPECT_EQ(store.job(), job_);
  EXPECT_EQ(store.leaves().size(), 3u);
  EXPECT_EQ(store.stage_times().size(), 2u);
  EXPECT_EQ(store.warnings().size(), 1u);
  EXPECT_TRUE(store.result());
}

// Each of these calls creates the file.
TEST_F(JobStoreTest, CheckpointsAndProgressCreateTheFile) {
  const std::function<void(JobStore&)> calls[] = {[](JobStore& store) { store.save_ingest({}); },
                                                  [](JobStore& store) { store.save_merge(1, {}); },
                                                  [](JobStore& store) { store.set_progress({}); },
                                                  [](JobStore& store) { store.move_to_disk(); }};
  for (const auto& call : calls) {
    JobStore store(path(), JobStore::Access::kBuildLater);
    EXPECT_TRUE(store.is_in_memory());
    call(store);
    EXPECT_FALSE(store.is_in_memory());
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path() + suffix);
  }
}

// A subvolume that is built but not recorded has the state kPlanned again after
// forget_built_in_memory(). A recorded subvolume remains built.
TEST_F(JobStoreTest, ForgetsWhatIsBuiltInMemoryOnly) {
  JobStore store(path(), JobStore::Access::kBuild);
  store.start(job_, plan(2));
  const auto planned = store.leaves();
  store.record_built(std::vector{built(planned[0])});
  store.mark_built_in_memory(std::vector{built(planned[1])});
  EXPECT_EQ(store.leaves()[1].state, SubvolumeState::kBuilt);
  store.forget_built_in_memory();
  EXPECT_EQ(store.leaves()[0].state, SubvolumeState::kBuilt);
  EXPECT_EQ(store.leaves()[1].state, SubvolumeState::kPlanned);
}

// A split replaces a subvolume with its parts, and a lost subvolume is planned again. Both changes
// are recorded.
TEST_F(JobStoreTest, RecordsSplitsAndLosses) {
  JobStore store(path(), JobStore::Access::kBuild);
  store.start(job_, plan(2));
  const StoredSubvolume whole = store.leaves()[0];
  const std::vector<Cube> parts = {whole.cube.child(0), whole.cube.child(5)};
  const auto ids = store.record_split(whole, parts);
  ASSERT_EQ(ids.size(), 2u);
  auto leaves = store.leaves();
  ASSERT_EQ(leaves.size(), 3u);
  EXPECT_EQ(leaves[1].cube, parts[0]);
  EXPECT_EQ(leaves[2].id, ids[1]);
  store.record_built(std::vector{built(leaves[2])});
  store.mark_for_rebuild(store.leaves()[2]);
  leaves = store.leaves();
  EXPECT_EQ(leaves[2].state, SubvolumeState::kPlanned);
  EXPECT_EQ(leaves[2].cube, parts[1]);
  EXPECT_TRUE(leaves[2].summary.empty());
}

// Until a built subvolume is recorded, other processes see it as planned. If a subvolume is marked
// for rebuild, all processes see it as planned.
TEST_F(JobStoreTest, BuiltInMemoryIsKnownToTheWriterOnly) {
  JobStore store(path(), JobStore::Access::kBuild);
  store.start(job_, plan(3));
  std::vector<StoredSubvolume> announced;
  for (const StoredSubvolume& leaf : store.leaves()) announced.push_back(built(leaf));
  const auto states = [](JobStore& of) {
    std::vector<SubvolumeState> found;
    for (const StoredSubvolume& leaf : of.leaves()) found.push_back(leaf.state);
    return found;
  };
  constexpr auto kPlanned = SubvolumeState::kPlanned, kBuilt = SubvolumeState::kBuilt;
  const auto seen = [&] {
    JobStore looker(path(), JobStore::Access::kRead);
    return states(looker);
  };
  store.mark_built_in_memory(announced);
  EXPECT_EQ(states(store), std::vector(3, kBuilt));
  EXPECT_EQ(store.leaves()[2].artifact, announced[2].artifact);
  EXPECT_EQ(seen(), std::vector(3, kPlanned));
  store.record_built({announced.data(), 1});
  store.mark_for_rebuild(announced[1]);
  EXPECT_EQ(states(store), (std::vector{kBuilt, kPlanned, kBuilt}));
  EXPECT_EQ(seen(), (std::vector{kBuilt, kPlanned, kPlanned}));
  store.start(job_, plan(3));
  EXPECT_EQ(states(store), std::vector(3, kPlanned));
}

// A new job replaces the old one with all its rows.
TEST_F(JobStoreTest, StartingOverForgets) {
  JobStore store(path(), JobStore::Access::kBuild);
  store.start(job_, plan(5));
  store.record_split(store.leaves()[3], std::vector{store.leaves()[3].cube.child(1)});
  const JobIdentity other{"def", "{}", 1};
  store.start(other, plan(2));
  EXPECT_EQ(store.job(), other);
  EXPECT_EQ(store.leaves().size(), 2u);
}

// A file that is not a job store, or has another version, is refused. The error names the kind or
// the version.
TEST_F(JobStoreTest, RefusesWhatIsNotItsOwn) {
  std::ofstream(path()) << "this is no database at all, whatever its name may say";
  try {
    JobStore store(path(), JobStore::Access::kBuild);
    FAIL() << "opened a text file";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.what();
    EXPECT_NE(error.message().find("--restart"), std::string::npos) << error.what();
  }
  std::remove(path().c_str());
  SqlDatabase(path(), SqlDatabase::Mode::kReadWrite).execute("CREATE TABLE t (a)");
  try {
    JobStore store(path(), JobStore::Access::kBuild);
    FAIL() << "opened somebody else's database";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput) << error.what();
  }
  std::remove(path().c_str());
  { JobStore store(path(), JobStore::Access::kBuild); }
  SqlDatabase(path(), SqlDatabase::Mode::kReadWrite).execute("PRAGMA user_version = 99");
  try {
    JobStore store(path(), JobStore::Access::kBuild);
    FAIL() << "opened a store of version 99";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnsupportedVersion) << error.what();
  }
}

// A store of an earlier version is refused, for building and for reading, and is not changed.
TEST_F(JobStoreTest, RefusesAnEarlierVersion) {
  {
    JobStore store(path(), JobStore::Access::kBuild);
    store.start(job_, plan(3));
  }
  const auto set_version = [&](const std::string& version) {
    SqlDatabase(path(), SqlDatabase::Mode::kReadWrite).execute("PRAGMA user_version = " + version);
  };
  set_version("3");
  for (const auto access : {JobStore::Access::kBuild, JobStore::Access::kRead}) try {
      JobStore store(path(), access);
      FAIL() << "opened a store of version 3";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnsupportedVersion);
      EXPECT_NE(error.message().find("--restart"), std::string::npos) << error.message();
    }
  set_version("9");
  EXPECT_EQ(JobStore(path(), JobStore::Access::kRead).leaves().size(), 3u);
}

// The store keeps, replaces and forgets the state of an unfinished merge and the merge's result. A
// new job has neither.
TEST_F(JobStoreTest, RemembersTheMerge) {
  const std::vector<std::byte> state = {std::byte{0}, std::byte{7}, std::byte{255}};
  JobResult result{"out", "sha", 1ull << 40, {}, "colors"};
  result.merge.voxels = 2;
  result.merge.streamed_groups = 7;
  JobStore store(path(), JobStore::Access::kBuild);
  store.start(job_, plan(1));
  EXPECT_FALSE(store.merge().has_value());
  EXPECT_FALSE(store.result().has_value());
  store.save_merge(9, state);
  store.save_merge(3, state);
  store.record_result(result);
  ASSERT_TRUE(store.merge().has_value());
  EXPECT_EQ(store.merge()->level, 3u);
  EXPECT_EQ(store.merge()->state, state);
  ASSERT_TRUE(store.result().has_value());
  EXPECT_EQ(store.result()->bytes, result.bytes);
  EXPECT_EQ(store.result()->merge.streamed_groups, 7u);
  EXPECT_EQ(store.result()->sections, "colors");
  store.forget_merge();
  EXPECT_FALSE(store.merge().has_value());
  EXPECT_FALSE(store.result().has_value());
  store.save_merge(3, state);
  store.start(job_, plan(1));
  EXPECT_FALSE(store.merge().has_value());
}

// SQLite does not detect a damaged row, so each row has a checksum, which detects the damage.
TEST_F(JobStoreTest, NoticesARowThatChanged) {
  for (const char* change : {"x = x + 1", "state = 1", "voxels = 12", "checksum = checksum + 1"}) {
    SCOPED_TRACE(change);
    JobStore store(path(), JobStore::Access::kBuild);
    store.start(job_, plan(2));
    SqlDatabase(path(), SqlDatabase::Mode::kReadWrite)
        .execute("UPDATE subvolume SET " + std::string(change) + " WHERE id = 2");
    try {
      store.leaves();
      FAIL() << "read a changed row";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_NE(error.message().find("subvolume 2"), std::string::npos) << error.what();
    }
  }
}

// The checksums of the rows of the job, the merge and the result detect changes.
TEST_F(JobStoreTest, NoticesAChangeInAnyRowThatDecides) {
  struct Change {
    const char* sql;
    std::function<void(JobStore&)> read;
  };
  for (const Change& change :
       {Change{"UPDATE job SET scene_digest = 'abd'", [](JobStore& s) { s.job(); }},
        Change{"UPDATE job SET subvolumes = 1", [](JobStore& s) { s.leaves(); }},
        Change{"UPDATE merge SET level = 4", [](JobStore& s) { s.merge(); }},
        Change{"UPDATE result SET sha256 = 'sho'", [](JobStore& s) { s.result(); }}}) {
    SCOPED_TRACE(change.sql);
    JobStore store(path(), JobStore::Access::kBuild);
    store.start(job_, plan(2));
    store.save_merge(5, {});
    store.record_result({"out", "sha", 1, {}, ""});
    EXPECT_NO_THROW(change.read(store));
    SqlDatabase(path(), SqlDatabase::Mode::kReadWrite).execute(change.sql);
    EXPECT_EQ(error_of([&] { change.read(store); }).code(), ErrorCode::kCorrupt);
    store.start(job_, plan(2));
    EXPECT_NO_THROW(change.read(store));
  }
}

// The store detects missing rows of subvolumes: the first, some in the middle, the last, or all.
// The file would otherwise lack the voxels of these subvolumes.
TEST_F(JobStoreTest, NoticesMissingRows) {
  for (const char* missing : {"id = 1", "id % 2 = 0", "id = 6", "id = 7", "id > 0"}) {
    SCOPED_TRACE(missing);
    JobStore store(path(), JobStore::Access::kBuild);
    store.start(job_, plan(5));
    const StoredSubvolume whole = store.leaves()[4];
    store.record_split(whole, std::vector{whole.cube.child(0), whole.cube.child(5)});
    EXPECT_EQ(store.leaves().size(), 6u);
    SqlDatabase(path(), SqlDatabase::Mode::kReadWrite)
        .execute("PRAGMA foreign_keys = OFF; DELETE FROM subvolume WHERE " + std::string(missing));
    const Error error = error_of([&] { store.leaves(); });
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_NE(error.message().find("--restart"), std::string::npos) << error.message();
  }
}

// Another connection can read while the builder's connection is open, but cannot write.
TEST_F(JobStoreTest, CanBeReadDuringABuild) {
  JobStore builder(path(), JobStore::Access::kBuild);
  builder.start(job_, plan(2));
  JobStore looker(path(), JobStore::Access::kRead);
  EXPECT_EQ(looker.leaves().size(), 2u);
  ProgressSnapshot progress;
  progress.stage = "build";
  progress.done = 1;
  builder.set_progress(progress);
  ASSERT_TRUE(looker.progress().has_value());
  EXPECT_EQ(looker.progress()->done, 1u);
  EXPECT_THROW(looker.set_progress(progress), Error);
}

// When a job starts, the stored progress of ingest remains. The store removes it on request, and
// when an artifact is lost after the triangles of its subvolume were released. A damaged row is
// detected.
TEST_F(JobStoreTest, RemembersTheProgressOfIngest) {
  const std::vector<std::byte> record = {std::byte{3}, std::byte{0}, std::byte{200}};
  JobStore store(path(), JobStore::Access::kBuild);
  EXPECT_FALSE(store.ingest().has_value());
  store.save_ingest({});
  store.save_ingest(record);
  store.start(job_, plan(2));
  EXPECT_EQ(store.ingest(), record);
  store.record_built(std::vector{built(store.leaves()[1])});
  EXPECT_EQ(store.ingest(), record);
  store.mark_for_rebuild(store.leaves()[1]);
  EXPECT_FALSE(store.ingest().has_value());
  store.save_ingest(record);
  store.forget_ingest();
  EXPECT_FALSE(store.ingest().has_value());
  store.save_ingest(record);
  SqlDatabase(path(), SqlDatabase::Mode::kReadWrite)
      .execute("UPDATE ingest SET record = x'0301c8'");
  EXPECT_THROW(store.ingest(), Error);
}

}  // namespace
}  // namespace voxdag
