// An interrupted merge resumes from its saved state and gives the same bytes. A damaged state is
// detected; then the merge starts over, or reports that its inputs are missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <fstream>
#include <mutex>

#include "merge/checkpoint/merge_state.h"
#include "tests/unit/merge/merge_harness.h"

namespace voxdag {
namespace {

void change_byte(const std::string& path, uint64_t at, char change) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(at));
  const char byte = static_cast<char>(file.get() ^ change);
  file.seekp(static_cast<std::streamoff>(at));
  file.put(byte);
}

// Stores the state in memory. Simulates that the process is killed at the save number `die_at`,
// just before or just after the state is durable.
class DyingCheckpoint : public Checkpoint {
 public:
  explicit DyingCheckpoint(std::string segment = "") : segment_(std::move(segment)) {}
  std::optional<std::vector<std::byte>> load() override { return state; }
  void save(uint32_t level, std::span<const std::byte> bytes) override {
    if (saves + 1 == die_at && die_before) throw Error(ErrorCode::kIo, "the process dies here");
    state.emplace(bytes.begin(), bytes.end());
    levels.push_back(level);
    if (++saves == die_at) throw Error(ErrorCode::kIo, "the process dies here");
  }
  void forget() override {
    state.reset();
    ++forgotten;
  }
  // If the constructor got the path of a segment, overwrites the released bytes in this segment
  // with zeros.
  void release(const SegmentRange& range) override {
    if (segment_.empty()) return;
    std::fstream file(segment_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(range.offset));
    file << std::string(range.bytes, '\0');
    released += range.bytes;
  }

  std::optional<std::vector<std::byte>> state;
  std::vector<uint32_t> levels;
  bool die_before = false;
  uint64_t saves = 0, die_at = 0, forgotten = 0, released = 0;

 private:
  const std::string segment_;
};

struct Case {
  const char* name;
  uint64_t budget_bytes;
  uint32_t hash_bits;
  uint32_t cubes_level;
  uint32_t passes;
};

class MergeResume : public testing::TestWithParam<Case> {
 protected:
  MergeOptions options(Checkpoint& checkpoint) const {
    return {.budget_bytes = GetParam().budget_bytes, .checkpoint = &checkpoint};
  }
};

// The merge is killed at every save in turn, including saves after it was resumed. It ends with the
// same bytes and counts, although the released bytes of its inputs were overwritten.
TEST_P(MergeResume, ResumesAfterEverySave) {
  const oracle::Voxels voxels = noise_voxels(31, 256);
  MergeHarness harness(8, GetParam().hash_bits);
  harness.add(voxels, equal_cubes(GetParam().cubes_level));
  const Merged whole = harness.merge({.budget_bytes = GetParam().budget_bytes});
  EXPECT_EQ(whole.report.passes, GetParam().passes);

  DyingCheckpoint checkpoint(harness.segment());
  uint64_t deaths = 0;
  for (;; ++deaths) {
    ASSERT_LT(deaths, 100u);
    checkpoint.die_before = deaths % 2 == 1;
    checkpoint.die_at = checkpoint.saves + 1 + checkpoint.die_before;
    try {
      const Merged merged = harness.merge(options(checkpoint));
      EXPECT_EQ(merged.file.sha256, whole.file.sha256);
      EXPECT_EQ(merged.report.voxels, whole.report.voxels);
      EXPECT_EQ(merged.report.svo_nodes, whole.report.svo_nodes);
      EXPECT_EQ(merged.report.dag_nodes, whole.report.dag_nodes);
      break;
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::kIo) << error.what();
    }
  }
  EXPECT_GE(deaths, 7u);  // at least one for each of the 7 levels
  EXPECT_EQ(checkpoint.forgotten, 0u);
  EXPECT_TRUE(checkpoint.released > 0 || whole.report.passes > 1);
  EXPECT_TRUE(std::ranges::is_sorted(checkpoint.levels, std::greater()));
  EXPECT_EQ(checkpoint.levels.back(), 0u);
}

// The merge resumes with more or less memory than before, also after completed passes.
TEST_P(MergeResume, ResumesWithOtherMemory) {
  const oracle::Voxels voxels = noise_voxels(32, 256);
  MergeHarness harness(8, GetParam().hash_bits);
  harness.add(voxels, equal_cubes(GetParam().cubes_level));
  MergeOptions other;
  other.budget_bytes = GetParam().passes > 1 ? 64 * kMiB : GetParam().budget_bytes * 3 / 2;
  other.threads = 1;
  const std::string expected = harness.merge(other).file.sha256;
  for (const uint64_t die_at : {1u, 2u, 4u}) {
    SCOPED_TRACE(die_at);
    DyingCheckpoint checkpoint;
    checkpoint.die_at = die_at;
    EXPECT_THROW(harness.merge(options(checkpoint)), Error);
    other.checkpoint = &checkpoint;
    EXPECT_EQ(harness.merge(other).file.sha256, expected);
    EXPECT_EQ(checkpoint.forgotten, 0u);
  }
}

// Like ResumesAfterEverySave, but a thread saves states in the background, as often as it can.
TEST_P(MergeResume, ResumesAfterBackgroundSaves) {
  const oracle::Voxels voxels = noise_voxels(35, 256);
  MergeHarness harness(8, GetParam().hash_bits);
  harness.add(voxels, equal_cubes(GetParam().cubes_level));
  const std::string expected = harness.merge({.budget_bytes = GetParam().budget_bytes}).file.sha256;
  DyingCheckpoint checkpoint(harness.segment());
  MergeOptions background = options(checkpoint);
  background.checkpoint_interval_s = 1e-9;
  uint64_t deaths = 0;
  for (std::string sha256; sha256 != expected; ++deaths) {
    ASSERT_LT(deaths, 100u);
    checkpoint.die_before = deaths % 2 == 1;
    checkpoint.die_at = checkpoint.saves + 1 + checkpoint.die_before;
    try {
      sha256 = harness.merge(background).file.sha256;
      ASSERT_EQ(sha256, expected);
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::kIo) << error.what();
    }
  }
  EXPECT_GE(deaths, 2u);
  EXPECT_EQ(checkpoint.forgotten, 0u);
}

// The merge continues while a state is saved. In this test, the first save waits until the next
// level is merged, and the merge of that level waits until the save has begun.
TEST(MergeCheckpoint, TheMergeContinuesWhileAStateIsSaved) {
  MergeHarness harness(8, 64);
  harness.add(noise_voxels(36, 256), equal_cubes(1));
  const std::string expected = harness.merge().file.sha256;
  struct Meeting {
    // Marks one side as arrived. Returns true once both have arrived, or false after 20 s.
    bool meet(bool& here, const bool& there) {
      std::unique_lock lock(mutex);
      here = true;
      changed.notify_all();
      return changed.wait_for(lock, std::chrono::seconds(20), [&] { return there; });
    }
    std::mutex mutex;
    std::condition_variable changed;
    bool saving = false, merging = false;
  } meeting;
  struct MeetingCheckpoint : DyingCheckpoint {
    explicit MeetingCheckpoint(Meeting& with) : meeting(with) {}
    void save(uint32_t level, std::span<const std::byte> bytes) override {
      met = meeting.meet(meeting.saving, meeting.merging) && met;
      DyingCheckpoint::save(level, bytes);
    }
    Meeting& meeting;
    bool met = true;
  } checkpoint(meeting);
  struct MeetingProgress : NoProgress {
    MeetingProgress(Meeting& with, std::string folder)
        : meeting(with), scratch_folder(std::move(folder)) {}
    // A file in the scratch folder shows that the merge has begun to save a state.
    void advance(uint64_t) override {
      if (std::filesystem::exists(scratch_folder) && !std::filesystem::is_empty(scratch_folder))
        meeting.meet(meeting.merging, meeting.saving);
    }
    Meeting& meeting;
    const std::string scratch_folder;
  } progress(meeting, harness.scratch_folder());
  const Merged merged = harness.merge(
      {.checkpoint = &checkpoint, .progress = &progress, .checkpoint_interval_s = 1e-9});
  EXPECT_EQ(merged.file.sha256, expected);
  EXPECT_GT(checkpoint.saves, 0u);
  EXPECT_TRUE(checkpoint.met);
}

INSTANTIATE_TEST_SUITE_P(Ways, MergeResume,
                         testing::Values(Case{"AtOnce", 1024 * kMiB, 64, 1, 1},
                                         Case{"SpilledMaps", 5 * kMiB, 64, 1, 1},
                                         Case{"EqualHashes", 5 * kMiB, 4, 1, 1},
                                         Case{"ThreePasses", 8 * kMiB, 64, 3, 3}),
                         [](const auto& test) { return test.param.name; });

// In each case, a bit is flipped in a state, a position map, an intermediate artifact or the
// partial file, or the partial file is missing. The merge never writes a wrong DAG. If its inputs
// are still available, it starts over.
TEST(MergeDamage, DamageStartsOver) {
  const oracle::Voxels voxels = noise_voxels(33, 256);
  struct Way {
    uint64_t budget_bytes, die_at;
    uint32_t cubes_level;
  };
  for (const auto& [budget_bytes, die_at, cubes_level] :
       {Way{1024 * kMiB, 3, 1}, Way{5 * kMiB, 2, 1}, Way{8 * kMiB, 1, 3}}) {
    MergeHarness harness(8, 64);
    harness.add(voxels, equal_cubes(cubes_level));
    const std::string expected = harness.merge({.budget_bytes = budget_bytes}).file.sha256;
    std::vector<std::string> places = {"state"};
    for (size_t i = 0; i < places.size(); ++i)
      for (const bool gone : {false, true}) {
        DyingCheckpoint checkpoint;
        checkpoint.die_at = die_at;
        const MergeOptions options{.budget_bytes = budget_bytes, .checkpoint = &checkpoint};
        EXPECT_THROW(harness.merge(options), Error);
        if (i == 0 && !gone) {
          const MergeState state = decode_state(*checkpoint.state);
          if (!state.intermediates.empty())
            places.push_back(
                segment_path(harness.scratch_folder(), state.intermediates[0].segment));
          if (const auto& last = state.final_pass) {
            places.push_back(last->output + ".partial");
            places.push_back(harness.scratch_folder() + "/" + ScratchFile::name_of(last->map.id));
          }
        }
        SCOPED_TRACE(testing::Message() << places[i] << (gone ? " gone" : " changed") << ", "
                                        << budget_bytes << " bytes, died at " << die_at);
        if (i == 0 && gone) continue;
        if (i == 0)
          (*checkpoint.state)[checkpoint.state->size() / 2] ^= std::byte{4};
        else if (gone)
          std::filesystem::remove(places[i]);
        else
          change_byte(places[i], 4096 + 100, 4);
        // The merge detects the damage immediately and starts over, or it detects the damage when
        // it reads the bytes and fails. In the second case the next merge starts over.
        try {
          EXPECT_EQ(harness.merge(options).file.sha256, expected);
          EXPECT_EQ(checkpoint.forgotten, 1u);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.what();
          checkpoint.forget();
          EXPECT_EQ(harness.merge(options).file.sha256, expected);
        }
      }
    EXPECT_GT(places.size(), 1u);
  }
}

// A merge resumes if its input artifacts have the same content, even if they moved to other offsets
// or segments. With different inputs, it starts over.
TEST(MergeDamage, IdentifiesItsInputsByTheirContent) {
  const oracle::Voxels voxels = noise_voxels(34, 64);
  MergeHarness harness(6, 64);
  harness.add(voxels, equal_cubes(1));
  const std::string expected = harness.merge().file.sha256;
  DyingCheckpoint checkpoint;
  checkpoint.die_at = 2;
  EXPECT_THROW(harness.merge({.checkpoint = &checkpoint}), Error);
  harness.artifacts().clear();
  harness.add(voxels, equal_cubes(1));  // same content, behind the first artifacts
  EXPECT_EQ(harness.merge({.checkpoint = &checkpoint}).file.sha256, expected);
  EXPECT_EQ(checkpoint.forgotten, 0u);

  DyingCheckpoint other;
  other.die_at = 2;
  EXPECT_THROW(harness.merge({.checkpoint = &other}), Error);
  harness.artifacts().pop_back();
  EXPECT_NE(harness.merge({.checkpoint = &other}).file.sha256, expected);
  EXPECT_EQ(other.forgotten, 1u);
}

// Any prefix of a state, and any flipped bit, is refused.
TEST(MergeState, RefusesDamage) {
  MergeState state;
  state.inputs_checksum = 5;
  state.intermediates.push_back({1, 2, 3, 4, 5});
  state.final_pass.emplace();
  state.final_pass->output = "somewhere";
  state.final_pass->map_rows = {1, 2, 3};
  state.final_pass->roots.push_back({Cube{1, {0, 1, 0}}, 7, 8, 9, 10});
  const std::vector<std::byte> bytes = encode_state(state);
  EXPECT_EQ(encode_state(decode_state(bytes)), bytes);
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(decode_state(std::span(bytes).first(size)), Error);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::vector<std::byte> changed = bytes;
    changed[bit / 8] ^= std::byte{1} << bit % 8;
    EXPECT_THROW(decode_state(changed), Error);
  }
}

}  // namespace
}  // namespace voxdag
