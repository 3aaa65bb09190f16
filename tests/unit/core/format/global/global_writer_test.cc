#include "core/format/global/global_writer.h"

#include <gmock/gmock.h>

#include <cstring>
#include <thread>

#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/core/format/watched_files.h"

namespace voxdag {
namespace {

using namespace global_layout;
using testing::HasSubstr;

class GlobalWriterTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  const std::string path_ = folder_.file("out.vdag");
};

template <class T>
T field(const ByteString& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

// Every field of the header has its documented offset. The words of every level are at the offset
// that the header gives, and equal the words of the oracle's DAG.
TEST_F(GlobalWriterTest, LaysOutWhatItIsGiven) {
  const oracle::Dag dag = oracle::build_dag(random_voxels(1, 64), 16);
  const Grid grid = grid_of(64);
  const GlobalFileSummary summary = write_global(path_, dag, grid, 16);
  const ByteString bytes = read_bytes(path_);
  EXPECT_EQ(summary.bytes, bytes.size());
  Sha256 digest;
  digest.add(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(summary.sha256, digest.finish());

  EXPECT_EQ(bytes.substr(0, 8), "\x89VDAG\n\x1a\n");
  EXPECT_EQ(field<uint32_t>(bytes, kVersionAt), 1u);
  EXPECT_EQ(field<uint32_t>(bytes, kGridLevelsAt), 6u);
  EXPECT_EQ(field<uint32_t>(bytes, kHashBitsAt), 16u);
  EXPECT_EQ(field<uint32_t>(bytes, kNodeOrderAt), 1u);
  for (size_t axis = 0; axis < 3; ++axis)
    EXPECT_EQ(field<double>(bytes, kOriginAt + 8 * axis), grid.origin[axis]);
  EXPECT_EQ(field<double>(bytes, kEdgeAt), grid.edge);
  EXPECT_EQ(field<uint64_t>(bytes, kVoxelsAt), dag.voxels);
  EXPECT_EQ(field<uint64_t>(bytes, kSvoNodesAt), dag.svo_nodes);
  EXPECT_EQ(field<uint64_t>(bytes, kDagNodesAt), dag.dag_nodes);
  EXPECT_EQ(field<uint64_t>(bytes, kFileBytesAt), bytes.size());

  uint64_t end = kPageBytes;
  const auto levels = level_words(dag);
  for (size_t i = 0; i < levels.size(); ++i) {
    const size_t entry = kLevelsAt + (4 - i) * kLevelEntryBytes;
    const uint64_t offset = field<uint64_t>(bytes, entry);
    EXPECT_EQ(offset, end);
    EXPECT_EQ(field<uint64_t>(bytes, entry + 8),
              i == 0 ? dag.bricks.size() : dag.levels[i - 1].size());
    ASSERT_EQ(field<uint64_t>(bytes, entry + 16), levels[i].size());
    const size_t size = 4 * levels[i].size();
    EXPECT_EQ(std::memcmp(bytes.data() + offset, levels[i].data(), size), 0) << "level " << 4 - i;
    end = round_up_to_page(offset + size);
    EXPECT_GE(bytes.find_first_not_of('\0', offset + size), end) << "padding";
  }
  EXPECT_EQ(field<uint64_t>(bytes, kTableOffsetAt), end);
  EXPECT_EQ(bytes.size() - end,
            8 * ((end - kPageBytes + kChecksumBlockBytes - 1) / kChecksumBlockBytes));
}

// The file is the same if its words are written from back to front, in small chunks, and by several
// threads.
TEST_F(GlobalWriterTest, OrderAndThreadsDoNotShow) {
  const oracle::Dag dag = oracle::build_dag(random_voxels(2, 128), 64);
  const GlobalFileSummary expected = write_global(path_, dag, grid_of(128));
  const ByteString bytes = read_bytes(path_);
  GlobalFileWriter writer(system_files(), path_, grid_of(128), 64);
  const auto levels = level_words(dag);
  for (size_t i = 0; i < levels.size(); ++i) {
    writer.begin_level(static_cast<uint32_t>(5 - i));
    const std::span<const uint32_t> words = levels[i];
    writer.checksum_words(words);
    std::vector<std::thread> threads;
    for (size_t t = 0; t < 3; ++t)
      threads.emplace_back([&, t] {
        const size_t pieces = (words.size() + 6) / 7;
        for (size_t p = pieces; p-- > 0;)
          if (p % 3 == t)
            writer.write_words(7 * p,
                               words.subspan(7 * p, std::min<size_t>(7, words.size() - 7 * p)));
      });
    for (std::thread& thread : threads) thread.join();
    writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), words.size()});
  }
  EXPECT_EQ(writer.finish({dag.voxels, dag.svo_nodes}).sha256, expected.sha256);
  EXPECT_EQ(read_bytes(path_), bytes);
}

// The file of a scene without voxels has only the header page.
TEST_F(GlobalWriterTest, EmptySceneIsAHeaderPage) {
  EXPECT_EQ(write_global(path_, oracle::Voxels(16)).bytes, kPageBytes);
  EXPECT_EQ(read_bytes(path_).size(), kPageBytes);
}

// A writer that is destroyed before finish() leaves no file. An existing file with the final name
// is kept.
TEST_F(GlobalWriterTest, UnfinishedFilesVanish) {
  write_bytes(path_, "before");
  {
    GlobalFileWriter writer(system_files(), path_, grid_of(8), 64);
    writer.begin_level(1);
    EXPECT_TRUE(system_files().exists(path_ + ".partial"));
  }
  EXPECT_FALSE(system_files().exists(path_ + ".partial"));
  EXPECT_EQ(read_bytes(path_), "before");
}

// The header is written last. All bytes are durable before the file gets its final name, and then
// the name becomes durable.
TEST_F(GlobalWriterTest, IsDurableBeforeItIsNamed) {
  WatchedFiles files;
  GlobalFileWriter(files, path_, grid_of(16), 64).finish({0, 0});
  const std::vector<std::string> expected = {"create " + path_ + ".partial",
                                             "write 0 4096",
                                             "sync",
                                             "close",
                                             "rename " + path_,
                                             "sync directory"};
  EXPECT_EQ(files.log, expected);
}

// If any call fails, the file with the final name is complete or missing, and no partial file
// remains.
TEST_F(GlobalWriterTest, EveryFailureLeavesNothingHalf) {
  const oracle::Dag dag = oracle::build_dag(random_voxels(3, 16), 64);
  const auto build = [&](FileSystem& files) {
    GlobalFileWriter writer(files, path_, grid_of(16), 64);
    const auto levels = level_words(dag);
    for (size_t i = 0; i < levels.size(); ++i) {
      writer.begin_level(static_cast<uint32_t>(2 - i));
      writer.checksum_words(levels[i]);
      writer.write_words(0, levels[i]);
      writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), levels[i].size()});
    }
    writer.finish({dag.voxels, dag.svo_nodes});
  };
  WatchedFiles clean;
  build(clean);
  const ByteString whole = read_bytes(path_);
  for (size_t call = 0; call < clean.log.size(); ++call) {
    SCOPED_TRACE(clean.log[call]);
    std::filesystem::remove(path_);
    WatchedFiles files;
    files.fail_at = call;
    EXPECT_EQ(error_of([&] { build(files); }).code(), ErrorCode::kNoSpace);
    EXPECT_FALSE(system_files().exists(path_ + ".partial"));
    EXPECT_TRUE(!system_files().exists(path_) || read_bytes(path_) == whole);
  }
}

// After any number of levels, a writer can sync its file and be replaced by a new writer that
// resumes the file. The bytes are the same as from a single writer. Some levels end within a
// checksum block, and some checksum blocks end within a level.
TEST_F(GlobalWriterTest, ResumesAfterAnyLevel) {
  oracle::Random random(4);
  oracle::Voxels voxels(128);
  for (int i = 0; i < 60000; ++i) {
    const auto coordinate = [&] { return static_cast<int>(random.between(0, 127)); };
    voxels.set(coordinate(), coordinate(), coordinate());
  }
  const oracle::Dag dag = oracle::build_dag(voxels, 64);
  const std::string expected = write_global(path_, dag, grid_of(128)).sha256;
  const auto levels = level_words(dag);
  ASSERT_GT(levels[0].size() * sizeof(uint32_t), kChecksumBlockBytes);
  const auto write_level = [&](GlobalFileWriter& writer, size_t i) {
    writer.begin_level(static_cast<uint32_t>(5 - i));
    writer.checksum_words(levels[i]);
    writer.write_words(0, levels[i]);
    writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), levels[i].size()});
  };
  for (size_t done = 1; done <= levels.size(); ++done) {
    SCOPED_TRACE(done);
    GlobalFileProgress saved;
    {
      GlobalFileWriter writer(system_files(), path_, grid_of(128), 64);
      for (size_t i = 0; i < done; ++i) write_level(writer, i);
      writer.sync();
      saved = writer.progress();
      if (done < levels.size()) writer.begin_level(static_cast<uint32_t>(5 - done));
    }
    GlobalFileWriter writer(system_files(), path_, grid_of(128), 64);
    writer.resume(saved);
    for (size_t i = done; i < levels.size(); ++i) write_level(writer, i);
    EXPECT_EQ(writer.finish({dag.voxels, dag.svo_nodes}).sha256, expected);
  }
}

// The disk flips a bit of the partial file. seal() detects this anywhere in the file. resume()
// detects it in the last, incomplete checksum block, and also detects a truncated file.
TEST_F(GlobalWriterTest, NoticesWhatTheDiskChanged) {
  const oracle::Dag dag = oracle::build_dag(random_voxels(5, 32), 64);
  const auto levels = level_words(dag);
  const std::string partial = path_ + ".partial";
  const auto write = [&](GlobalFileWriter& writer) {
    for (size_t i = 0; i < levels.size(); ++i) {
      writer.begin_level(static_cast<uint32_t>(3 - i));
      writer.checksum_words(levels[i]);
      writer.write_words(0, levels[i]);
      writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), levels[i].size()});
    }
  };
  uint64_t at = kPageBytes;
  for (size_t i = 0; i < levels.size(); ++i) {
    SCOPED_TRACE(i);
    GlobalFileWriter writer(system_files(), path_, grid_of(32), 64);
    write(writer);
    writer.frame({dag.voxels, dag.svo_nodes});  // writes the levels to the file
    ByteString bytes = read_bytes(partial);
    bytes[at + 4 * (levels[i].size() / 2)] ^= 16;
    write_bytes(partial, bytes);
    const Error error = error_of([&] { writer.seal({dag.voxels, dag.svo_nodes}); });
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_THAT(error.message(), HasSubstr("differs from the bytes that this build wrote"));
    at += (4 * levels[i].size() + kPageBytes - 1) / kPageBytes * kPageBytes;
  }
  GlobalFileProgress saved;
  {
    GlobalFileWriter writer(system_files(), path_, grid_of(32), 64);
    write(writer);
    writer.sync();
    saved = writer.progress();
  }
  ByteString bytes = read_bytes(partial);
  bytes[at - kPageBytes] ^= 1;  // in the last, incomplete checksum block
  write_bytes(partial, bytes);
  GlobalFileWriter writer(system_files(), path_, grid_of(32), 64);
  EXPECT_EQ(error_of([&] { writer.resume(saved); }).code(), ErrorCode::kCorrupt);
  std::filesystem::resize_file(partial, at - 1);
  EXPECT_EQ(error_of([&] { writer.resume(saved); }).code(), ErrorCode::kCorrupt);
}

// A level of over 2^40 words causes a kLimit error that names the level, in each function that
// checks the size.
TEST_F(GlobalWriterTest, LevelsOverTheLimitAreRefused) {
  GlobalFileWriter writer(system_files(), path_, grid_of(16), 64);
  writer.begin_level(2);
  const uint32_t words[2] = {1, 0};
  const Error on_write = error_of([&] { writer.write_words(kMaxLevelWords - 1, words); });
  EXPECT_EQ(on_write.code(), ErrorCode::kLimit);
  EXPECT_THAT(on_write.message(), HasSubstr("level 2"));
  const Error on_end = error_of([&] {
    writer.end_level({kMaxLevelWords / 2 + 1, kMaxLevelWords + 2});
  });
  EXPECT_EQ(on_end.code(), ErrorCode::kLimit);
  EXPECT_THAT(on_end.message(), HasSubstr("level 2"));
}

// A file is refused if its levels do not come in the order from the bricks to the root, or if a
// level is incomplete.
TEST_F(GlobalWriterTest, LevelsOutOfTurnAreRefused) {
  GlobalFileWriter writer(system_files(), path_, grid_of(16), 64);
  EXPECT_THROW(writer.begin_level(1), Error);
  writer.begin_level(2);
  EXPECT_THROW(writer.begin_level(1), Error);
  EXPECT_THROW(writer.end_level({0, 0}), Error);
  const uint32_t brick[2] = {1, 0};
  writer.checksum_words(brick);
  writer.write_words(0, brick);
  writer.end_level({1, 2});
  EXPECT_THROW(writer.finish({1, 3}), Error);
}

}  // namespace
}  // namespace voxdag
