#include "server/api/metrics.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

namespace voxdag::server {
namespace {

void head(std::ostream& out, const std::string& name, const char* type, const char* help) {
  out << "# HELP " << name << ' ' << help << "\n# TYPE " << name << ' ' << type << '\n';
}

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

void single(std::ostream& out, const std::string& name, const char* type, const char* help,
            double value) {
  head(out, name, type, help);
  out << name << ' ' << value << '\n';
}

}  // namespace

void Metrics::count_request(int status, double wall_s) {
  std::lock_guard lock(mutex_);
  ++requests_[status];
  size_t bucket = 0;
  while (bucket < kBounds_s.size() && wall_s > kBounds_s[bucket]) ++bucket;
  ++durations_[bucket];
  duration_sum_s_ += wall_s;
}

void Metrics::count_settled(const Job& job) {
  std::lock_guard lock(mutex_);
  ++settled_[state_name(job.state)];
  if (job.state != JobState::kSucceeded) return;
  const auto result = nlohmann::json::parse(job.result, nullptr, false);
  if (!result.is_object()) return;
  voxels_ += result.value("voxels", uint64_t{0});
  result_bytes_ += result.value("bytes", uint64_t{0});
  build_wall_s_ += result.value("wall_s", 0.0);
  build_cpu_s_ += result.value("cpu_s", 0.0);
}

std::string Metrics::text(const std::map<JobState, uint64_t>& jobs,
                          const std::vector<Gauge>& gauges) const {
  std::ostringstream out;
  out.precision(17);
  head(out, "voxdag_jobs", "gauge", "Jobs that are kept, by state.");
  for (size_t i = 0; i < kJobStateNames.size(); ++i) {
    const auto found = jobs.find(static_cast<JobState>(i));
    out << "voxdag_jobs{state=\"" << kJobStateNames[i] << "\"} "
        << (found == jobs.end() ? 0 : found->second) << '\n';
  }
  for (const Gauge& gauge : gauges) single(out, gauge.name, "gauge", gauge.help, gauge.value);
  std::lock_guard lock(mutex_);
  head(out, "voxdag_http_requests_total", "counter", "Requests answered, by status.");
  for (const auto& [status, count] : requests_)
    out << "voxdag_http_requests_total{status=\"" << status << "\"} " << count << '\n';
  head(out, "voxdag_http_request_seconds", "histogram",
       "Time from a request's header to its answer, bodies sent from disk aside.");
  uint64_t sum = 0;
  for (size_t i = 0; i <= kBounds_s.size(); ++i) {
    sum += durations_[i];
    out << "voxdag_http_request_seconds_bucket{le=\"";
    out << (i < kBounds_s.size() ? short_text(kBounds_s[i]) : "+Inf") << "\"} " << sum << '\n';
  }
  out << "voxdag_http_request_seconds_sum " << duration_sum_s_
      << "\nvoxdag_http_request_seconds_count " << sum << '\n';
  head(out, "voxdag_job_runs_total", "counter",
       "Runs of jobs that ended, by the state they left the job in.");
  for (const auto& [state, count] : settled_)
    out << "voxdag_job_runs_total{state=\"" << state << "\"} " << count << '\n';
  const auto counter = [&](const char* name, const char* help, double value) {
    single(out, name, "counter", help, value);
  };
  counter("voxdag_built_voxels_total", "Voxels of jobs that succeeded.",
          static_cast<double>(voxels_));
  counter("voxdag_built_bytes_total", "Bytes of their files.", static_cast<double>(result_bytes_));
  counter("voxdag_build_wall_seconds_total", "Their wall time.", build_wall_s_);
  counter("voxdag_build_cpu_seconds_total", "Their CPU time.", build_cpu_s_);
  counter("voxdag_uploaded_bytes_total", "Bytes of scenes received.",
          static_cast<double>(uploaded_bytes_.load()));
  counter("voxdag_downloaded_bytes_total", "Bytes of results asked for.",
          static_cast<double>(downloaded_bytes_.load()));
  return out.str();
}

}  // namespace voxdag::server
