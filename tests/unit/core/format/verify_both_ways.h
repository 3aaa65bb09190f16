// Verifies files in memory and with scratch files.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <filesystem>
#include <optional>
#include <string>

#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {

struct VerifyCase {
  unsigned threads = 3;
  uint64_t narrow_words = global_layout::kNarrowLevelWords;
  bool is_quick = false;
};

// Returns the words of a span with which the largest level of the file has about 30 spans.
inline uint64_t span_words_of(const voxdag_reader::File& file) {
  uint64_t most = 0;
  for (uint32_t level = 0; level <= file.brick_level() && !file.empty(); ++level)
    most = std::max(most, file.level(level).word_count);
  return std::clamp<uint64_t>(std::bit_ceil(most / 32 + 1), 64, NodeSpans::kSpanWords);
}

inline void verify_in_memory(const voxdag_reader::File& file, const VerifyCase& how) {
  MemoryBudget budget(uint64_t{1} << 30);
  NoProgress progress;
  const CancelToken cancel;
  with_reader_errors([&] {
    verify_global_file(file, how.threads, budget, progress, cancel, how.narrow_words, how.is_quick);
  });
}

// A level is in memory if its tables take at most 3/4 of `memory_bytes`. Otherwise, a window of the
// level takes at most as much, but at least one span. Returns the bytes of the scratch files.
inline uint64_t verify_in_windows(const voxdag_reader::File& file, const VerifyCase& how,
                                  uint64_t memory_bytes, FileSystem& files = system_files(),
                                  const CancelToken& cancel = {}) {
  const TemporaryFolder folder;
  VerifyScratch scratch(files, folder.file("scratch-"));
  scratch.memory_bytes = memory_bytes;
  scratch.span_words = span_words_of(file);
  MemoryBudget budget(uint64_t{1} << 30);
  // The scratch files have no names, so a killed process leaves none.
  struct NoNames : NoProgress {
    explicit NoNames(std::string path) : folder(std::move(path)) {}
    void begin_stage(std::string_view, uint64_t units, std::string_view) override {
      total = units;
      done = 0;
    }
    void set_total(uint64_t units) override { total = units; }
    void advance(uint64_t units) override {
      EXPECT_TRUE(std::filesystem::is_empty(folder));
      done += units;
    }
    void end_stage() override { EXPECT_EQ(done, total); }
    const std::string folder;
    uint64_t total = 0;
    std::atomic<uint64_t> done{0};
  } progress(folder.path());
  const auto expect_no_files = [&] {
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
    EXPECT_EQ(budget.used(), 0u);
  };
  try {
    with_reader_errors([&] {
      verify_global_file(file, how.threads, budget, progress, cancel, how.narrow_words,
                         how.is_quick, nullptr, &scratch);
    });
  } catch (const Error&) {
    expect_no_files();
    throw;
  }
  expect_no_files();
  return scratch.bytes_written();
}

// Verifies the file in memory and, on one and on three threads, in windows of several sizes.
// Expects that the result is always the same, and throws it if it is an error.
inline void verify_both_ways(const voxdag_reader::File& file, const VerifyCase& how = {}) {
  std::optional<Error> expected;
  const auto compare = [&](const auto& verify) {
    std::optional<Error> error;
    try {
      verify();
    } catch (const Error& thrown) {
      error = thrown;
    }
    EXPECT_EQ(error ? error->message() : "", expected ? expected->message() : "");
    if (error && expected) {
      EXPECT_EQ(error->code(), expected->code());
    }
  };
  try {
    verify_in_memory(file, how);
  } catch (const Error& error) {
    expected = error;
  }
  for (const unsigned threads : {1u, 3u})
    for (const uint64_t memory_bytes : {uint64_t{0}, uint64_t{4000}, uint64_t{1} << 16}) {
      SCOPED_TRACE(testing::Message() << threads << " threads, " << memory_bytes << " bytes");
      compare([&] {
        verify_in_windows(file, {threads, how.narrow_words, how.is_quick}, memory_bytes);
      });
    }
  if (expected) throw *expected;
}

}  // namespace voxdag
