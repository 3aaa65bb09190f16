// The public functions of the merge. They merge many sub-DAGs, and the top tree above them, into
// one global DAG or one artifact.
//
// Levels are merged from the bricks up. The nodes above the subvolumes (the top tree) are one more
// run of their level. A level is merged hash partition by hash partition (usually one is enough):
//
//   load     the rows of all runs with a hash in the partition are read, and their children are
//            replaced by their positions in the merged level below (rewiring)
//   sort     the rows are divided into buckets, which are equal ranges of hashes; several threads
//            sort one bucket each and deduplicate its rows
//   output   buckets are written in the order of their hashes, and the position of every row is
//            stored for the level above
//
// Runs are sorted, so the merge finds the frames of a partition and the rows of a bucket by their
// hashes. With truncated hashes, a bucket or a single hash can have more rows than fit in memory; a
// k-way heap merge of the sorted runs merges these rows one by one. The memory budget is an upper
// limit for every scene. If not all runs fit in one pass, neighboring artifacts are first merged
// with each other, in one or more passes. docs/architecture.md, "Why the merge is right", has the
// proof; merge/load/row.h defines the terms.
#pragma once

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/artifact/artifact.h"
#include "core/format/artifact/segment_writer.h"
#include "core/format/global/global_writer.h"
#include "core/io/file_system.h"
#include "merge/types/checkpoint.h"
#include "merge/types/merge_inputs.h"
#include "merge/types/merge_report.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Merges all levels into `out`. Does not seal the file (GlobalFileWriter::seal()). Writes scratch
// files through `files`. If `checkpoint` is not null, saves the merge's state there, and resumes
// the state of an interrupted merge. Discards a state of other inputs with a warning, and starts
// over. Throws Error.
MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint = nullptr);

// Merges sub-DAGs into one artifact at the end of `out`, with all their roots. Equal rows of
// different sub-DAGs become one, so a later merge has fewer rows to read. There must be at least
// one input. Throws Error{kOutOfMemory} if one pass cannot merge all sub-DAGs and no two neighbors
// can be merged either, because any two need more memory than the budget has or have over 2^32 rows
// together. Throws Error{kLimit} if a level of the artifact would have over 2^32 rows.
ArtifactRef merge_to_artifact(const MergeInputs& inputs, FileSystem& files, SegmentWriter& out,
                              MemoryBudget& budget, unsigned threads, Progress& progress,
                              const CancelToken& cancel, MergeReport& report);

}  // namespace voxdag
