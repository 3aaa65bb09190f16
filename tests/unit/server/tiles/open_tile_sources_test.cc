// Tests OpenTileSources: files that several viewers open, and that change while they are open.
#include "server/tiles/open_tile_sources.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <latch>
#include <thread>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag::server {
namespace {

class ViewedFilesTest : public testing::Test {
 protected:
  void SetUp() override {
    write_spheres(folder_.file("m.glb"), 500);
    BuildSpec spec = spheres_build(folder_.file("m.glb"), path_);
    spec.geometry.resolution = 256;
    NoProgress progress;
    const CancelToken never;
    run_build(spec, {system_files(), progress, never});
  }
  static CancelToken& canceled() {
    static CancelToken token;
    token.cancel();
    return token;
  }
  // True if manifest() must still compute the cameras. This fails with a canceled token, but
  // returning a stored manifest does not.
  static bool needs_work(const FileTileSource& file) {
    try {
      file.manifest(canceled());
      return false;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCanceled) << error.message();
      return true;
    }
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("m.vdag");
};

// If several viewers open a file concurrently, they get one shared object, so that its manifest is
// computed only once.
TEST_F(ViewedFilesTest, AreOneForAllThatComeAtOnce) {
  for (int round = 0; round < 20; ++round) {
    OpenTileSources files(system_files(), 4);
    constexpr int kThreads = 8;
    std::latch start(kThreads);
    std::vector<std::shared_ptr<const FileTileSource>> opened(kThreads);
    {
      std::vector<std::jthread> threads;
      for (auto& file : opened)
        threads.emplace_back([&] {
          start.arrive_and_wait();
          file = files.open(path_);
        });
    }
    for (const auto& file : opened) ASSERT_EQ(file, opened[0]);
  }
}

TEST_F(ViewedFilesTest, HaveManifestsThatOutliveThem) {
  OpenTileSources files(system_files(), 1);
  const auto first = files.open(path_);
  EXPECT_TRUE(needs_work(*first));
  const std::string manifest = first->manifest({});
  EXPECT_FALSE(needs_work(*first));
  std::filesystem::copy_file(path_, folder_.file("copy.vdag"));
  files.open(folder_.file("copy.vdag"));
  const auto again = files.open(path_);
  EXPECT_NE(again, first);
  EXPECT_FALSE(needs_work(*again));
  EXPECT_EQ(again->manifest({}), manifest);
}

// After a read of a file has failed, the next open() maps the file again instead of returning the
// shared object, because the file is possibly readable again.
TEST_F(ViewedFilesTest, AreOpenedAgainIfTheyCouldNotBeRead) {
  class SameIdentity : public ForwardingFiles {
    struct Reader : ForwardingReader {
      using ForwardingReader::ForwardingReader;
      FileIdentity identity() const override { return {1, 2, 3, 4}; }
    };

   public:
    using ForwardingFiles::ForwardingFiles;

   private:
    std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) override {
      return std::make_unique<Reader>(std::move(file));
    }
  } same(system_files());
  OpenTileSources files(same, 4);
  const auto first = files.open(path_);
  EXPECT_EQ(files.open(path_), first);
  std::filesystem::copy_file(path_, folder_.file("copy.vdag"));
  std::filesystem::resize_file(path_, 4096);
  EXPECT_THROW(first->blocks()->expect_intact(first->dag().level(0).words.data(), 4), Error);
  EXPECT_EQ(error_of([&] { first->expect_readable(); }).code(), ErrorCode::kIo);
  std::filesystem::copy_file(folder_.file("copy.vdag"), path_,
                             std::filesystem::copy_options::overwrite_existing);
  const auto second = files.open(path_);
  ASSERT_NE(second, first);
  EXPECT_NO_THROW(second->expect_readable());
  EXPECT_EQ(files.size(), 1u);
}

TEST_F(ViewedFilesTest, NoticeThatTheyAreOverwritten) {
  const FileTileSource file(path_, system_files().open_read(path_)->identity());
  EXPECT_FALSE(file.was_overwritten());
  std::fstream(path_, std::ios::in | std::ios::out | std::ios::binary).seekp(5000).put('x');
  EXPECT_TRUE(file.was_overwritten());
  std::filesystem::remove(path_);
  EXPECT_FALSE(file.was_overwritten()) << "its bytes stay as they are";
}

TEST_F(ViewedFilesTest, ADamagedRootIsNoManifest) {
  const auto offset = FileTileSource(path_, {}).colored_file()->level(0).file_offset;
  std::fstream out(path_, std::ios::in | std::ios::out | std::ios::binary);
  out.seekp(static_cast<std::streamoff>(offset) + 1).put(1);
  out.close();
  OpenTileSources files(system_files(), 4);
  const auto file = files.open(path_);
  EXPECT_THROW(file->manifest({}), DamagedBlock);
  EXPECT_TRUE(file->is_first_damage());
  EXPECT_FALSE(file->is_first_damage());
}

}  // namespace
}  // namespace voxdag::server
