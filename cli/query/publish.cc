#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/run_times.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "core/format/global/open_global.h"
#include "query/package/package_reader.h"
#include "query/package/write_package.h"
#include "server/site/poster.h"
#include "server/site/single_page.h"
#include "server/site/viewer_site.h"
#include "server/tiles/manifest.h"

namespace voxdag::cli {
namespace {

constexpr uint64_t kMinPackBytes = query::kFirstPackBytes, kMaxPackBytes = uint64_t{1} << 30;

struct PublishCommand {
  std::string input, output, check, title, url, memory, pack_size;
  bool gray = false, no_poster = false, single_file = false, force = false, quiet = false,
       json = false;
  unsigned threads = default_threads();
};

// Throws Error{kInvalidInput} if the value of an option is not valid UTF-8, as JSON and HTML
// require.
void refuse_other_encoding(const std::string& option, const std::string& value) {
  if (as_utf8(value) != value)
    throw Error(ErrorCode::kInvalidInput,
                option + " " + value + ": expected text that is valid UTF-8");
}

// Returns the title of the page: --title, or the name of the input file without its folder and
// ending.
std::string title_of(const PublishCommand& command) {
  if (!command.title.empty()) return command.title;
  const std::string name = command.input.substr(command.input.rfind('/') + 1);
  return as_utf8(name.substr(0, name.rfind('.')));
}

// Returns the URL of the published folder, with a slash at the end, or "" if it is not given.
std::string url_of(const std::string& url) {
  if (url.empty()) return "";
  if (!url.starts_with("https://") && !url.starts_with("http://"))
    throw Error(ErrorCode::kInvalidInput,
                "--url " + url + ": expected an address that begins with https:// or http://");
  return url.ends_with('/') ? url : url + '/';
}

uint64_t pack_bytes_of(const std::string& text) {
  const uint64_t bytes = parse_size(text, "--pack-size");
  if (bytes < kMinPackBytes || bytes > kMaxPackBytes)
    throw Error(ErrorCode::kInvalidInput, "--pack-size " + text + ": expected 256KiB to 1GiB");
  return bytes;
}

// Sets the manifest and the camera.
void describe(const PublishCommand& command, const voxdag_reader::File& file,
              const CancelToken& cancel, query::PackageSpec& spec) {
  auto manifest = server::file_manifest(file, query::DagView(file), "", cancel);
  manifest["tile_levels"] = query::kPackageTileLevels;
  manifest["name"] = title_of(command);
  spec.manifest = exact_json_text(manifest);
  if (manifest.contains("camera")) spec.camera = server::placement_of(manifest["camera"], file);
}

void print(const PublishCommand& command, const query::PackageReport& r, const RunTimes& times) {
  std::printf("%s: %s in %s files\n", printable_line(command.output).c_str(),
              size_text(r.bytes).c_str(), count_text(r.files).c_str());
  std::printf("  %s tiles and %s color pages in %s blocks\n", count_text(r.tiles).c_str(),
              count_text(r.color_pages).c_str(), count_text(r.blocks).c_str());
  std::printf("  %s wall, %s CPU, peak memory %s\n", duration_text(times.wall_s).c_str(),
              duration_text(times.cpu_s).c_str(), size_text(peak_resident_bytes()).c_str());
}

nlohmann::ordered_json report_json(const PublishCommand& command, const query::PackageReport& r,
                                   const RunTimes& times) {
  return {{"output", command.output},
          {"digest", r.digest},
          {"bytes", r.bytes},
          {"files", r.files},
          {"packs", r.packs},
          {"blocks", r.blocks},
          {"tiles", r.tiles},
          {"color_pages", r.color_pages},
          {"wall_s", times.wall_s},
          {"cpu_s", times.cpu_s},
          {"peak_rss_bytes", peak_resident_bytes()}};
}

void check(const PublishCommand& command, CommandContext& context) {
  if (!command.input.empty() || !command.output.empty())
    throw Error(ErrorCode::kInvalidInput,
                "--check " + command.check +
                    ": expected no .vdag file and no --output, because --check writes nothing");
  const auto progress = make_progress_bar(command.quiet);
  const query::PackageReader reader(context.files, command.check);
  reader.check(*progress, context.cancel);
  uint64_t tiles = 0, color_pages = 0;
  for (const query::PackageBand& band : reader.index().bands)
    (band.is_color ? color_pages : tiles) += band.items;
  const size_t packs = reader.index().packs.size();
  if (command.quiet && !command.json) return;
  if (command.json)
    print_json(nlohmann::ordered_json{{"package", command.check},
                                      {"packs", packs},
                                      {"tiles", tiles},
                                      {"color_pages", color_pages}});
  else
    std::printf("%s: intact, %s tiles and %s color pages in %s packs\n",
                printable_line(command.check).c_str(), count_text(tiles).c_str(),
                count_text(color_pages).c_str(), count_text(packs).c_str());
}

query::PackageReport write(const PublishCommand& command, const voxdag_reader::File& file,
                           const query::PackageSpec& spec, Progress& progress,
                           CommandContext& context) {
  const auto make_contents = [&]() -> server::PageContents {
    const std::string poster =
        command.no_poster ? "" : server::render_poster(file, spec, progress, context.cancel);
    return {title_of(command), poster, url_of(command.url)};
  };
  if (command.single_file)
    return server::write_single_page(file, spec, make_contents, command.force, context.files,
                                     progress, context.cancel);
  return query::write_package(
      file, spec, [&] { return server::viewer_site(make_contents()); }, context.files, progress,
      context.cancel);
}

void run(const PublishCommand& command, CommandContext& context) {
  if (!command.check.empty()) return check(command, context);
  if (command.input.empty() || command.output.empty())
    throw Error(
        ErrorCode::kInvalidInput,
        "the required input or output is missing: expected a .vdag file and --output DIR, or "
        "--check DIR");
  query::PackageSpec spec;
  spec.output = command.output;
  spec.colors = !command.gray;
  refuse_other_encoding("--title", command.title);
  refuse_other_encoding("--url", command.url);
  url_of(command.url);  // throws before any work is done
  spec.pack_bytes = pack_bytes_of(command.pack_size.empty() ? "8MiB" : command.pack_size);
  spec.memory_bytes = memory_limit(command.memory);
  spec.threads = command.threads;
  const auto file = open_global_file(command.input);
  describe(command, *file, context.cancel, spec);
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::PackageReport report = write(command, *file, spec, *progress, context);
  const RunTimes times = timer.elapsed();
  if (command.quiet && !command.json) return;
  if (!command.json) return print(command, report, times);
  print_json(report_json(command, report, times));
}

void declare(Command& command, PublishCommand& state) {
  command.option("input", state.input, "the .vdag file");
  command.output_option("-o,--output", state.output, "the folder to write, for a web server");
  const Option check =
      command.option("--check", state.check, "check all files of a folder that this command wrote");
  const auto of_writing = [&](Option option) { return option.excludes(check); };
  of_writing(
      command.option("--title", state.title, "title of the page (default: the name of the file)"));
  const Option single_file = of_writing(command.flag(
      "--single-file", state.single_file, "write one HTML file, which needs no web server"));
  command.flag("--force", state.force, "replace an existing file").needs(single_file);
  of_writing(command.option("--url", state.url,
                            "address of the published folder: other web sites then show a picture "
                            "with links"))
      .excludes(single_file);
  of_writing(command.flag("--no-poster", state.no_poster,
                          "leave out the picture that the page shows while it loads"));
  of_writing(command.flag("--gray", state.gray, "leave out the colors"));
  of_writing(command.option("--pack-size", state.pack_size,
                            "size of the files with tiles, such as 8MiB, the default"))
      .excludes(single_file);
  command.memory_option(state.memory);
  command.threads_option(state.threads);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_publish_command(CommandLine& line) {
  add_command<PublishCommand>(line, "publish", "write a DAG and its viewer for any web server");
}

}  // namespace voxdag::cli
