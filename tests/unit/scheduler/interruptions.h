// Cancels builds, as Ctrl-C does, at a point that the test chooses.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "scheduler/run_build.h"

namespace voxdag {

// Cancels the build when the stage `stage` has reported `after` units of work.
class CancelingProgress : public NoProgress {
 public:
  CancelingProgress(CancelToken& cancel, std::string stage, uint64_t after)
      : cancel_(cancel), stage_(std::move(stage)), left_(after) {}
  void begin_stage(std::string_view stage, uint64_t, std::string_view) override {
    active_ = stage == stage_;
    if (active_ && left_ == 0) cancel_.cancel();
  }
  void advance(uint64_t count) override {
    if (!active_) return;
    left_ -= std::min(left_, count);
    if (left_ == 0) cancel_.cancel();
  }

 private:
  CancelToken& cancel_;
  const std::string stage_;
  bool active_ = false;
  uint64_t left_;
};

// Runs a build until `stage` has reported `after` units of work, then cancels it.
inline void build_until(const BuildSpec& spec, const std::string& stage, uint64_t after,
                        FileSystem& files = system_files()) {
  CancelToken cancel;
  CancelingProgress progress(cancel, stage, after);
  try {
    run_build(spec, {files, progress, cancel});
    FAIL() << "the build was not interrupted";
  } catch (const Error& error) {
    ASSERT_EQ(error.code(), ErrorCode::kCanceled) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(spec.run.output));
}

}  // namespace voxdag
