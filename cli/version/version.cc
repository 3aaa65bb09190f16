// voxdag version: the version, and with --verbose the commit, the compiler and the optional parts.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "cli/output.h"
#include "cli/version/commit.h"
#include "optional_features.h"

namespace voxdag::cli {
namespace {

struct VersionCommand {
  bool verbose = false;
  bool json = false;
};

bool is_included(const Feature& feature) { return feature.state == std::string_view("included"); }

// Returns the commit, or "unknown" for sources that are not in a Git repository.
std::string commit() { return *kCommit ? kCommit : "unknown"; }

// Returns the text to print after a feature that this build does not include: the packages to
// install if packages were missing, otherwise the feature's state.
std::string advice(const Feature& feature) {
  const bool is_missing = feature.state == std::string_view("missing");
  return is_missing ? std::string("install ") + feature.packages + ", and build voxdag again"
                    : feature.state;
}

void print_verbose() {
  std::printf("voxdag %s\n  commit    %s\n  compiler  %s, %s\n", VOXDAG_VERSION, commit().c_str(),
              kCompiler, kBuildType);
  for (const Feature& feature : kFeatures)
    std::printf("  %-8s  %-3s  %s%s\n", feature.name, is_included(feature) ? "yes" : "no",
                feature.purpose, is_included(feature) ? "" : (": " + advice(feature)).c_str());
}

nlohmann::ordered_json version_json() {
  nlohmann::ordered_json features = nlohmann::ordered_json::array();
  for (const Feature& feature : kFeatures)
    features.push_back({{"name", feature.name},
                        {"included", is_included(feature)},
                        {"purpose", feature.purpose},
                        {"packages", feature.packages}});
  return {{"version", VOXDAG_VERSION},
          {"commit", commit()},
          {"compiler", kCompiler},
          {"build_type", kBuildType},
          {"features", features}};
}

void declare(Command& command, VersionCommand& state) {
  command.flag("--verbose", state.verbose, "also print the commit, the compiler and the features");
  command.json_flag(state.json);
}

void run(const VersionCommand& command, CommandContext&) {
  if (command.json) return print_json(version_json());
  if (command.verbose) return print_verbose();
  std::printf("%s\n", VOXDAG_VERSION);
}

}  // namespace

void add_version_command(CommandLine& line) {
  add_command<VersionCommand>(line, "version", "print the version of voxdag and its features");
}

}  // namespace voxdag::cli
