#include "query/reorder/reorder.h"

#include <algorithm>
#include <cstring>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/io/outputs/temporary_work.h"
#include "query/dag/dag_input.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/publish_file.h"
#include "query/reorder/order_levels.h"

namespace voxdag::query {
namespace {

using namespace global_layout;

constexpr uint64_t kCopyBytes = uint64_t{1} << 20;

// Copies the attribute sections of `file` to `out`, byte for byte. `input` reads the same file.
void copy_sections(const voxdag_reader::File& file, DagInput& input, GlobalFileWriter& out) {
  const auto get = [&](size_t at, auto& value) {
    std::memcpy(&value, file.data() + at, sizeof(value));
  };
  uint64_t count = 0;
  if (file.version() == kVersionWithFeatures) get(kAttributeCountAt, count);
  for (uint64_t i = 0; i < count; ++i) {
    const size_t entry = kAttributesAt + i * kAttributeEntryBytes;
    GlobalAttribute attribute;
    uint64_t offset = 0, bytes = 0;
    get(entry + kAttributeKindAt, attribute.kind);
    get(entry + kAttributeLevelsAt, attribute.cell_levels);
    get(entry + kAttributeOffsetAt, offset);
    get(entry + kAttributeBytesAt, bytes);
    get(entry + kAttributeCellsAt, attribute.cells);
    get(entry + kAttributeFinestCellsAt, attribute.finest_cells);
    get(entry + kAttributeBlockBytesAt, attribute.block_bytes);
    out.begin_section();
    for (uint64_t done = 0; done < bytes; done += kCopyBytes)
      out.append(input.bytes(offset + done, std::min(kCopyBytes, bytes - done)));
    out.end_section(attribute);
  }
}

}  // namespace

ReorderReport reorder(const voxdag_reader::File& file, const ReorderSpec& spec, FileSystem& files,
                      Progress& progress, const CancelToken& cancel) {
  LockedOutputs outputs(files, {{spec.output}, {file.path()}, spec.replace});
  const WatchedFile watched(file);
  const auto run = [&]() -> ReorderReport {
    MemoryBudget budget(spec.memory_bytes);
    const TemporaryWork folder(outputs.files(), spec.output + ".work-");
    ScratchFolder scratch(outputs.files(), folder.path());
    GlobalFileWriter out(outputs.files(), spec.output, grid_of(file), file.hash_bits(),
                         spec.narrow_words);
    order_levels(file, spec.order, {scratch, budget, spec.memory_bytes, spec.list_bytes}, out,
                 progress, cancel);
    DagInput input(file, spec.memory_bytes, cancel);
    copy_sections(file, input, out);
    const GlobalFileSummary summary = publish_file(
        out, {file.voxels(), file.svo_nodes()}, spec.threads, [&] { watched.check_readable(); },
        progress, cancel);
    return {summary.bytes, summary.sha256, scratch.bytes_written()};
  };
  return watched.run([&] { return with_reader_errors(run); });
}

}  // namespace voxdag::query
