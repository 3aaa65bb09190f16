#include "query/combine/new_file.h"

#include <algorithm>

#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/combine/count_levels.h"
#include "query/combine/level_writer.h"
#include "query/dag/publish_file.h"

namespace voxdag::query {
namespace {

// Divisors of the memory limit. The quotients are the memory of one list, one sorter (spill.h), the
// values of one level, and one window of lookups (node_values.h). There are up to nine lists for
// each level, and up to six sorters and four levels of values at any time.
constexpr uint64_t kListShare = 1024;
constexpr uint64_t kSorterShare = 32;
constexpr uint64_t kValueShare = 10;
constexpr uint64_t kWindowShare = 32;
// The hashes of all nodes are in memory if they fit in memory_bytes / kHashShare.
constexpr uint64_t kHashShare = 8;
constexpr uint64_t kListBufferBytes = uint64_t{16} << 10;

// Copies the levels of `from` to `out`.
void copy_levels(DagInput& from, GlobalFileWriter& out) {
  constexpr uint64_t kChunkWords = uint64_t{1} << 16;
  for (uint32_t level = from.file().brick_level() + 1; level-- > 0;) {
    const voxdag_reader::Level& words = from.level(level);
    out.begin_level(level);
    for (uint64_t first = 0; first < words.word_count; first += kChunkWords) {
      const auto chunk = from.words(level, first, std::min(kChunkWords, words.word_count - first));
      out.checksum_words(chunk);
      out.write_words(first, chunk);
    }
    out.end_level({words.node_count, words.word_count});
  }
}

}  // namespace

Workspace::Workspace(const CombineSpec& combine_spec, FileSystem& file_system)
    : spec(combine_spec),
      files(file_system),
      budget(spec.memory_bytes),
      folder(files, spec.output + ".work-"),
      scratch(files, folder.path()),
      space{scratch, budget, share(kListShare), share(kSorterShare),
            std::min(spec.list_bytes, kListBufferBytes)},
      memory{share(kValueShare), share(kWindowShare)} {}

bool Workspace::has_room_for_hashes(uint64_t nodes) const {
  return sizeof(uint64_t) * nodes <= share(kHashShare);
}

NewCounts write_levels(DagInput& a, DagInput& b, NewLevels& levels, const Workspace& work,
                       GlobalFileWriter& out, Progress& progress) {
  const size_t count = levels.pairs.size();
  progress.begin_stage("merge", count, "levels");
  CountLevels counts(a, b, levels.reference, levels.bricks.counts, work.space, work.memory);
  LevelsWriter writer(a, b, work.space, work.memory, counts, out);
  writer.write_level(static_cast<uint32_t>(count - 1), *levels.joined.back(), *levels.pairs.back(),
                     levels.bricks.rows);
  progress.advance(1);
  for (size_t level = count - 1; level-- > 0 && writer.dag_nodes() > 0;) {
    SpillSorter<PairRow> rows(work.space);
    writer.write_level(static_cast<uint32_t>(level), *levels.joined[level], *levels.pairs[level],
                       rows);
    progress.advance(1);
  }
  progress.end_stage();
  if (writer.dag_nodes() == 0) return {};
  const OctreeCounts total = counts.total();
  return {{.voxels = total.voxels, .svo_nodes = total.nodes}, writer.dag_nodes()};
}

GlobalFileWriter NewFile::writer(const std::string& path) const {
  return GlobalFileWriter(work_.files, path, grid_of(grid_), grid_.hash_bits(),
                          work_.spec.narrow_words);
}

CombineReport NewFile::write(const WriteVoxels& write_voxels,
                             const WriteAttributes& write_attributes,
                             const std::function<void()>& before_publish) {
  GlobalFileWriter out = writer(work_.spec.output);
  CombineReport report =
      write_attributes ? write_all(out, write_voxels, write_attributes) : write_voxels(out);
  if (report.voxels == 0) progress_.warn("the result has no voxels: the file will have no nodes");
  report.grid = grid_of(grid_);
  finish(out, {.voxels = report.voxels, .svo_nodes = report.svo_nodes}, before_publish, report);
  report.work_bytes += work_.scratch.bytes_written();
  return report;
}

// Writes the levels and the attributes of the new file. The levels are written to a temporary file
// first, because the attributes follow from the set cells of the result.
CombineReport NewFile::write_all(GlobalFileWriter& out, const WriteVoxels& write_voxels,
                                 const WriteAttributes& write_attributes) {
  const std::string path = work_.folder.path() + "/levels.vdag";
  GlobalFileWriter levels = writer(path);
  CombineReport report = write_voxels(levels);
  if (report.voxels == 0) return report;
  cancel_.check();
  report.work_bytes +=
      levels.finish_temporary({.voxels = report.voxels, .svo_nodes = report.svo_nodes});
  const auto result = open_global_file(path);
  const WatchedFile watched(*result);
  watched.run([&] {
    DagInput input(*result, work_.spec.memory_bytes, cancel_);
    copy_levels(input, out);
    write_attributes(*result, out);
    watched.check_readable();
  });
  return report;
}

void NewFile::finish(GlobalFileWriter& out, const VoxelCounts& counts,
                     const std::function<void()>& before_publish, CombineReport& report) {
  if (work_.spec.temporary) {
    before_publish();
    report.bytes = out.finish_temporary(counts);
    return;
  }
  const GlobalFileSummary summary =
      publish_file(out, counts, work_.spec.threads, before_publish, progress_, cancel_);
  report.bytes = summary.bytes;
  report.sha256 = summary.sha256;
}

}  // namespace voxdag::query
