#include "server/jobs/process/export_process.h"

#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "core/io/outputs/space_reserve.h"
#include "query/extract/extract.h"
#include "server/jobs/protocol/export_record.h"
#include "server/jobs/protocol/export_spec.h"
#include "server/jobs/protocol/spell_options.h"

namespace voxdag::server {
namespace {

ExportResult write_vdag(FileSystem& files, const voxdag_reader::File& file, const JobTask& task,
                        const ExportSpec& spec, Progress& progress, const CancelToken& cancel) {
  query::ExtractSpec extract;
  extract.selection = selection_of(spec, file);
  extract.crop = spec.crop;
  extract.majority = spec.majority;
  extract.output = task.output;
  extract.replace = true;
  extract.memory_bytes = task.memory_bytes;
  extract.threads = task.threads ? task.threads : default_threads();
  const query::ExtractReport report = query::extract(file, extract, files, progress, cancel);
  return {{{task.output, report.bytes, report.sha256}}, report.voxels, {}, report.warnings};
}

ExportResult write_format(FileSystem& files, const voxdag_reader::File& file, const JobTask& task,
                          const ExportSpec& spec, Progress& progress, const CancelToken& cancel) {
  query::ExportRequest request;
  request.format = &query::export_format(spec.to);
  request.selection = selection_of(spec, file);
  request.output = task.output;
  request.memory_bytes = task.memory_bytes;
  request.gray = spec.gray;
  request.replace = true;
  request.options = spec.options;
  const query::ExportReport report = query::export_dag(files, file, request, progress, cancel);
  ExportResult result{{}, report.voxels, report.notes, {}};
  progress.begin_stage("checksum", report.bytes, "bytes");
  for (const std::string& path : report.files) {
    const auto written = files.open_read(path);
    result.files.push_back({path, written->size(), sha256_of_file(*written, cancel, &progress)});
  }
  progress.end_stage();
  return result;
}

}  // namespace

std::string run_export(FileSystem& caller_files, const JobTask& task, Progress& progress,
                       const CancelToken& cancel) {
  set_audience(kExportUsers);
  const ExportSpec spec = parse_export_spec(task.request);
  SpaceReserve files(caller_files, task.min_free_bytes);
  const auto file = open_global_file(kExportInput);
  const auto write = spec.is_extract() ? write_vdag : write_format;
  return json_text(record_json(write(files, *file, task, spec, progress, cancel)));
}

}  // namespace voxdag::server
