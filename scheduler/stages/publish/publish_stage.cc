#include "scheduler/stages/publish/publish_stage.h"

#include "core/format/checksum.h"

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

void publish(BuildJob& job, GlobalFileWriter& out, AttributeSections& attributes) {
  BuildReport& report = job.report;
  Progress& progress = job.context.progress;
  progress.begin_stage("write", 1, "files");
  const GlobalFileSummary file =
      out.seal({.voxels = report.merge.voxels, .svo_nodes = report.merge.svo_nodes}, report.threads,
               job.context.cancel);
  job.store->record_result(
      {report.output, file.sha256, file.bytes, report.merge, attributes.digest()});
  out.publish();
  progress.advance(1);
  progress.end_stage();
  report.bytes = file.bytes;
  report.sha256 = file.sha256;
  job.clock.finish("write");
}

}  // namespace voxdag
