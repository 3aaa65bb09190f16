#include "core/format/global/global_writer.h"

#include <algorithm>
#include <cstring>
#include <future>
#include <optional>

#include "core/base/background.h"
#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"
#include "core/format/global/block_checksums.h"
#include "core/format/global/global_layout.h"
#include "core/io/buffered/buffered_writer.h"
#include "core/io/overwrite.h"
#include "core/io/temporary_paths.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kReadBytes = uint64_t{1} << 20;
static_assert(kReadBytes % kChecksumBlockBytes == 0);
// Digesting a smaller file takes a few milliseconds, so background threads are not worth their
// start.
constexpr uint64_t kMinBackgroundBytes = uint64_t{8} << 20;

// The header page. Fields that put() has not set are 0.
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

// Calls `use` with bytes [begin, end) of the file, in chunks.
template <class Use>
void read_through(const ReadableFile& file, uint64_t begin, uint64_t end, const CancelToken& cancel,
                  Use use) {
  std::vector<std::byte> buffer(std::min(kReadBytes, end - begin));
  while (begin < end) {
    const auto chunk = std::span(buffer).first(std::min<uint64_t>(buffer.size(), end - begin));
    cancel.check();
    file.read_at(begin, chunk);
    use(std::span<const std::byte>(chunk));
    begin += chunk.size();
  }
}

uint64_t bytes_of(const GlobalLevel& level) { return sizeof(uint32_t) * level.words; }

// A written attribute section.
struct Section {
  GlobalAttribute attribute;
  uint64_t offset = 0;
  uint64_t bytes = 0;
};

}  // namespace

struct GlobalFileWriter::State {
  FileSystem& files;
  const std::string path;
  const std::string partial_path;
  const Grid grid;
  const uint32_t hash_bits;
  const uint64_t narrow_words;
  std::unique_ptr<BufferedWriter> file;  // null until the first level or the header is written
  std::vector<GlobalLevel> levels;       // complete levels, from the bricks upwards
  std::vector<Section> sections;         // complete sections
  BlockChecksums block_checksums;        // checksums of the complete and open levels and sections
  uint64_t checksummed_words = 0;        // words of the open level that block_checksums includes
  bool level_open = false;
  uint64_t section_bytes = 0;  // bytes of the open section
  bool section_open = false;
  NodeOrder node_order = NodeOrder::kByHash;
  std::optional<PlacedChecksums> placed = {};    // checksums of levels that place_levels() placed
  bool retained = false;                         // the partial file outlives the writer
  std::optional<TemporaryPath> registered = {};  // registers the partial file for removal, until it
                                                 // is retained
  uint64_t end = kPageBytes;  // offset of the open or next level or section, or of the checksums

  uint32_t brick_level() const { return grid.levels - kBrickLevels; }
  // Returns the open level, or the next level to open.
  uint32_t current_level() const { return brick_level() - static_cast<uint32_t>(levels.size()); }
  bool complete() const { return levels.empty() || levels.size() == brick_level() + 1; }
  void retain() {
    retained = true;
    registered.reset();
  }
  void create_file() {
    if (file) return;
    file = std::make_unique<BufferedWriter>(files.create(partial_path));
    registered.emplace(partial_path);
  }
  // Returns the offset in the file of a level that place_levels() placed.
  uint64_t offset_of(uint32_t level) const {
    uint64_t offset = kPageBytes;
    for (uint32_t l = brick_level(); l > level; --l)
      offset += round_up_to_page(bytes_of(levels[brick_level() - l]));
    return offset;
  }
  void write_placed(uint64_t offset, std::span<const std::byte> bytes) {
    file->write_at(offset, bytes);
    placed->add(offset - kPageBytes, bytes);
  }
  // Pads a level or section that ends at byte `content_end` to complete pages.
  void pad(uint64_t content_end);
  void put_sections(HeaderPage& header) const;
  HeaderPage header(const VoxelCounts& counts, std::span<const std::byte> table) const;
  HeaderPage write_header(const VoxelCounts& counts, std::span<const uint64_t> checksums);
  std::string digest(const HeaderPage& header, std::span<const uint64_t> checksums,
                     unsigned threads, const CancelToken& cancel) const;
  [[noreturn]] void damaged(uint64_t at) const {
    throw Error(ErrorCode::kCorrupt,
                partial_path + " from byte " + std::to_string(at) +
                    " differs from the bytes that this build wrote: expected a file that no "
                    "other process changes; start the build again");
  }
};

GlobalFileWriter::GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid,
                                   uint32_t hash_bits, uint64_t narrow_words)
    : state_(new State{
          files, path, path + ".partial", grid, hash_bits, narrow_words, {}, {}, {}, {}}) {}

GlobalFileWriter::~GlobalFileWriter() {
  if (state_->retained || !state_->file) return;
  state_->file.reset();
  try {
    state_->files.remove(state_->partial_path);
  } catch (const Error&) {
    // An error here is ignored: the next writer empties the remaining partial file.
  }
}

const std::string& GlobalFileWriter::path() const { return state_->path; }
uint64_t GlobalFileWriter::narrow_words() const { return state_->narrow_words; }

GlobalFileProgress GlobalFileWriter::progress() const {
  return {state_->levels, state_->block_checksums.values()};
}

void GlobalFileWriter::resume(const GlobalFileProgress& progress) {
  State& s = *state_;
  uint64_t end = kPageBytes;
  for (const GlobalLevel& level : progress.levels) end += round_up_to_page(bytes_of(level));
  const auto written = s.files.open_own(s.partial_path);
  const uint64_t whole_blocks = (end - kPageBytes) / kChecksumBlockBytes;
  const auto expect = [&](const char* what, uint64_t found, const char* limit, uint64_t expected) {
    throw Error(ErrorCode::kCorrupt, s.partial_path + " and its saved state: " + what + " is " +
                                         std::to_string(found) + ", expected at " + limit + " " +
                                         std::to_string(expected));
  };
  if (written->size() < end) expect("the number of bytes", written->size(), "least", end);
  if (progress.levels.size() > s.brick_level() + 1)
    expect("the number of merged levels", progress.levels.size(), "most", s.brick_level() + 1);
  if (progress.checksums.size() < whole_blocks)
    expect("the number of checksums", progress.checksums.size(), "least", whole_blocks);
  BlockChecksums checksums(std::span(progress.checksums).first(whole_blocks));
  const uint64_t last_block = kPageBytes + whole_blocks * kChecksumBlockBytes;
  read_through(*written, last_block, end, CancelToken(),
               [&](std::span<const std::byte> chunk) { checksums.add(chunk); });
  if (checksums.values() != progress.checksums) s.damaged(last_block);
  s.block_checksums = std::move(checksums);
  s.file = std::make_unique<BufferedWriter>(s.files.open_write(s.partial_path));
  s.levels = progress.levels;
  s.end = end;
  s.retain();
}

void GlobalFileWriter::sync() {
  state_->create_file();
  state_->file->sync();
  state_->files.sync_directory(parent_directory(state_->path));
  state_->retain();
}

void GlobalFileWriter::begin_level(uint32_t level) {
  State& s = *state_;
  if (s.level_open || level + s.levels.size() != s.brick_level())
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(level) +
                                         " begins after " + std::to_string(s.levels.size()) +
                                         " finished levels" +
                                         (s.level_open ? " and one unfinished level" : "") +
                                         ": expected the levels one after another, from level " +
                                         std::to_string(s.brick_level()) + " to level 0");
  s.create_file();
  s.checksummed_words = 0;
  s.level_open = true;
}

void GlobalFileWriter::checksum_words(std::span<const uint32_t> words) {
  state_->block_checksums.add(std::as_bytes(words));
  state_->checksummed_words += words.size();
}

void GlobalFileWriter::write_words(uint64_t first, std::span<const uint32_t> words) {
  State& s = *state_;
  if (first > kMaxLevelWords || words.size() > kMaxLevelWords - first)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " would have at least " +
                                       std::to_string(first + words.size()) +
                                       " words: expected at most 2^40 (1099511627776), the "
                                       "format's limit; use a lower resolution");
  s.file->write_at(s.end + sizeof(uint32_t) * first, std::as_bytes(words));
}

void GlobalFileWriter::end_level(const GlobalLevel& level) {
  State& s = *state_;
  const auto [nodes, words] = level;
  if (words > kMaxLevelWords)
    throw Error(ErrorCode::kLimit, s.path + ": level " + std::to_string(s.current_level()) +
                                       " has " + std::to_string(words) +
                                       " words: expected at most 2^40 (1099511627776), the "
                                       "format's limit; use a lower resolution");
  if (!s.level_open || nodes == 0 || words < 2 * nodes || words != s.checksummed_words)
    throw Error(ErrorCode::kCorrupt, s.path + ": level " + std::to_string(s.current_level()) +
                                         " cannot end with " + std::to_string(nodes) +
                                         " nodes in " + std::to_string(words) + " words, " +
                                         std::to_string(s.checksummed_words) +
                                         " of them checksummed: expected an open level with nodes "
                                         "of two words or more, all checksummed");
  s.levels.push_back(level);
  s.pad(s.end + bytes_of(level));
  s.level_open = false;
}

void GlobalFileWriter::set_node_order(NodeOrder order) { state_->node_order = order; }

void GlobalFileWriter::place_levels(std::span<const GlobalLevel> levels) {
  State& s = *state_;
  if (s.file || levels.size() != s.brick_level() + 1)
    throw Error(ErrorCode::kCorrupt, s.path + ": " + std::to_string(levels.size()) +
                                         " levels cannot be placed: expected all " +
                                         std::to_string(s.brick_level() + 1) +
                                         " levels of a new file");
  s.create_file();
  s.levels.assign(levels.begin(), levels.end());
  s.end = s.offset_of(0) + round_up_to_page(bytes_of(levels.back()));
  s.placed.emplace(s.end - kPageBytes);
  const std::byte zeros[kPageBytes] = {};
  for (uint32_t level = 0; level <= s.brick_level(); ++level) {
    const uint64_t end = s.offset_of(level) + bytes_of(levels[s.brick_level() - level]);
    s.write_placed(end, std::span(zeros).first(round_up_to_page(end) - end));
  }
}

void GlobalFileWriter::write_placed(uint32_t level, uint64_t first,
                                    std::span<const uint32_t> words) {
  State& s = *state_;
  s.write_placed(s.offset_of(level) + sizeof(uint32_t) * first, std::as_bytes(words));
}

void GlobalFileWriter::finish_placed() {
  State& s = *state_;
  if (s.placed->missing() > 0)
    throw Error(ErrorCode::kCorrupt, s.path + ": " + std::to_string(s.placed->missing()) +
                                         " bytes of the levels were not written: expected none");
  s.block_checksums = s.placed->finish();
  s.placed.reset();
}

void GlobalFileWriter::begin_section() {
  State& s = *state_;
  if (s.level_open || s.section_open || s.levels.empty() || !s.complete() ||
      s.sections.size() == kMaxAttributes)
    throw Error(ErrorCode::kCorrupt,
                s.path +
                    ": expected an attribute section only after all levels, with no other "
                    "section open, and at most " +
                    std::to_string(kMaxAttributes) + " sections: found " +
                    std::to_string(s.levels.size()) + " of " + std::to_string(s.brick_level() + 1) +
                    " levels and " + std::to_string(s.sections.size()) + " sections");
  s.section_bytes = 0;
  s.section_open = true;
}

void GlobalFileWriter::append(std::span<const std::byte> bytes) {
  State& s = *state_;
  s.file->write_at(s.end + s.section_bytes, bytes);
  s.block_checksums.add(bytes);
  s.section_bytes += bytes.size();
}

uint64_t GlobalFileWriter::section_bytes() const { return state_->section_bytes; }

void GlobalFileWriter::end_section(const GlobalAttribute& attribute) {
  State& s = *state_;
  const std::string name = s.path + ": the section of attribute " + std::to_string(attribute.kind);
  if (!s.section_open || s.section_bytes == 0)
    throw Error(ErrorCode::kCorrupt, name + " has no bytes: expected at least one byte");
  if (!s.sections.empty() && s.sections.back().attribute.kind >= attribute.kind)
    throw Error(ErrorCode::kCorrupt, name + " follows attribute " +
                                         std::to_string(s.sections.back().attribute.kind) +
                                         ": expected increasing numbers of attributes");
  s.sections.push_back({attribute, s.end, s.section_bytes});
  s.pad(s.end + s.section_bytes);
  s.section_open = false;
}

void GlobalFileWriter::State::pad(uint64_t content_end) {
  end = round_up_to_page(content_end);
  const std::byte zeros[kPageBytes] = {};
  const auto padding = std::span(zeros).first(end - content_end);
  block_checksums.add(padding);
  file->write_at(content_end, padding);
}

void GlobalFileWriter::State::put_sections(HeaderPage& header) const {
  header.put(kAttributeCountAt, uint64_t{sections.size()});
  for (size_t i = 0; i < sections.size(); ++i) {
    const Section& section = sections[i];
    const size_t entry = kAttributesAt + i * kAttributeEntryBytes;
    header.put(entry + kAttributeKindAt, section.attribute.kind);
    header.put(entry + kAttributeLevelsAt, section.attribute.cell_levels);
    header.put(entry + kAttributeOffsetAt, section.offset);
    header.put(entry + kAttributeBytesAt, section.bytes);
    header.put(entry + kAttributeCellsAt, section.attribute.cells);
    header.put(entry + kAttributeFinestCellsAt, section.attribute.finest_cells);
    header.put(entry + kAttributeBlockBytesAt, section.attribute.block_bytes);
  }
}

HeaderPage GlobalFileWriter::State::header(const VoxelCounts& counts,
                                           std::span<const std::byte> table) const {
  const auto is_wide = [&](const GlobalLevel& level) { return level.words > narrow_words; };
  const bool has_wide_levels = std::ranges::any_of(levels, is_wide);
  const uint64_t features =
      (has_wide_levels ? kWideLevels : 0) | (sections.empty() ? 0 : kAttributes);
  HeaderPage header;
  header.put(kMagicAt, kMagic);
  header.put(kVersionAt, features ? kVersionWithFeatures : kVersion);
  header.put(kFeaturesAt, features);
  header.put(kHeaderBytesAt, static_cast<uint32_t>(kPageBytes));
  header.put(kGridLevelsAt, grid.levels);
  header.put(kHashBitsAt, hash_bits);
  header.put(kNodeOrderAt, static_cast<uint32_t>(node_order));
  header.put(kChecksumBlockBytesAt, static_cast<uint32_t>(kChecksumBlockBytes));
  for (size_t axis = 0; axis < 3; ++axis)
    header.put(kOriginAt + axis * sizeof(double), grid.origin[axis]);
  header.put(kEdgeAt, grid.edge);
  header.put(kVoxelsAt, counts.voxels);
  header.put(kSvoNodesAt, counts.svo_nodes);
  uint64_t dag_nodes = 0, offset = kPageBytes;
  for (size_t i = 0; i < levels.size(); ++i) {
    const size_t entry = kLevelsAt + (brick_level() - i) * kLevelEntryBytes;
    header.put(entry, offset);
    offset += round_up_to_page(bytes_of(levels[i]));
    header.put(entry + 8, levels[i].nodes);
    header.put(entry + 16, levels[i].words);
    if (features) header.put(entry + 24, uint64_t{is_wide(levels[i]) ? 64u : 32u});
    dag_nodes += levels[i].nodes;
  }
  put_sections(header);
  header.put(kDagNodesAt, dag_nodes);
  header.put(kFileBytesAt, end + table.size());
  header.put(kTableOffsetAt, end);
  header.put(kTableCountAt, table.size() / sizeof(uint64_t));
  header.put(kTableChecksumAt, checksum64(table));
  header.seal();
  return header;
}

// Reads the complete file and returns its SHA-256. Throws Error{kCorrupt} if the bytes differ from
// the written bytes.
std::string GlobalFileWriter::State::digest(const HeaderPage& header,
                                            std::span<const uint64_t> checksums, unsigned threads,
                                            const CancelToken& cancel) const {
  const auto written = files.open_own(partial_path);
  Sha256 digest;
  const auto add_expected = [&](uint64_t begin, std::span<const std::byte> expected) {
    read_through(*written, begin, begin + expected.size(), cancel,
                 [&](std::span<const std::byte> chunk) {
                   digest.add(chunk);
                   if (!std::ranges::equal(chunk, expected.first(chunk.size()))) damaged(begin);
                   expected = expected.subspan(chunk.size());
                 });
  };
  add_expected(0, header.bytes());
  BlockChecksums read_back;
  // Digesting a chunk takes longer than reading it and computing its checksums. So with several
  // threads, a background thread digests a chunk while the next chunk is read.
  const bool in_background = threads > 1 && end >= kMinBackgroundBytes;
  std::vector<std::byte> chunk, digested_chunk;
  std::future<void> digested;
  for (uint64_t at = kPageBytes; at < end; at += kReadBytes) {
    cancel.check();
    chunk.resize(std::min(kReadBytes, end - at));
    written->read_at(at, chunk);
    read_back.add(chunk);
    if (digested.valid()) digested.get();
    chunk.swap(digested_chunk);
    if (in_background)
      digested = run_in_background([&] { digest.add(digested_chunk); });
    else
      digest.add(digested_chunk);
  }
  if (digested.valid()) digested.get();
  const auto found = read_back.values();
  const auto wrong = std::ranges::mismatch(found, checksums).in1 - found.begin();
  if (static_cast<size_t>(wrong) < checksums.size())
    damaged(kPageBytes + wrong * kChecksumBlockBytes);
  add_expected(end, std::as_bytes(checksums));
  return digest.finish();
}

bool is_global_file(const ReadableFile& file) {
  uint64_t magic = 0;
  if (file.size() < sizeof magic) return false;
  file.read_at(kMagicAt, std::as_writable_bytes(std::span(&magic, 1)));
  return magic == kMagic;
}

bool is_partial_global_file(const ReadableFile& file) {
  return is_global_file(file) || begins_with(file, std::string(kPageBytes, '\0'));
}

GlobalFileFrame GlobalFileWriter::frame(const VoxelCounts& counts) const {
  const State& s = *state_;
  if (s.level_open || s.placed || s.section_open || !s.sections.empty() || !s.complete())
    throw Error(ErrorCode::kCorrupt,
                s.path + ": expected all levels and no attribute section: found " +
                    std::to_string(s.levels.size()) + " of " + std::to_string(s.brick_level() + 1) +
                    " levels and " + std::to_string(s.sections.size()) + " sections");
  if (s.file) s.file->flush();
  const std::vector<uint64_t> checksums = s.block_checksums.values();
  const auto table = std::as_bytes(std::span(checksums));
  const HeaderPage header = s.header(counts, table);
  return {{header.bytes().begin(), header.bytes().end()}, {table.begin(), table.end()}};
}

// Writes the checksum table and the header, which the file needs to be complete. Returns the
// header.
HeaderPage GlobalFileWriter::State::write_header(const VoxelCounts& counts,
                                                 std::span<const uint64_t> checksums) {
  if (level_open || placed || section_open || !complete())
    throw Error(ErrorCode::kCorrupt,
                path +
                    (section_open ? ": the attribute section"
                                  : ": level " + std::to_string(current_level())) +
                    " is not finished");
  create_file();
  const auto table = std::as_bytes(checksums);
  file->write_at(end, table);
  HeaderPage page = header(counts, table);
  file->write_at(0, page.bytes());
  file->flush();  // digest() reads the file
  return page;
}

GlobalFileSummary GlobalFileWriter::seal(const VoxelCounts& counts, unsigned threads,
                                         const CancelToken& cancel) {
  State& s = *state_;
  const std::vector<uint64_t> checksums = s.block_checksums.values();
  const HeaderPage header = s.write_header(counts, checksums);
  // digest() reads the file while a background thread waits for the disk.
  std::future<void> synced = run_in_background([&s] { s.file->sync(); });
  const GlobalFileSummary summary{s.end + std::as_bytes(std::span(checksums)).size(),
                                  s.digest(header, checksums, threads, cancel)};
  synced.get();
  return summary;
}

uint64_t GlobalFileWriter::finish_temporary(const VoxelCounts& counts) {
  const std::vector<uint64_t> checksums = state_->block_checksums.values();
  state_->write_header(counts, checksums);
  rename();
  return state_->end + std::as_bytes(std::span(checksums)).size();
}

void GlobalFileWriter::publish() {
  rename();
  state_->files.sync_directory(parent_directory(state_->path));
}

void GlobalFileWriter::rename() {
  State& s = *state_;
  s.file->close();
  s.files.rename(s.partial_path, s.path);
  s.retain();  // the file has its final name
}

}  // namespace voxdag
