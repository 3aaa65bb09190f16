#include "core/format/global/diff.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"

namespace voxdag::cli {
namespace {

struct DiffCommand {
  std::string a, b;
  unsigned threads = default_threads();
  bool json = false;
};

void run(const DiffCommand& command, CommandContext& context) {
  const auto a = open_global_file(command.a), b = open_global_file(command.b);
  MemoryBudget budget(~uint64_t{0});
  const DiffReport report = diff_global_files(*a, *b, command.threads, budget, context.cancel);
  context.exit_status = report.same() ? 0 : 1;
  if (command.json) {
    print_json(nlohmann::ordered_json{{"same", report.same()},
                                      {"voxels_a", a->voxels()},
                                      {"voxels_b", b->voxels()},
                                      {"only_a", report.only_a},
                                      {"only_b", report.only_b}});
  } else if (report.same()) {
    std::printf("identical: %s voxels\n", count_text(a->voxels()).c_str());
  } else {
    std::printf("%s of %s voxels only in %s\n%s of %s voxels only in %s\n",
                count_text(report.only_a).c_str(), count_text(a->voxels()).c_str(),
                command.a.c_str(), count_text(report.only_b).c_str(),
                count_text(b->voxels()).c_str(), command.b.c_str());
  }
}

void declare(Command& command, DiffCommand& state) {
  command.option("a", state.a, "a .vdag file").required();
  command.option("b", state.b, "another .vdag file on the same grid").required();
  command.threads_option(state.threads);
  command.json_flag(state.json);
}

}  // namespace

void add_diff_command(CommandLine& line) {
  add_command<DiffCommand>(line, "diff",
                           "count the voxels only in A and only in B; exit status 1 if any");
}

}  // namespace voxdag::cli
