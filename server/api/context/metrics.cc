#include "server/api/context/metrics.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/fields/json_text.h"

namespace voxdag::server {
namespace {

void write_header(std::ostream& out, const std::string& name, const char* type, const char* help) {
  out << "# HELP " << name << ' ' << help << "\n# TYPE " << name << ' ' << type << '\n';
}

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

}  // namespace

void Metrics::count_request(int status, double wall_s) {
  std::lock_guard lock(mutex_);
  ++requests_[status];
  size_t bucket = 0;
  while (bucket < kBoundsS.size() && wall_s > kBoundsS[bucket]) ++bucket;
  ++durations_[bucket];
  duration_sum_s_ += wall_s;
}

void Metrics::count_run(const Job& job) {
  std::lock_guard lock(mutex_);
  ++runs_[state_name(job.state)];
  if (job.state != JobState::kSucceeded) return;
  const auto result = try_parse_json<nlohmann::json>(job.result);
  if (!result.is_object()) return;
  voxels_ += result.value("voxels", uint64_t{0});
  result_bytes_ += result.value("bytes", uint64_t{0});
  build_wall_s_ += result.value("wall_s", 0.0);
  build_cpu_s_ += result.value("cpu_s", 0.0);
}

std::string Metrics::text(const std::map<JobState, uint64_t>& jobs,
                          std::vector<Sample> samples) const {
  std::ostringstream out;
  out.precision(17);
  write_header(out, "voxdag_jobs", "gauge", "Jobs by state.");
  for (size_t i = 0; i < kJobStateNames.size(); ++i) {
    const auto found = jobs.find(static_cast<JobState>(i));
    out << "voxdag_jobs{state=\"" << kJobStateNames[i] << "\"} "
        << (found == jobs.end() ? 0 : found->second) << '\n';
  }
  std::lock_guard lock(mutex_);
  write_header(out, "voxdag_http_requests_total", "counter", "Answered requests by status.");
  for (const auto& [status, count] : requests_)
    out << "voxdag_http_requests_total{status=\"" << status << "\"} " << count << '\n';
  write_header(out, "voxdag_http_request_duration_seconds", "histogram",
               "Time from the end of a request's header to its answer, without sending files.");
  uint64_t total = 0;
  for (size_t i = 0; i <= kBoundsS.size(); ++i) {
    total += durations_[i];
    out << "voxdag_http_request_duration_seconds_bucket{le=\"";
    out << (i < kBoundsS.size() ? short_text(kBoundsS[i]) : "+Inf") << "\"} " << total << '\n';
  }
  out << "voxdag_http_request_duration_seconds_sum " << duration_sum_s_
      << "\nvoxdag_http_request_duration_seconds_count " << total << '\n';
  write_header(out, "voxdag_job_runs_total", "counter",
               "Ended runs of jobs by the state they left the job in.");
  for (const auto& [state, count] : runs_)
    out << "voxdag_job_runs_total{state=\"" << state << "\"} " << count << '\n';
  const auto add = [&](const char* name, const char* help, auto value) {
    samples.push_back({name, help, static_cast<double>(value), ""});
  };
  add("voxdag_built_voxels_total", "Voxels of succeeded jobs.", voxels_);
  add("voxdag_built_bytes_total", "File bytes of succeeded jobs.", result_bytes_);
  add("voxdag_build_wall_seconds_total", "Wall time of succeeded jobs.", build_wall_s_);
  add("voxdag_build_cpu_seconds_total", "CPU time of succeeded jobs.", build_cpu_s_);
  add("voxdag_uploaded_bytes_total", "Received bytes of scenes.", uploaded_bytes_.load());
  add("voxdag_downloaded_bytes_total", "Requested bytes of results.", downloaded_bytes_.load());
  std::string_view previous;
  for (const auto& [name, help, value, labels] : samples) {
    const std::string_view current = name;
    if (current != previous)
      write_header(out, name, current.ends_with("_total") ? "counter" : "gauge", help);
    previous = current;
    out << name << (labels.empty() ? "" : "{" + labels + "}") << ' ' << value << '\n';
  }
  return out.str();
}

}  // namespace voxdag::server
