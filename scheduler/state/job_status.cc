#include "scheduler/state/job_status.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

double JobStatus::rate() const {
  if (!progress) return 0;
  const double elapsed = progress->updated_s - progress->stage_started_s;
  return elapsed > 0 ? static_cast<double>(progress->done - progress->resumed_at) / elapsed : 0;
}

double JobStatus::eta_s() const {
  if (!progress || progress->total <= progress->done || rate() == 0) return 0;
  return static_cast<double>(progress->total - progress->done) / rate();
}

JobStatus read_job_status(FileSystem& files, const std::string& work_folder) {
  const std::string store_path = WorkFolder::store_path(work_folder);
  JobStatus status;
  status.holder = WorkFolder::holder(files, work_folder);
  status.running = !status.holder.empty();
  if (!files.exists(store_path)) {
    if (status.running) return status;  // a build that has just begun
    throw Error(ErrorCode::kNotFound,
                work_folder + " has no job of voxdag: expected the work folder of a build");
  }
  JobStore store(store_path, JobStore::Access::kRead);
  if (const auto job = store.job()) status.geometry = job->geometry;
  for (const StoredSubvolume& subvolume : store.leaves()) {
    ++status.subvolumes;
    status.built += subvolume.state == SubvolumeState::kBuilt;
  }
  status.progress = store.progress();
  status.stages = store.stage_times();
  return status;
}

std::string status_json(const JobStatus& status, const std::string& cluster) {
  using nlohmann::ordered_json;
  ordered_json stages = ordered_json::array();
  for (const StageTime& stage : status.stages)
    stages.push_back({{"name", stage.name}, {"wall_s", stage.wall_s}, {"cpu_s", stage.cpu_s}});
  ordered_json json = {
      {"running", status.running},
      {"holder", status.holder},
      {"geometry", try_parse_json<ordered_json>(status.geometry)},
      {"subvolumes", {{"total", status.subvolumes}, {"built", status.built}}},
      {"stages", stages},
  };
  if (status.geometry.empty()) json["geometry"] = nullptr;
  if (!cluster.empty()) json["cluster"] = parse_json<ordered_json>(cluster);
  if (const auto& p = status.progress) {
    json["stage"] = p->stage;
    json["unit"] = p->unit;
    json["done"] = p->done;
    json["total"] = p->total;
    json["rate"] = status.rate();
    json["eta_s"] = status.eta_s();
    json["memory_bytes"] = p->memory_bytes;
    json["disk_bytes"] = p->disk_bytes;
    json["last_error"] = p->last_error;
  }
  return json_text(json, 2);
}

}  // namespace voxdag
