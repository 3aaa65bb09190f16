#include "query/export/export.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/option_fields.h"
#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/clock.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/open_global.h"
#include "query/export/chunks/export_chunks.h"

namespace voxdag::cli {
namespace {

struct ExportCommand {
  std::string input, format, output, memory;
  SelectionOptions selection;
  query::ExportOptions options;
  std::optional<uint64_t> chunks;
  uint64_t levels = 1;
  bool gray = false, force = false, quiet = false, json = false;
};

void print(const query::ExportReport& report, double wall_s) {
  for (const std::string& file : report.files)
    std::printf("%s%s", &file == report.files.data() ? "" : ", ", printable_line(file).c_str());
  std::printf(": %s, %s voxels, %s\n", size_text(report.bytes).c_str(),
              count_text(report.voxels).c_str(), duration_text(wall_s).c_str());
  for (const std::string& note : report.notes) std::printf("  %s\n", printable_line(note).c_str());
}

void print_chunks(const ExportCommand& command, const query::ChunksReport& report, double wall_s) {
  if (command.json)
    return print_json(nlohmann::ordered_json{{"format", command.format},
                                             {"manifest", report.manifest},
                                             {"chunks", report.chunks},
                                             {"bytes", report.bytes},
                                             {"voxels", report.voxels},
                                             {"peak_rss_bytes", peak_resident_bytes()},
                                             {"wall_s", wall_s}});
  if (command.quiet) return;
  std::printf("%s: %s chunks, %s, %s voxels, %s\n", printable_line(report.manifest).c_str(),
              count_text(report.chunks).c_str(), size_text(report.bytes).c_str(),
              count_text(report.voxels).c_str(), duration_text(wall_s).c_str());
}

void run(const ExportCommand& command, CommandContext& context) {
  query::ExportRequest request;
  request.format = &query::export_format(command.format);
  request.output = command.output;
  request.memory_bytes = memory_limit(command.memory);
  request.gray = command.gray;
  request.replace = command.force;
  request.options = command.options;
  with_option_names([&] { query::check_export_options(*request.format, request.options); });
  const auto progress = make_progress_bar(command.quiet);
  const auto file = open_global_file(command.input);
  request.selection = command.selection.selection(*file);
  const double start_s = wall_seconds();
  if (command.chunks)
    return print_chunks(
        command,
        query::export_chunks(context.files, *file, {request, *command.chunks, command.levels},
                             *progress, context.cancel),
        wall_seconds() - start_s);
  const query::ExportReport report =
      query::export_dag(context.files, *file, request, *progress, context.cancel);
  const double wall_s = wall_seconds() - start_s;
  if (command.quiet && !command.json) return;
  if (!command.json) return print(report, wall_s);
  print_json(nlohmann::ordered_json{{"format", command.format},
                                    {"files", report.files},
                                    {"bytes", report.bytes},
                                    {"voxels", report.voxels},
                                    {"notes", report.notes},
                                    {"facts", query::facts_json(report)},
                                    {"peak_rss_bytes", peak_resident_bytes()},
                                    {"wall_s", wall_s}});
}

std::string formats_text() {
  std::string text = "the format:";
  for (const query::ExportFormat& format : query::export_formats())
    text += std::string("\n") + format.name + ": " + format.summary;
  return text;
}

void declare(Command& command, ExportCommand& state) {
  command.option("input", state.input, "the .vdag file").required();
  command.option("--to", state.format, formats_text().c_str()).required();
  command.output_option("-o,--output", state.output, "the file to write").required();
  state.selection.declare(command);
  command.option("--memory", state.memory,
                 "limit of the memory that is allocated (default: half the RAM; at least 64MiB)");
  command.flag("--gray", state.gray, "leave out the colors that the file may have");
  OptionDeclarer declarer(command, Scope::kSubmit);
  fields(declarer, state.options);
  const Option chunks_option = command.edge_option(
      "--chunks", [&state](uint64_t edge) { state.chunks = edge; },
      "N: write a file for each cube of N voxels per edge that has voxels, into the folder -o, and "
      "manifest.json");
  command
      .option("--levels", state.levels,
              "with --chunks: also write the chunks of coarser levels, together this number "
              "(default: 1)")
      .positive()
      .needs(chunks_option);
  command.flag("--force", state.force, "replace existing files");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_export_command(CommandLine& line) {
  add_command<ExportCommand>(line, "export", "write the voxels in the format of another program");
}

}  // namespace voxdag::cli
