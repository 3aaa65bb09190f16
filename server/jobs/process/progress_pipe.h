// Reports the progress of a job's process: messages on standard output, at most a few per second;
// text on standard error; and the file subvolumes.json, about once per second. Thread-safe.
#pragma once

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "server/jobs/process/subvolume_map.h"
#include "server/jobs/protocol/job_messages.h"

namespace voxdag::server {

class ProgressPipe : public Progress {
 public:
  ProgressPipe(FileSystem& files, std::string subvolumes_path)
      : files_(files), subvolumes_path_(std::move(subvolumes_path)) {}

  void begin_stage(std::string_view stage, uint64_t total, std::string_view unit) override;
  void resume_at(uint64_t done) override;
  void advance(uint64_t count) override;
  void set_total(uint64_t total) override;
  void end_stage() override;
  void warn(std::string_view message) override;
  void warn_of_input(const Warning& warning) override;
  void set_subvolumes(uint64_t resolution, std::span<const SubvolumeStatus> all) override;
  void set_grid(const std::array<double, 3>& origin, double edge) override;
  void subvolume_begun(int64_t id) override;
  void subvolume_built(const SubvolumeStatus& built) override;
  void subvolume_split(int64_t id, std::span<const SubvolumeStatus> parts) override;
  void set_usage(uint64_t memory_bytes, uint64_t disk_bytes) override;
  void set_cluster_tasks(const ClusterTasks& tasks) override;

  // Reports the failure that ends the job. `code` is a code of docs/errors.md, or "internal".
  void fail(const std::string& code, const std::string& text);
  // Reports the result of the finished job, RESULT of docs/api.md.
  void finish(const std::string& result_json);

 private:
  // The caller of these functions, except tick(), must hold the mutex. If `now` is false,
  // send_advance() and report_subvolumes() do nothing until the minimum interval since the previous
  // message has passed.
  void send(const Message& message);
  void send_advance(bool now);
  void report_subvolumes(bool now);
  // The loop of a thread that reports changes of subvolumes that came too soon after the previous
  // report. Without this thread, such a change would be reported only with the next change, perhaps
  // minutes later.
  void tick(const std::stop_token& end);
  void log(const std::string& text);
  // Replaces subvolumes.json atomically. Does not sync the file, because it can be created again.
  // Ignores failures, because they must not fail the build.
  void write_subvolumes();

  FileSystem& files_;
  const std::string subvolumes_path_;
  std::mutex mutex_;  // guards all members below
  std::string stage_, unit_;
  uint64_t done_ = 0, total_ = 0;
  double stage_start_s_ = 0, last_advance_s_ = 0;
  SubvolumeMap subvolumes_;
  bool subvolumes_changed_ = false;
  double next_subvolumes_s_ = 0;

  std::condition_variable_any ticks_;
  std::jthread ticker_;  // runs tick()
};

}  // namespace voxdag::server
