#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/diff_colors.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/verify/count_different.h"

namespace voxdag::cli {
namespace {

struct DiffCommand {
  std::string a, b;
  std::string memory, work;
  unsigned threads = default_threads();
  bool color = false;
  bool quiet = false;
  bool json = false;
};

nlohmann::ordered_json colors_json(const voxdag_reader::File& a, const voxdag_reader::File& b,
                                   const ColorDiff& colors) {
  return {{"resolution", int64_t{1} << colors.levels},
          {"resolution_a", int64_t{1} << a.color_levels()},
          {"resolution_b", int64_t{1} << b.color_levels()},
          {"cells", colors.cells},
          {"different", colors.different_cells},
          {"largest_difference", colors.largest},
          {"mean_difference", colors.mean()},
          {"psnr_db", std::isfinite(colors.psnr()) ? nlohmann::ordered_json(colors.psnr())
                                                   : nlohmann::ordered_json()}};
}

void print_colors(const voxdag_reader::File& a, const voxdag_reader::File& b,
                  const ColorDiff& colors) {
  if (a.color_levels() != b.color_levels())
    std::printf("colors of %lld^3 cells in %s, of %lld^3 in %s\n", 1LL << a.color_levels(),
                a.path().c_str(), 1LL << b.color_levels(), b.path().c_str());
  std::printf("colors of %lld^3 cells: ", 1LL << colors.levels);
  if (colors.different_cells == 0)
    std::printf("identical in all %s cells of both\n", count_text(colors.cells).c_str());
  else
    std::printf("%s of %s cells differ, by %u at most in a channel, by %.3g in the mean; %.1f dB\n",
                count_text(colors.different_cells).c_str(), count_text(colors.cells).c_str(),
                colors.largest, colors.mean(), colors.psnr());
}

void run(const DiffCommand& command, CommandContext& context) {
  const auto a = open_global_file(command.a), b = open_global_file(command.b);
  query::CountDifferentSpec spec;
  spec.threads = command.threads;
  spec.memory_bytes = memory_limit(command.memory);
  spec.work_prefix = work_prefix(command.a, command.work);
  const auto progress = make_progress_bar(command.quiet);
  const WatchedFile watched_a(*a), watched_b(*b);
  query::CountDifferentReport counted;
  std::optional<ColorDiff> colors;
  const auto compare = [&] {
    if (command.color) colors = diff_colors(*a, *b, command.threads, context.cancel);
    counted = query::count_different(*a, *b, spec, context.files, *progress, context.cancel);
    watched_a.check_readable();
    watched_b.check_readable();
  };
  watched_a.run([&] { watched_b.run(compare); });
  const DiffReport& report = counted.voxels;
  const bool same_colors =
      !colors || (colors->different_cells == 0 && a->color_levels() == b->color_levels());
  context.exit_status = report.same() && same_colors ? 0 : 1;
  if (command.json) {
    nlohmann::ordered_json json{{"same", report.same() && same_colors},
                                {"voxels_a", a->voxels()},
                                {"voxels_b", b->voxels()},
                                {"only_a", report.only_a},
                                {"only_b", report.only_b},
                                {"work_bytes", counted.work_bytes},
                                {"peak_rss_bytes", peak_resident_bytes()}};
    if (colors) json["colors"] = colors_json(*a, *b, *colors);
    print_json(json);
    return;
  }
  if (report.same()) {
    std::printf("identical: %s voxels\n", count_text(a->voxels()).c_str());
  } else {
    std::printf("%s of %s voxels only in %s\n%s of %s voxels only in %s\n",
                count_text(report.only_a).c_str(), count_text(a->voxels()).c_str(),
                printable_line(command.a).c_str(), count_text(report.only_b).c_str(),
                count_text(b->voxels()).c_str(), printable_line(command.b).c_str());
  }
  if (colors) print_colors(*a, *b, *colors);
}

void declare(Command& command, DiffCommand& state) {
  command.option("a", state.a, "a .vdag file").required();
  command.option("b", state.b, "another .vdag file on the same grid").required();
  command.flag("--color", state.color, "also compare the colors of cells that both files have");
  command.option("--memory", state.memory,
                 "memory for tables and for mapped pages of the files; default: half the RAM");
  command.option("--work", state.work,
                 "folder for temporary files if --memory is not sufficient; default: the folder of "
                 "the file A");
  command.threads_option(state.threads);
  command.quiet_flag(state.quiet, "print only the differences, warnings and errors");
  command.json_flag(state.json);
}

}  // namespace

void add_diff_command(CommandLine& line) {
  add_command<DiffCommand>(line, "diff",
                           "count the voxels only in A and only in B; exit status 1 if any");
}

}  // namespace voxdag::cli
