#include "server/jobs/built_watch.h"

#include <algorithm>
#include <chrono>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/job/job_store.h"
#include "scheduler/job/work_folder.h"

namespace voxdag::server {
namespace {

constexpr double kInterval_s = 1;
// Looking takes at most this part of one core.
constexpr double kMaxShare = 0.01;

// {"resolution": R, "built": n, "total": n, "cubes": [[x, y, z, edge, built], ...]}
std::string subvolumes_json(uint64_t resolution, const std::vector<StoredSubvolume>& leaves,
                            uint64_t built) {
  std::string text = "{\"resolution\":" + std::to_string(resolution) +
                     ",\"built\":" + std::to_string(built) +
                     ",\"total\":" + std::to_string(leaves.size()) + ",\"cubes\":[";
  for (const StoredSubvolume& leaf : leaves) {
    const uint64_t edge = resolution >> leaf.cube.level;
    if (&leaf != &leaves.front()) text += ',';
    text += '[';
    for (const uint32_t position : leaf.cube.position)
      text += std::to_string(position * edge) + ',';
    text += std::to_string(edge) + (leaf.state == SubvolumeState::kBuilt ? ",1]" : ",0]");
  }
  return text + "]}";
}

// Under its name at once, but not synced: it can be made again.
void put(FileSystem& files, const std::string& path, const std::string& contents) {
  const std::string beside = path + ".new";
  const auto file = files.create(beside);
  file->write_at(0, std::as_bytes(std::span(contents)));
  file->close();
  files.rename(beside, path);
}

}  // namespace

BuiltWatch::BuiltWatch(FileSystem& files, const JobFolder& folder, uint64_t resolution,
                       ProgressPipe& pipe)
    : files_(files), folder_(folder), resolution_(resolution), pipe_(pipe) {
  thread_ = std::thread([this] { watch(); });
}

BuiltWatch::~BuiltWatch() {
  {
    std::lock_guard lock(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  thread_.join();
  look();
}

void BuiltWatch::watch() {
  std::unique_lock lock(mutex_);
  for (double pause_s = kInterval_s; !ends_;) {
    wake_.wait_for(lock, std::chrono::duration<double>(pause_s), [this] { return ends_; });
    if (ends_) return;
    lock.unlock();
    const double start = thread_cpu_seconds();
    look();
    pause_s = std::max(kInterval_s, (thread_cpu_seconds() - start) / kMaxShare);
    lock.lock();
  }
}

void BuiltWatch::look() {
  const std::string path = WorkFolder::store_path(folder_.work());
  try {
    if (!files_.exists(path)) return;
    JobStore store(path, JobStore::Access::kRead);
    const std::vector<StoredSubvolume> leaves = store.leaves();
    Report report;
    report.kind = Report::Kind::kBuilt;
    report.total = leaves.size();
    for (const StoredSubvolume& leaf : leaves) {
      if (leaf.state != SubvolumeState::kBuilt) continue;
      ++report.done;
      report.voxels += leaf.summary.voxels;
      report.nodes += leaf.summary.dag_nodes;
      report.bytes += leaf.artifact.bytes;
    }
    if (const auto progress = store.progress()) {
      report.memory_bytes = progress->memory_bytes;
      report.disk_bytes = progress->disk_bytes;
    }
    pipe_.built(report);
    if (leaves.empty() || (report.done == last_built_ && report.total == last_total_)) return;
    put(files_, folder_.subvolumes(), subvolumes_json(resolution_, leaves, report.done));
    last_built_ = report.done;
    last_total_ = report.total;
  } catch (const Error&) {
    // The next look may see more.
  }
}

}  // namespace voxdag::server
