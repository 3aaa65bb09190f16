#include <cstdio>

#include "cli/option_fields.h"
#include "cli/output.h"
#include "cli/service/service_options.h"
#include "cli/terminal/progress_bar.h"
#include "client/remote_export.h"
#include "client/result_download.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_fields.h"
#include "core/format/global/global_writer.h"
#include "server/jobs/protocol/export_spec.h"

namespace voxdag::cli {
namespace {

struct DownloadCommand {
  ServiceOptions service;
  std::string id;
  OutputFile output;
  server::ExportSpec spec;  // if it has no format, downloads the job's result
  bool quiet = false;
  bool json = false;
};

void print_file(const std::string& path, const client::DownloadResult& result) {
  std::printf("%s: %s, sha256 %s\n", printable_line(path).c_str(), size_text(result.bytes).c_str(),
              result.sha256.c_str());
}

Json file_json(const std::string& path, const client::DownloadResult& result) {
  return {{"output", path},
          {"bytes", result.bytes},
          {"resumed_bytes", result.resumed_bytes},
          {"sha256", result.sha256}};
}

// Returns the names of all files of the download. The server can know formats that this program
// does not know. A download in such a format has one file.
std::vector<std::string> output_paths(const DownloadCommand& command) {
  for (const query::ExportFormat& format : query::export_formats())
    if (command.spec.to == format.name) return query::export_paths(format, command.output.path);
  return {command.output.path};
}

void download_export(const DownloadCommand& command, ServiceClient& service, FileSystem& files,
                     const std::vector<std::string>& paths, Progress& progress) {
  const Json exported =
      client::make_export(service, command.id, Json(options_json(command.spec)), progress);
  const std::vector<client::RemoteFile> remote = client::files_of_export(exported);
  if (remote.size() != paths.size())
    throw Error(ErrorCode::kUnsupportedVersion,
                "the export of the server has " + std::to_string(remote.size()) +
                    " files: expected " + std::to_string(paths.size()) + " for the format " +
                    command.spec.to);
  // Exports of services before this member existed have their warnings in the notes.
  const Json warnings = exported.value("warnings", Json::array());
  for (const Json& warning : warnings) progress.warn(warning.get<std::string>());
  Json done = Json::array();
  for (size_t i = 0; i < remote.size(); ++i) {
    const auto result = client::download_file(service, files, remote[i], paths[i], progress);
    done.push_back(file_json(paths[i], result));
    if (!command.json && !command.quiet) print_file(paths[i], result);
  }
  if (command.json)
    return print_json(Json{{"export", exported.at("id")},
                           {"format", command.spec.to},
                           {"files", done},
                           {"voxels", exported.at("voxels")},
                           {"notes", exported.at("notes")},
                           {"warnings", warnings}});
  if (command.quiet) return;
  for (const Json& note : exported.at("notes"))
    std::printf("  %s\n", printable_line(note.get<std::string>()).c_str());
}

void run(const DownloadCommand& command, ServiceClient& service, CommandContext& context) {
  const bool is_export = !command.spec.to.empty();
  if (!is_export && !options_json(command.spec).empty())
    throw Error(
        ErrorCode::kInvalidInput,
        "an option of exports, such as --level, was given without --to: expected also --to FORMAT");
  const IsOwnFile is_own = is_export && !command.spec.is_extract()
                               ? [](const ReadableFile& file) { return file.size() == 0; }
                               : IsOwnFile(is_global_file);
  const std::vector<std::string> paths = output_paths(command);
  GuardedOutputs files(context.files);
  for (const std::string& path : paths) {
    const OutputFile output{path, command.output.force};
    output.guard(files);
    output.check(files, path, "", is_own);
  }
  const auto progress = make_progress_bar(command.quiet);
  if (is_export) return download_export(command, service, files, paths, *progress);
  const client::DownloadResult result = client::download_result(
      service, files, service.job(command.id), command.output.path, *progress);
  if (command.json)
    print_json(file_json(command.output.path, result));
  else if (!command.quiet)
    print_file(command.output.path, result);
}

void declare(Command& command, DownloadCommand& state) {
  command.option("id", state.id, "job id").required();
  command.output_option("-o,--output", state.output.path, "the file to write").required();
  command.option("--to", state.spec.to,
                 "let the server write the result in a format of `voxdag export`, or with vdag and "
                 "--level or --region a part of it (default: the complete .vdag file)");
  OptionDeclarer declarer(command, Scope::kSubmit);
  declarer.leave_out("to");
  fields(declarer, state.spec);
  state.service.declare(command);
  state.output.declare_force(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_download_command(CommandLine& line) {
  add_service_command<DownloadCommand>(line, "download",
                                       "download the result of a job of a server");
}

}  // namespace voxdag::cli
