#include "cli/service/follow.h"

#include "cli/service/job_text.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/clock.h"
#include "core/base/warning.h"
#include "core/fields/json_fields.h"

namespace voxdag::cli {
namespace {

// Shows a job's progress. Each call of show() prints only the changes since the previous call.
class JobView {
 public:
  explicit JobView(bool quiet) : quiet_(quiet), line_(quiet) {}
  void show(const Json& job) {
    const std::string state = job.at("state");
    if (state != state_ && state != "running" && !quiet_) line_.note(state_line(job));
    state_ = state;
    const Json& warnings = job.at("warnings");
    for (; warnings_ < warnings.size(); ++warnings_)
      line_.warn(record_from_json<Warning>(warnings[warnings_]).text());
    if (job.at("progress").is_object()) show_progress(job, job.at("progress"));
  }

 private:
  void show_progress(const Json& job, const Json& progress) {
    if (job.at("attempts") != attempt_) {
      attempt_ = job.at("attempts");
      ended_ = 0;
    }
    const Json& stages = progress.at("stages");
    for (; ended_ < stages.size() && stages[ended_].at("ended").get<bool>(); ++ended_)
      show_stage(stages[ended_], true, average_rate(stages[ended_]), 0, "");
    const double now = wall_seconds();
    if (state_ != "running" || ended_ >= stages.size() || now - shown_s_ < line_.interval_s())
      return;
    shown_s_ = now;
    const std::string overall = overall_text(progress, true);
    show_stage(stages[ended_], false, progress.at("rate"), progress.at("eta_s"),
               overall.empty() ? "" : "job " + overall);
  }

  void show_stage(const Json& stage, bool ended, double rate, double eta_s,
                  const std::string& overall) {
    const std::string name = stage.at("name"), unit = stage.at("unit");
    line_.show(
        {name, unit, stage.at("done"), stage.at("total"), stage.at("wall_s"), rate, eta_s, overall},
        ended);
  }

  static double average_rate(const Json& stage) {
    const double done = stage.at("done").get<double>() - stage.value("resumed_at", 0.0);
    return done / std::max(stage.at("wall_s").get<double>(), 1e-9);
  }

  const bool quiet_;
  ProgressLine line_;
  std::string state_;
  Json attempt_;
  size_t warnings_ = 0;  // warnings shown so far
  size_t ended_ = 0;     // stages shown as ended so far
  double shown_s_ = 0;
};

}  // namespace

Json follow_job(ServiceClient& service, const std::string& id, bool quiet) {
  JobView view(quiet);
  return service.follow_job(id, [&](const Json& job) { view.show(job); });
}

void check_succeeded(const Json& job) {
  const std::string state = job.at("state"), id = job.at("id");
  if (state == "succeeded") return;
  if (state == "canceled")
    throw Error(ErrorCode::kCanceled, "job " + id + " was canceled, expected it to succeed");
  if (!job.at("error").is_object())
    throw Error(ErrorCode::kIo, "job " + id + " is " + state +
                                    ", expected it to succeed; the service reports no reason");
  const Json& error = job.at("error");
  throw Error(client::error_code_of(error.at("code"), 500),
              "job " + id + " failed: " + error.at("message").get<std::string>());
}

}  // namespace voxdag::cli
