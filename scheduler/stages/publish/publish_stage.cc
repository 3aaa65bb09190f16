#include "scheduler/stages/publish/publish_stage.h"

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/io/file_system.h"

namespace voxdag {

bool is_published(BuildJob& job, AttributeSections& attributes) {
  BuildReport& report = job.report;
  FileSystem& files = job.context.files;
  const auto result = job.store->result();
  if (!result || result->output != report.output || !files.exists(report.output) ||
      sha256_of_file(*files.open_read(report.output), job.context.cancel) != result->sha256 ||
      attributes.digest() != result->sections)
    return false;
  report.sha256 = result->sha256;
  report.bytes = result->bytes;
  report.merge = result->merge;
  return true;
}

namespace {

// Renames the sealed file and the synced report, and syncs their folders. `report` is the path of
// the report, or "".
void rename_results(FileSystem& files, GlobalFileWriter& out, const std::string& report) {
  const std::string folder = parent_directory(out.path()), other = parent_directory(report);
  try {
    out.rename();
  } catch (const Error&) {
    if (!report.empty()) remove_partial_file(files, report);
    throw;
  }
  if (!report.empty()) rename_partial_file(files, report);
  files.sync_directory(folder);
  if (!report.empty() && other != folder) files.sync_directory(other);
}

}  // namespace

void publish(BuildJob& job, GlobalFileWriter& out, AttributeSections& attributes,
             const std::function<std::string()>& report_text) {
  BuildReport& report = job.report;
  FileSystem& files = job.context.files;
  Progress& progress = job.context.progress;
  progress.begin_stage("write", 1, "files");
  const GlobalFileSummary file =
      out.seal({.voxels = report.merge.voxels, .svo_nodes = report.merge.svo_nodes}, report.threads,
               job.context.cancel);
  job.store->record_result(
      {report.output, file.sha256, file.bytes, report.merge, attributes.digest()});
  report.bytes = file.bytes;
  report.sha256 = file.sha256;
  progress.advance(1);
  progress.end_stage();
  job.clock.finish("write");
  const std::string report_file = report_path(job.spec.run), text = report_text();
  if (report_file.empty())
    job.store
        ->move_to_disk();  // a later run recognizes the output only by the digest recorded here
  else
    write_partial_file(files, report_file, text);
  rename_results(files, out, report_file);
}

}  // namespace voxdag
