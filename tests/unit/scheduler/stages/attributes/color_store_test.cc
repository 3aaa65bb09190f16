#include "scheduler/stages/attributes/color_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/io/forwarding_files.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

class AllWarnings : public NoProgress {
 public:
  void warn(std::string_view message) override { text += message; }
  std::string text;
};

class ColorStoreTest : public testing::Test {
 protected:
  ColorStore open(FileSystem& files = system_files(), double sync_interval_s = 0) {
    return ColorStore(files, path_, sync_interval_s, warnings_, cancel_);
  }
  static std::vector<std::byte> read(const ColorStore& store, const Checksum128& key) {
    std::vector<std::byte> all, part;
    for (const ColorStore::Place& place : store.parts(key)) {
      store.read(place, part);
      all.insert(all.end(), part.begin(), part.end());
    }
    return all;
  }
  uint64_t file_bytes() const { return std::filesystem::file_size(path_); }
  // Overwrites four bytes of the file.
  void damage(uint64_t offset) const {
    std::fstream(path_, std::ios::in | std::ios::out | std::ios::binary)
            .seekp(static_cast<std::streamoff>(offset))
        << "bad!";
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.file("colors.vddurable");
  AllWarnings warnings_;
  const CancelToken cancel_{};
  const Checksum128 a_{1, 2}, b_{1, 3}, c_{2, 2};
};

TEST_F(ColorStoreTest, HasWhatWasAdded) {
  {
    ColorStore store = open();
    EXPECT_FALSE(store.has(a_));
    store.add(a_, 0, true, bytes_of("first"));
    store.add(b_, 0, true, {});
  }
  {
    ColorStore store = open();
    EXPECT_TRUE(store.has(a_) && store.has(b_) && !store.has(c_));
    store.add(c_, 0, true, bytes_of(std::string(300000, 'c')));
  }
  const uint64_t whole = file_bytes();
  {
    const ColorStore store = open();
    EXPECT_EQ(read(store, a_), bytes_of("first"));
    EXPECT_EQ(read(store, b_), bytes_of(""));
    EXPECT_EQ(read(store, c_), bytes_of(std::string(300000, 'c')));
    EXPECT_EQ(store.file_bytes(), whole);
  }
  // A truncated artifact does not count, and a new artifact is written over it.
  std::filesystem::resize_file(path_, whole - 1);
  {
    ColorStore store = open();
    EXPECT_TRUE(store.has(a_) && store.has(b_) && !store.has(c_));
    store.add(c_, 0, true, bytes_of("short"));
  }
  const ColorStore store = open();
  EXPECT_EQ(read(store, c_), bytes_of("short"));
  EXPECT_EQ(warnings_.text, "");
  // Damage that occurs after open() is detected by a read.
  damage(56);
  EXPECT_THROW(read(store, a_), Error);
}

TEST_F(ColorStoreTest, HasArtifactsInParts) {
  {
    ColorStore store = open();
    const ColorStore::Place place = store.add(a_, 0, false, bytes_of("of a st"));
    store.add(b_, 0, false, bytes_of("two "));
    store.add(a_, 1, false, bytes_of("op"));
    store.add(b_, 1, true, bytes_of("parts"));
    std::vector<std::byte> part;
    store.read(place, part);
    EXPECT_EQ(part, bytes_of("of a st"));
  }
  {
    ColorStore store = open();
    EXPECT_FALSE(store.has(a_));
    EXPECT_EQ(read(store, b_), bytes_of("two parts"));
    // An earlier run has stored two parts of a_, but not its last part. The store ignores these
    // parts, so a_ begins again with part 0.
    for (uint64_t i = 0; i < 3; ++i) store.add(a_, i, i == 2, bytes_of("abc"));
  }
  EXPECT_EQ(read(open(), a_), bytes_of("abcabcabc"));
  EXPECT_EQ(warnings_.text, "");
  damage(56 + 7 + 56);
  const ColorStore damaged = open();
  EXPECT_TRUE(damaged.has(a_) && !damaged.has(b_));
  EXPECT_NE(warnings_.text.find("baked again; number of cubes: 1"), std::string::npos);
}

TEST_F(ColorStoreTest, DropsWhatIsMostOfItAndNotWanted) {
  const std::string large(1 << 20, 'l');
  {
    ColorStore store = open();
    store.add(a_, 0, false, bytes_of(large));
    store.add(b_, 0, true, bytes_of(large));
    store.add(a_, 1, true, bytes_of("end"));
  }
  const uint64_t whole = file_bytes();
  {
    // Only about half of the file is garbage, so keep_only() does not rewrite the file.
    ColorStore store = open();
    store.keep_only(std::array{a_}, cancel_);
    EXPECT_EQ(store.file_bytes(), whole);
    store.add(c_, 0, true, bytes_of(large));
  }
  {
    ColorStore store = open();
    store.keep_only(std::array{c_, a_, c_}, cancel_);
    EXPECT_TRUE(store.has(a_) && store.has(b_) && store.has(c_));
    store.keep_only(std::array{a_}, cancel_);
    EXPECT_TRUE(store.has(a_) && !store.has(b_) && !store.has(c_));
    EXPECT_EQ(file_bytes(), store.file_bytes());
    EXPECT_LT(file_bytes(), large.size() + 200);
    EXPECT_EQ(read(store, a_), bytes_of(large + "end"));
    store.add(b_, 0, true, bytes_of("again"));
  }
  ColorStore store = open();
  EXPECT_EQ(read(store, a_), bytes_of(large + "end"));
  EXPECT_EQ(read(store, b_), bytes_of("again"));
  store.keep_only({}, cancel_);
  EXPECT_EQ(file_bytes(), 0u);
  EXPECT_EQ(warnings_.text, "");
}

// A disk on which each sync takes a millisecond.
class SlowWriter : public ForwardingWriter {
 public:
  SlowWriter(std::unique_ptr<WritableFile> file, std::atomic<int>& syncs)
      : ForwardingWriter(std::move(file)), syncs_(syncs) {}
  void sync() override {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ForwardingWriter::sync();
    ++syncs_;
  }

 private:
  std::atomic<int>& syncs_;
};

class SlowFiles : public ForwardingFiles {
 public:
  SlowFiles() : ForwardingFiles(system_files()) {}
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<SlowWriter>(ForwardingFiles::create(path), syncs);
  }
  std::atomic<int> syncs{0};
};

// Several threads write parts while the file is repeatedly synced in the background.
TEST_F(ColorStoreTest, TakesPartsFromSeveralThreads) {
  constexpr uint64_t kArtifacts = 200;
  const auto part_of = [](uint64_t artifact, uint64_t part) {
    return bytes_of(std::string(artifact * 7 % 1000, static_cast<char>(artifact + part)));
  };
  SlowFiles files;
  {
    ColorStore store = open(files, 1e-6);
    parallel_for(4, kArtifacts, [&](unsigned, size_t i) {
      std::vector<std::byte> read;
      for (uint64_t part = 0; part < 3; ++part) {
        const auto bytes = part_of(i, part);
        store.read(store.add({i, 1}, part, part == 2, bytes), read);
        EXPECT_EQ(read, bytes);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    });
  }
  EXPECT_GT(files.syncs, 3);
  const ColorStore store = open();
  for (uint64_t i = 0; i < kArtifacts; ++i) {
    ASSERT_TRUE(store.has({i, 1}));
    ASSERT_EQ(store.parts({i, 1}).size(), 3u);
    std::vector<std::byte> read;
    for (uint64_t part = 0; part < 3; ++part) {
      store.read(store.parts({i, 1})[part], read);
      EXPECT_EQ(read, part_of(i, part));
    }
  }
}

}  // namespace
}  // namespace voxdag
