// The reporting side of a job's process: a build's progress as lines on standard output, at most a
// few a second, and in plain words on standard error. Thread-safe.
#pragma once

#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "server/jobs/process/task.h"

namespace voxdag::server {

class ProgressPipe : public Progress {
 public:
  // Texts that are to be replaced in all that is said.
  void hide(std::vector<std::pair<std::string, std::string>> texts);

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override;

  void built(const Report& report);
  void fail(const std::string& code, const std::string& message);
  void finish(const std::string& result);

 private:
  // Called with the mutex held.
  void send(const Report& report);
  void send_advance(bool at_once);
  void log(const std::string& text);
  std::string hidden(std::string text) const;

  std::mutex mutex_;  // guards all below
  std::vector<std::pair<std::string, std::string>> hidden_;
  std::string stage_, unit_;
  uint64_t done_ = 0, total_ = 0;
  double stage_start_s_ = 0, last_sent_s_ = 0;
};

}  // namespace voxdag::server
