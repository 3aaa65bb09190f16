#include "core/format/global_writer.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"
#include "core/format/global_layout.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kReadBytes = uint64_t{1} << 20;  // a multiple of the block
static_assert(kReadBytes % kBlockBytes == 0);

struct LevelEntry {
  uint64_t offset = 0, nodes = 0, words = 0;
};

// The header page, zeros but for the fields put.
class HeaderPage {
 public:
  template <class T>
  void put(size_t at, T value) {
    std::memcpy(bytes_.data() + at, &value, sizeof(value));
  }
  std::span<const std::byte> sealed() {
    put(kHeaderChecksumAt, checksum64(std::span(bytes_).first(kHeaderChecksumAt)));
    return bytes_;
  }

 private:
  std::vector<std::byte> bytes_ = std::vector<std::byte>(kPageBytes);
};

// Calls `use` with bytes [begin, end) of the file, piece by piece.
template <class Use>
void read_through(const ReadableFile& file, uint64_t begin, uint64_t end, const CancelToken& cancel,
                  Use use) {
  std::vector<std::byte> buffer(std::min(kReadBytes, end - begin));
  while (begin < end) {
    const auto piece = std::span(buffer).first(std::min<uint64_t>(buffer.size(), end - begin));
    cancel.check();
    file.read_at(begin, piece);
    use(std::span<const std::byte>(piece));
    begin += piece.size();
  }
}

std::vector<uint64_t> block_checksums(const ReadableFile& file, uint64_t end,
                                      const CancelToken& cancel) {
  std::vector<uint64_t> checksums;
  read_through(file, kPageBytes, end, cancel, [&](std::span<const std::byte> piece) {
    for (size_t at = 0; at < piece.size(); at += kBlockBytes)
      checksums.push_back(
          checksum64(piece.subspan(at, std::min<size_t>(kBlockBytes, piece.size() - at))));
  });
  return checksums;
}

}  // namespace

struct GlobalFileWriter::State {
  FileSystem& files;
  const std::string path;
  const std::string partial_path;
  const Grid grid;
  const uint32_t hash_bits;
  std::unique_ptr<WritableFile> file;
  std::vector<LevelEntry> levels;  // from the bricks upwards; the last one is open or the newest
  bool level_open = false;
  bool renamed = false;
  uint64_t end = kPageBytes;  // where the next level, or the table, begins

  uint32_t brick_level() const { return grid.levels - kBrickLevels; }
  uint32_t current_level() const {
    return brick_level() + 1 - static_cast<uint32_t>(levels.size());
  }
  void put_header(uint64_t voxels, uint64_t svo_nodes, std::span<const std::byte> table);
};

GlobalFileWriter::GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid,
                                   uint32_t hash_bits)
    : state_(new State{files, path, path + ".partial", grid, hash_bits, nullptr, {}}) {
  state_->file = files.create(state_->partial_path);
}

GlobalFileWriter::~GlobalFileWriter() {
  if (state_->renamed) return;
  state_->file.reset();
  try {
    state_->files.remove(state_->partial_path);
  } catch (const Error&) {
    // A partial file that cannot be removed is emptied by the next attempt.
  }
}

void GlobalFileWriter::begin_level(uint32_t level) {
  State& s = *state_;
  if (s.level_open || level + s.levels.size() != s.brick_level())
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(level) +
                                         " does not follow the levels before it");
  s.levels.push_back({s.end, 0, 0});
  s.level_open = true;
}

void GlobalFileWriter::write_words(uint64_t first, std::span<const uint32_t> words) {
  const State& s = *state_;
  if (first > kMaxLevelWords || words.size() > kMaxLevelWords - first)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " is over the format's limit of 2^32 words a level");
  s.file->write_at(s.levels.back().offset + sizeof(uint32_t) * first, std::as_bytes(words));
}

void GlobalFileWriter::end_level(uint64_t nodes, uint64_t words) {
  State& s = *state_;
  if (words > kMaxLevelWords)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " has " + std::to_string(words) +
                                       " words, the format's limit is 2^32 a level");
  if (!s.level_open || nodes == 0 || words < 2 * nodes)
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(s.current_level()) +
                                         " has " + std::to_string(nodes) + " nodes in " +
                                         std::to_string(words) + " words");
  LevelEntry& level = s.levels.back();
  level.nodes = nodes;
  level.words = words;
  const uint64_t level_end = level.offset + sizeof(uint32_t) * words;
  s.end = round_up_to_page(level_end);
  const std::byte zeros[kPageBytes] = {};
  s.file->write_at(level_end, std::span(zeros).first(s.end - level_end));
  s.level_open = false;
}

void GlobalFileWriter::State::put_header(uint64_t voxels, uint64_t svo_nodes,
                                         std::span<const std::byte> table) {
  HeaderPage header;
  header.put(kMagicAt, kMagic);
  header.put(kVersionAt, kVersion);
  header.put(kHeaderBytesAt, static_cast<uint32_t>(kPageBytes));
  header.put(kGridLevelsAt, grid.levels);
  header.put(kHashBitsAt, hash_bits);
  header.put(kNodeOrderAt, kNodeOrderByHash);
  header.put(kBlockBytesAt, static_cast<uint32_t>(kBlockBytes));
  for (size_t axis = 0; axis < 3; ++axis)
    header.put(kOriginAt + axis * sizeof(double), grid.origin[axis]);
  header.put(kEdgeAt, grid.edge);
  header.put(kVoxelsAt, voxels);
  header.put(kSvoNodesAt, svo_nodes);
  uint64_t dag_nodes = 0;
  for (size_t i = 0; i < levels.size(); ++i) {
    const size_t entry = kLevelsAt + (brick_level() - i) * kLevelEntryBytes;
    header.put(entry, levels[i].offset);
    header.put(entry + 8, levels[i].nodes);
    header.put(entry + 16, levels[i].words);
    dag_nodes += levels[i].nodes;
  }
  header.put(kDagNodesAt, dag_nodes);
  header.put(kFileBytesAt, end + table.size());
  header.put(kTableOffsetAt, end);
  header.put(kTableCountAt, table.size() / sizeof(uint64_t));
  header.put(kTableChecksumAt, checksum64(table));
  file->write_at(0, header.sealed());
}

bool is_global_file(FileSystem& files, const std::string& path) {
  const auto file = files.open_read(path);
  uint64_t magic = 0;
  if (file->size() < sizeof magic) return false;
  file->read_at(kMagicAt, std::as_writable_bytes(std::span(&magic, 1)));
  return magic == kMagic;
}

GlobalFileSummary GlobalFileWriter::finish(uint64_t voxels, uint64_t svo_nodes,
                                           const CancelToken& cancel) {
  State& s = *state_;
  if (s.level_open || (!s.levels.empty() && s.current_level() != 0))
    throw Error(ErrorCode::kCorrupt,
                s.path + ": level " + std::to_string(s.current_level()) + " is not finished");
  const auto written = s.files.open_read(s.partial_path);
  const std::vector<uint64_t> checksums = block_checksums(*written, s.end, cancel);
  const auto table = std::as_bytes(std::span(checksums));
  s.file->write_at(s.end, table);
  s.put_header(voxels, svo_nodes, table);

  GlobalFileSummary summary;
  summary.bytes = s.end + table.size();
  Sha256 digest;
  read_through(*s.files.open_read(s.partial_path), 0, summary.bytes, cancel,
               [&](std::span<const std::byte> piece) { digest.add(piece); });
  summary.sha256 = digest.finish();

  s.file->sync();
  s.file->close();
  s.files.rename(s.partial_path, s.path);
  s.renamed = true;
  s.files.sync_directory(parent_directory(s.path));
  return summary;
}

}  // namespace voxdag
