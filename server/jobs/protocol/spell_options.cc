#include "server/jobs/protocol/spell_options.h"

#include "scheduler/spec/build_fields.h"

namespace voxdag::server {
namespace {

std::string setting(std::string_view name) { return std::string(name) + " of the service"; }

// Sees the fields of a request's options.
struct Finder {
  template <class T>
  void operator()(const Field& field, T&) {
    is_found = is_found || field.name == name;
  }
  std::string_view name;
  bool is_found = false;
};

bool is_job_option(std::string_view name) {
  Finder finder{name};
  BuildSpec spec;
  visit_job_options(finder, spec);
  return finder.is_found;
}

}  // namespace

std::string spell_job_option(std::string_view name, std::string_view value) {
  constexpr std::string_view kClusterPrefix = "cluster_";
  if (name == "scene" || name == "resolution" || is_job_option(name))
    return spell_as_member(name, value);
  // Only a new job starts with an empty work folder.
  if (name == "restart") return "a new job of the scene";
  if (name == "cache") return setting("jobs.cache");
  if (name == "cluster") return setting("cluster.engine");
  if (name.starts_with(kClusterPrefix))
    return setting("cluster." + std::string(name.substr(kClusterPrefix.size())));
  return "";  // --work, --force and others: the service chooses the files and folders of a job
}

std::string spell_export_option(std::string_view name, std::string_view value) {
  return name == "memory" ? setting("exports.memory") : spell_as_member(name, value);
}

std::string spell_request(std::string_view command, std::string_view option,
                          std::string_view value) {
  if (command == "plan") return "a request with dry_run=true";
  if (command != "build") return "";
  return option.empty() ? "a job" : "a job with " + spell_as_member(option, value);
}

}  // namespace voxdag::server
