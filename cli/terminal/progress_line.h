// A stage's progress as one line on standard error: a bar that is drawn over on a terminal, a plain
// line otherwise. Used by one thread at a time.
#pragma once

#include <cstdint>
#include <string_view>

namespace voxdag::cli {

struct StageView {
  std::string_view name, unit;
  uint64_t done = 0;
  uint64_t total = 0;  // 0 if unknown
  double elapsed_s = 0;
  double rate = 0;   // units per second
  double eta_s = 0;  // 0 if unknown
};

class ProgressLine {
 public:
  // `quiet` shows warnings only.
  explicit ProgressLine(bool quiet = false);
  // Ends a line that was cut short, so that what is said next stands on its own.
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // How often it is worth showing a stage that goes on.
  double interval_s() const;
  void show(const StageView& stage, bool ended);
  void warn(std::string_view message);
  // A line of its own.
  void note(std::string_view text);

 private:
  const bool quiet_;
  const bool terminal_;
  bool open_ = false;  // a line on the terminal waits to be drawn over
};

}  // namespace voxdag::cli
