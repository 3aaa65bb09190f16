// Reads pieces of a scene on several threads and processes the results in the order of the pieces.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "scene/triangle_source.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/memory_plan.h"

namespace voxdag {

// Number of declared triangles per piece. The digest and the plan depend on this number.
inline constexpr uint64_t kPieceTriangles = 16384;

// Thrown if the budget has no room for all readers of the scene. read_pieces() then continues with
// one reader.
class TooManyReaders : public Error {
 public:
  explicit TooManyReaders(const Error& error) : Error(error) {}
};

// Reads the scene from triangle `position` to its end, piece by piece. Each reader has one Piece
// object and reads all its pieces with Piece::read() into this object. make_piece(piece) makes the
// object in an optional<Piece>. After each read, commit(piece, end) processes the piece and must
// set `position` to `end`, the index after the last triangle of the piece.
template <class Piece, class MakePiece, class Commit>
void read_pieces(TriangleSource& scene, const uint64_t& position, const StageContext& context,
                 MakePiece make_piece, Commit commit) {
  const auto read_rest = [&](unsigned max_readers) {
    const uint64_t first = position;
    const uint64_t declared = scene.declared_triangles();
    const uint64_t pieces =
        (declared - std::min(first, declared) + kPieceTriangles - 1) / kPieceTriangles;
    const unsigned readers = MemoryPlan::ingest_threads(pieces / MemoryPlan::kMinPiecesPerThread,
                                                        context.budget.available(), max_readers);
    struct Reader {
      std::unique_ptr<TriangleCursor> cursor;
      std::optional<Piece> piece;
    };
    std::vector<Reader> all(readers);
    const auto begin_of = [&](size_t item) { return first + item * kPieceTriangles; };
    const auto end_of = [&](size_t item) { return std::min(begin_of(item + 1), declared); };
    parallel_for_in_order(
        readers, pieces,
        [&](unsigned number, size_t item) {
          Reader& reader = all[number];
          try {
            if (!reader.piece) {
              reader.cursor = scene.open(readers);
              make_piece(reader.piece);
            }
            reader.piece->read(*reader.cursor, begin_of(item), end_of(item) - begin_of(item));
          } catch (const Error& error) {
            if (readers == 1 || error.code() != ErrorCode::kOutOfMemory) throw;
            throw TooManyReaders(error);
          }
        },
        [&](unsigned number, size_t item) {
          context.build.cancel.check();
          commit(*all[number].piece, end_of(item));
          context.build.progress.advance(end_of(item) - begin_of(item));
        });
  };
  try {
    read_rest(context.threads);
  } catch (const TooManyReaders&) {
    read_rest(1);
  }
}

}  // namespace voxdag
