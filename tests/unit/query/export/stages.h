// Records the stages of an export from its progress reports.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <string_view>

#include "core/base/progress.h"

namespace voxdag::query {

// Adds up the work of stages that have the same name.
class Stages : public NoProgress {
 public:
  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override {
    stage_ = &stages[std::string(stage)];
    stage_->total += total;
    stage_->unit = unit;
  }
  void advance(uint64_t count) override { stage_->done += count; }

  // Checks that every stage has reported progress. Stages except `count` and `select` must know
  // their total at the start. The work done must equal the total.
  void expect_complete() const {
    for (const auto& [name, stage] : stages) {
      EXPECT_GT(stage.done, 0u) << name;
      if (name == "count" || name == "select") continue;
      EXPECT_GT(stage.total, 0u) << name;
      EXPECT_EQ(stage.done, stage.total) << name;
    }
  }

  struct Stage {
    uint64_t done = 0, total = 0;
    std::string unit;
  };
  std::map<std::string, Stage> stages;

 private:
  Stage* stage_ = nullptr;
};

}  // namespace voxdag::query
