#include "core/format/global/global_writer.h"

#include <algorithm>
#include <cstring>
#include <future>

#include "core/base/bounded_queue.h"
#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"
#include "core/format/global/block_checksums.h"
#include "core/format/global/global_layout.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr size_t kPiecesUnderWay = 2;  // from the thread that reads to the one that digests
constexpr uint64_t kReadBytes = uint64_t{1} << 20;  // a multiple of the block
static_assert(kReadBytes % kBlockBytes == 0);

// The header page, zeros but for the fields put.
class HeaderPage {
 public:
  template <class T>
  void put(size_t at, T value) {
    std::memcpy(bytes_.data() + at, &value, sizeof(value));
  }
  void seal() { put(kHeaderChecksumAt, checksum64(std::span(bytes_).first(kHeaderChecksumAt))); }
  std::span<const std::byte> bytes() const { return bytes_; }

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

uint64_t bytes_of(const GlobalLevel& level) { return sizeof(uint32_t) * level.words; }

}  // namespace

struct GlobalFileWriter::State {
  FileSystem& files;
  const std::string path;
  const std::string partial_path;
  const Grid grid;
  const uint32_t hash_bits;
  std::unique_ptr<WritableFile> file;  // once there is a level, or a header
  std::vector<GlobalLevel> levels;     // that ended, from the bricks upwards
  BlockSums sums;                      // of them and of the open one
  uint64_t summed_words = 0;           // of the open level
  bool level_open = false;
  bool kept = false;          // the partial file is to stay
  uint64_t end = kPageBytes;  // where the open level, the next one, or the table begins

  uint32_t brick_level() const { return grid.levels - kBrickLevels; }
  // The open level, or the next one.
  uint32_t current_level() const { return brick_level() - static_cast<uint32_t>(levels.size()); }
  bool complete() const { return levels.empty() || levels.size() == brick_level() + 1; }
  void create_file() {
    if (!file) file = files.create(partial_path);
  }
  HeaderPage header(uint64_t voxels, uint64_t svo_nodes, std::span<const std::byte> table) const;
  std::string digest(const HeaderPage& header, std::span<const uint64_t> checksums,
                     unsigned threads, const CancelToken& cancel) const;
  [[noreturn]] void damaged(uint64_t at) const {
    throw Error(ErrorCode::kCorrupt, partial_path + " from byte " + std::to_string(at) +
                                         " on is not what was written: the disk gave back other "
                                         "bytes");
  }
};

GlobalFileWriter::GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid,
                                   uint32_t hash_bits)
    : state_(new State{files, path, path + ".partial", grid, hash_bits, nullptr, {}, {}}) {}

GlobalFileWriter::~GlobalFileWriter() {
  if (state_->kept || !state_->file) return;
  state_->file.reset();
  try {
    state_->files.remove(state_->partial_path);
  } catch (const Error&) {
    // A partial file that cannot be removed is emptied by the next attempt.
  }
}

const std::string& GlobalFileWriter::path() const { return state_->path; }

GlobalProgress GlobalFileWriter::progress() const {
  return {state_->levels, state_->sums.checksums()};
}

void GlobalFileWriter::go_on(const GlobalProgress& progress) {
  State& s = *state_;
  uint64_t end = kPageBytes;
  for (const GlobalLevel& level : progress.levels) end += round_up_to_page(bytes_of(level));
  const auto written = s.files.open_read(s.partial_path);
  const uint64_t whole_blocks = (end - kPageBytes) / kBlockBytes;
  if (written->size() < end || progress.levels.size() > s.brick_level() + 1 ||
      progress.checksums.size() < whole_blocks)
    throw Error(ErrorCode::kCorrupt, s.partial_path + " does not hold the levels that were merged");
  BlockSums sums(std::span(progress.checksums).first(whole_blocks));
  const uint64_t last_block = kPageBytes + whole_blocks * kBlockBytes;
  read_through(*written, last_block, end, CancelToken(),
               [&](std::span<const std::byte> piece) { sums.add(piece); });
  if (sums.checksums() != progress.checksums) s.damaged(last_block);
  s.sums = std::move(sums);
  s.file = s.files.open_write(s.partial_path);
  s.levels = progress.levels;
  s.end = end;
  s.kept = true;
}

void GlobalFileWriter::sync() {
  state_->create_file();
  state_->file->sync();
  state_->files.sync_directory(parent_directory(state_->path));
  state_->kept = true;
}

void GlobalFileWriter::begin_level(uint32_t level) {
  State& s = *state_;
  if (s.level_open || level + s.levels.size() != s.brick_level())
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(level) +
                                         " does not follow the levels before it");
  s.create_file();
  s.summed_words = 0;
  s.level_open = true;
}

void GlobalFileWriter::checksum_words(std::span<const uint32_t> words) {
  state_->sums.add(std::as_bytes(words));
  state_->summed_words += words.size();
}

void GlobalFileWriter::write_words(uint64_t first, std::span<const uint32_t> words) {
  State& s = *state_;
  if (first > kMaxLevelWords || words.size() > kMaxLevelWords - first)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " is over the format's limit of 2^32 words per level");
  s.file->write_at(s.end + sizeof(uint32_t) * first, std::as_bytes(words));
}

void GlobalFileWriter::end_level(uint64_t nodes, uint64_t words) {
  State& s = *state_;
  if (words > kMaxLevelWords)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " has " + std::to_string(words) +
                                       " words, the format's limit is 2^32 a level");
  if (!s.level_open || nodes == 0 || words < 2 * nodes || words != s.summed_words)
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(s.current_level()) +
                                         " has " + std::to_string(nodes) + " nodes in " +
                                         std::to_string(words) + " words, of which " +
                                         std::to_string(s.summed_words) + " were summed");
  s.levels.push_back({nodes, words});
  const uint64_t level_end = s.end + bytes_of(s.levels.back());
  s.end = round_up_to_page(level_end);
  const std::byte zeros[kPageBytes] = {};
  const auto padding = std::span(zeros).first(s.end - level_end);
  s.sums.add(padding);
  s.file->write_at(level_end, padding);
  s.level_open = false;
}

HeaderPage GlobalFileWriter::State::header(uint64_t voxels, uint64_t svo_nodes,
                                           std::span<const std::byte> table) const {
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
  uint64_t dag_nodes = 0, offset = kPageBytes;
  for (size_t i = 0; i < levels.size(); ++i) {
    const size_t entry = kLevelsAt + (brick_level() - i) * kLevelEntryBytes;
    header.put(entry, offset);
    offset += round_up_to_page(bytes_of(levels[i]));
    header.put(entry + 8, levels[i].nodes);
    header.put(entry + 16, levels[i].words);
    dag_nodes += levels[i].nodes;
  }
  header.put(kDagNodesAt, dag_nodes);
  header.put(kFileBytesAt, end + table.size());
  header.put(kTableOffsetAt, end);
  header.put(kTableCountAt, table.size() / sizeof(uint64_t));
  header.put(kTableChecksumAt, checksum64(table));
  header.seal();
  return header;
}

// Of the whole file, which must be what was written.
std::string GlobalFileWriter::State::digest(const HeaderPage& header,
                                            std::span<const uint64_t> checksums, unsigned threads,
                                            const CancelToken& cancel) const {
  const auto written = files.open_read(partial_path);
  Sha256 digest;
  const auto add_expected = [&](uint64_t begin, std::span<const std::byte> expected) {
    read_through(*written, begin, begin + expected.size(), cancel,
                 [&](std::span<const std::byte> piece) {
                   digest.add(piece);
                   if (!std::ranges::equal(piece, expected.first(piece.size()))) damaged(begin);
                   expected = expected.subspan(piece.size());
                 });
  };
  add_expected(0, header.bytes());
  BlockSums read_back;
  // The digest is what takes long.
  run_producer_consumer<std::vector<std::byte>, kPiecesUnderWay>(
      threads,
      [&](auto pass) {
        for (uint64_t at = kPageBytes; at < end; at += kReadBytes)
          pass([&](std::vector<std::byte>& piece) {
            cancel.check();
            piece.resize(std::min(kReadBytes, end - at));
            written->read_at(at, piece);
            read_back.add(piece);
          });
      },
      [&](const std::vector<std::byte>& piece) { digest.add(piece); });
  const auto found = read_back.checksums();
  const auto wrong = std::ranges::mismatch(found, checksums).in1 - found.begin();
  if (static_cast<size_t>(wrong) < checksums.size()) damaged(kPageBytes + wrong * kBlockBytes);
  add_expected(end, std::as_bytes(checksums));
  return digest.finish();
}

bool is_global_file(FileSystem& files, const std::string& path) {
  const auto file = files.open_read(path);
  uint64_t magic = 0;
  if (file->size() < sizeof magic) return false;
  file->read_at(kMagicAt, std::as_writable_bytes(std::span(&magic, 1)));
  return magic == kMagic;
}

GlobalFileSummary GlobalFileWriter::seal(uint64_t voxels, uint64_t svo_nodes, unsigned threads,
                                         const CancelToken& cancel) {
  State& s = *state_;
  if (s.level_open || !s.complete())
    throw Error(ErrorCode::kCorrupt,
                s.path + ": level " + std::to_string(s.current_level()) + " is not finished");
  s.create_file();
  const std::vector<uint64_t> checksums = s.sums.checksums();
  const auto table = std::as_bytes(std::span(checksums));
  s.file->write_at(s.end, table);
  const HeaderPage header = s.header(voxels, svo_nodes, table);
  s.file->write_at(0, header.bytes());
  // The disk writes while we read back; where there is no thread to wait for it, afterwards.
  std::future<void> synced = std::async([&] { s.file->sync(); });
  const GlobalFileSummary summary{s.end + table.size(),
                                  s.digest(header, checksums, threads, cancel)};
  synced.get();
  return summary;
}

void GlobalFileWriter::publish() {
  State& s = *state_;
  s.file->close();
  s.files.rename(s.partial_path, s.path);
  s.kept = true;  // there is none any more
  s.files.sync_directory(parent_directory(s.path));
}

}  // namespace voxdag
