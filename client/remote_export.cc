#include "client/remote_export.h"

#include "client/retry_policy.h"
#include "core/base/error.h"
#include "core/io/random_id.h"

namespace voxdag::client {
namespace {

std::string exports_path(const std::string& job) { return job_path(job) + "/exports"; }

constexpr double kExportPollIntervalS = 0.5;

// Passes the PROGRESS objects of an export on to a Progress.
class ProgressRelay {
 public:
  explicit ProgressRelay(Progress& progress) : progress_(progress) {}
  ~ProgressRelay() {
    if (has_begun_) progress_.end_stage();
  }
  ProgressRelay(const ProgressRelay&) = delete;

  void show(const Json& progress) {
    const Json& stages = progress.at("stages");
    for (; stage_ < stages.size(); ++stage_) {
      const Json& stage = stages[stage_];
      const uint64_t done = stage.at("done");
      if (!has_begun_) {
        progress_.begin_stage(stage.at("name").get<std::string>(), stage.at("total"),
                              stage.at("unit").get<std::string>());
        done_ = 0;
      }
      has_begun_ = true;
      if (done > done_) progress_.advance(done - done_);
      done_ = std::max(done, done_);
      if (!stage.at("ended").get<bool>()) return;
      progress_.end_stage();
      has_begun_ = false;
    }
  }

 private:
  Progress& progress_;
  size_t stage_ = 0;  // stages before this one have ended
  bool has_begun_ = false;
  uint64_t done_ = 0;  // units of the stage that `progress_` has received
};

// Throws the error of an export that has not succeeded.
[[noreturn]] void throw_export_error(const Json& it) {
  const std::string name = "export " + it.at("id").get<std::string>();
  if (it.at("error").is_object())
    throw Error(error_code_of(it.at("error").at("code"), 500),
                name + " failed: " + it.at("error").at("message").get<std::string>());
  throw Error(ErrorCode::kCanceled,
              name + " is " + it.at("state").get<std::string>() + ", expected it to succeed");
}

}  // namespace

Json make_export(ServiceClient& service, const std::string& job, const Json& request,
                 Progress& progress) {
  const std::string all = exports_path(job);
  Json it = service.post(all, request);
  const std::string id = it.at("id");
  try {
    for (ProgressRelay relay(progress);; it = service.get(all + "/" + id)) {
      const std::string state = it.at("state");
      if (state == "succeeded") return it;
      if (state != "queued" && state != "running") throw_export_error(it);
      if (it.at("progress").is_object()) relay.show(it.at("progress"));
      sleep_for(kExportPollIntervalS, service.cancel());
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCanceled || !service.cancel().canceled()) throw;
    throw Error(ErrorCode::kCanceled, "no longer waiting for export " + id + ", which continues");
  }
}

Json exports_of(ServiceClient& service, const std::string& job) {
  return service.get(exports_path(job)).at("exports");
}

bool delete_export(ServiceClient& service, const std::string& job, const std::string& id) {
  if (!is_random_id(id))
    throw Error(ErrorCode::kInvalidInput, "export '" + id + "': expected an id of 16 hex digits");
  return service.remove(exports_path(job) + "/" + id);
}

std::vector<RemoteFile> files_of_export(const Json& exported) {
  const std::string path =
      exports_path(exported.at("job")) + "/" + exported.at("id").get<std::string>() + "/files/";
  std::vector<RemoteFile> files;
  for (const Json& file : exported.at("files"))
    files.push_back({path + std::to_string(files.size()), file.at("bytes"), file.at("sha256")});
  return files;
}

}  // namespace voxdag::client
