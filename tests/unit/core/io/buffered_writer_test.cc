#include "core/io/buffered/buffered_writer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <random>
#include <string>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "tests/support/error_of.h"

namespace voxdag {
namespace {

// What a RecordingFile has received. A file that is destroyed leaves it behind.
struct Record {
  std::string bytes;
  int writes = 0;
  int syncs = 0;
  bool fails = false;
};

class RecordingFile : public WritableFile {
 public:
  explicit RecordingFile(Record& record) : record_(record) {}
  const std::string& path() const override { return path_; }
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    if (record_.fails) throw Error(ErrorCode::kNoSpace, "full");
    ++record_.writes;
    if (record_.bytes.size() < offset + data.size()) record_.bytes.resize(offset + data.size());
    std::memcpy(record_.bytes.data() + offset, data.data(), data.size());
  }
  void sync() override { ++record_.syncs; }
  void close() override {}

 private:
  const std::string path_ = "a";
  Record& record_;
};

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

TEST(BufferedWriter, ConsecutivePiecesAreOneWrite) {
  Record record;
  BufferedWriter file(std::make_unique<RecordingFile>(record));
  std::string expected;
  for (int i = 0; i < 1000; ++i) {
    const std::string piece = std::to_string(i);
    file.write_at(expected.size(), bytes_of(piece));
    expected += piece;
  }
  EXPECT_EQ(record.writes, 0);
  file.sync();
  EXPECT_EQ(record.writes, 1);
  EXPECT_EQ(record.syncs, 1);
  EXPECT_EQ(record.bytes, expected);
  file.write_at(1, bytes_of("x"));
  file.flush();
  file.flush();
  EXPECT_EQ(record.writes, 2);
  EXPECT_EQ(record.bytes.substr(0, 3), "0x2");
}

TEST(BufferedWriter, AllOrdersAndThreadsGiveTheSameBytes) {
  Record record;
  BufferedWriter file(std::make_unique<RecordingFile>(record));
  std::mt19937_64 random(1);
  std::string expected(3 << 20, 0);
  for (char& c : expected) c = static_cast<char>(random());
  std::vector<std::pair<size_t, size_t>> pieces;
  for (size_t at = 0; at < expected.size();) {
    const size_t bytes = std::min(expected.size() - at, size_t{1} << random() % 19);
    pieces.emplace_back(at, bytes);
    at += bytes;
  }
  std::swap(pieces.front(), pieces.back());
  std::swap(pieces[3], pieces[5]);
  for (const auto& [at, bytes] : pieces) file.write_at(at, bytes_of(expected.substr(at, bytes)));
  file.flush();
  EXPECT_EQ(record.bytes, expected);

  // RecordingFile is not thread-safe, so all pieces are small enough to be buffered.
  std::erase_if(pieces, [](const auto& piece) { return piece.second > 4096; });
  record.bytes.assign(record.bytes.size(), 0);
  std::atomic<size_t> next = 0;
  parallel_for(4, 4, [&](unsigned, size_t worker) {
    for (size_t i = next++; i < pieces.size(); i = next++) {
      const auto [at, bytes] = pieces[i];
      file.write_at(at, bytes_of(expected.substr(at, bytes)));
      if (worker == 0 && i % 16 == 0) file.sync();
    }
  });
  file.close();
  for (const auto& [at, bytes] : pieces)
    ASSERT_EQ(record.bytes.substr(at, bytes), expected.substr(at, bytes)) << at;
}

TEST(BufferedWriter, AFailedWriteIsRepeated) {
  Record record;
  BufferedWriter file(std::make_unique<RecordingFile>(record));
  file.write_at(0, bytes_of("abc"));
  record.fails = true;
  EXPECT_EQ(error_of([&] { file.flush(); }).code(), ErrorCode::kNoSpace);
  record.fails = false;
  file.flush();
  EXPECT_EQ(record.bytes, "abc");
}

TEST(BufferedWriter, TheDestructorDiscards) {
  Record record;
  BufferedWriter(std::make_unique<RecordingFile>(record)).write_at(0, bytes_of("abc"));
  EXPECT_EQ(record.writes, 0);
}

}  // namespace
}  // namespace voxdag
