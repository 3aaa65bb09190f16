// Shows progress on standard error. On a terminal, this is a bar with the rate and the remaining
// time; otherwise, it is a plain line every five seconds and at the end of each stage. The progress
// bar is thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "core/base/progress.h"

namespace voxdag::cli {

struct StageView {
  std::string_view name, unit;
  uint64_t done = 0;
  uint64_t total = 0;  // 0 if unknown
  double elapsed_s = 0;
  double rate = 0;   // units per second
  double eta_s = 0;  // 0 if unknown
  // Text that replaces the stage's remaining time, such as "job 42 %, 31.4 s left"; "" for none.
  std::string_view overall;
};

// Shows the progress of a stage as one line on standard error. If standard error is a terminal, the
// line has a bar and is redrawn. Not thread-safe.
class ProgressLine {
 public:
  // If `quiet` is true, the line shows only warnings and notes.
  explicit ProgressLine(bool quiet = false);
  // Ends a line that is still being redrawn, so that later output starts on a new line.
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Returns the number of seconds that should pass between two calls of show() for a running stage.
  double interval_s() const;
  void show(const StageView& stage, bool ended);
  void warn(std::string_view message);
  // Prints a line of text.
  void note(std::string_view text);

 private:
  const bool quiet_;
  const bool terminal_;
  bool open_ = false;  // the terminal shows a line that will be redrawn
};

// Returns a progress bar. If `quiet` is true, it shows only warnings.
std::unique_ptr<Progress> make_progress_bar(bool quiet = false);

}  // namespace voxdag::cli
