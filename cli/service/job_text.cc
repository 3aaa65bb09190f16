#include "cli/service/job_text.h"

#include <algorithm>
#include <cstdio>

#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"

namespace voxdag::cli {
namespace {

std::string error_code(const Json& job) {
  return job.at("error").is_object() ? job.at("error").at("code").get<std::string>() : "";
}

}  // namespace

std::string job_title(const Json& job) {
  std::string title = job.at("name");
  if (!title.empty()) return printable_line(title);
  for (const Json& scene : job.at("scene")) {
    const std::string path = scene;
    title += (title.empty() ? "" : " + ") + path.substr(path.rfind('/') + 1);
  }
  return printable_line(title);
}

std::string labels_text(const Json& job) {
  std::string text;
  for (const Json& label : job.at("labels"))
    text += "  #" + printable_line(label.get<std::string>());
  return text;
}

std::string state_line(const Json& job) {
  const std::string state = job.at("state");
  std::string line =
      "job " + printable_line(job.at("id").get<std::string>()) + ": " + printable_line(state);
  if (job.at("position").is_number())
    line += ", number " + exact_json_text(job.at("position")) + " in the queue";
  if (state == "queued" && !error_code(job).empty())
    line += ", retry after " + printable_line(error_code(job));
  return line;
}

std::string overall_text(const Json& progress, bool is_running) {
  const auto overall = progress.find("overall");
  if (overall == progress.end()) return "";
  const double fraction = overall->at("fraction");
  std::string text = std::to_string(static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0))) + " %";
  const Json& left_s = overall->at("eta_s");
  if (is_running && left_s.is_number())
    text += ", " + duration_text(left_s.get<double>()) + " left";
  return text;
}

std::string progress_text(const Json& job) {
  const std::string state = job.at("state");
  const Json& progress = job.at("progress");
  if (state == "succeeded") return size_text(job.at("result").at("bytes"));
  if (state == "failed") return printable_line(error_code(job));
  if (state == "queued" && job.at("position").is_number())
    return "number " + exact_json_text(job.at("position"));
  if (!progress.is_object()) return "";
  const std::string stage = printable_line(progress.at("stage").get<std::string>());
  const std::string overall = overall_text(progress, state == "running");
  return overall.empty() ? stage : stage + ": " + overall;
}

void print_result(const Json& job) {
  const Json& r = job.at("result");
  const auto count = [&](const char* name) { return count_text(r.at(name)); };
  std::printf("job %s: %s, sha256 %s\n", printable_line(job.at("id").get<std::string>()).c_str(),
              size_text(r.at("bytes")).c_str(),
              printable_line(r.at("sha256").get<std::string>()).c_str());
  std::printf("  %s triangles in a grid of %s^3\n", count("triangles").c_str(),
              exact_json_text(job.at("resolution")).c_str());
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count("voxels").c_str(),
              count("svo_nodes").c_str(), count("dag_nodes").c_str());
  std::printf("  %s wall, %s CPU, peak memory %s\n", duration_text(r.at("wall_s")).c_str(),
              duration_text(r.at("cpu_s")).c_str(), size_text(r.at("peak_rss_bytes")).c_str());
}

}  // namespace voxdag::cli
