#include "core/format/verify/verify.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/parallel_for.h"
#include "core/color/cell_values.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/checked_level.h"
#include "core/format/verify/verify_checksums.h"
#include "core/format/verify/verify_colors.h"
#include "core/format/verify/verify_nodes.h"

namespace voxdag {

using namespace global_layout;

namespace {

class Verifier {
 public:
  Verifier(const VerifyTask& task, uint64_t narrow_words)
      : task_(task), file_(task.file), narrow_words_(narrow_words) {}

  void run() {
    check_header();
    verify_checksums(file_, task_.threads, task_.pages, task_.progress, task_.cancel);
    check_padding();
    verify_nodes(task_);
    verify_colors(file_, task_.threads, task_.progress, task_.cancel, task_.pages);
  }

 private:
  [[noreturn]] void broken(const std::string& where, const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, where + ": " + what);
  }
  std::string where(uint32_t level) const {
    return file_.path() + ": level " + std::to_string(level);
  }

  void check_header() const;
  void check_attributes(bool has_attributes) const;
  void check_section(size_t entry, Attribute attribute) const;
  void check_padding() const;
  void check_zeros(uint64_t begin, uint64_t end, const std::string& what) const;

  const VerifyTask& task_;
  const voxdag_reader::File& file_;
  const uint64_t narrow_words_;
};

void Verifier::check_zeros(uint64_t begin, uint64_t end, const std::string& what) const {
  for (uint64_t at = begin; at < end; ++at)
    if (file_.data()[at] != 0)
      broken(file_.path() + ": byte " + std::to_string(at),
             what + " is " + std::to_string(file_.data()[at]) + ", expected 0");
}

// The reader has checked the fields that it uses. This function checks all other fields, which must
// have fixed values.
void Verifier::check_header() const {
  if (*name_of(NodeOrder{file_.node_order()}) == 0)
    throw Error(
        ErrorCode::kUnsupportedVersion,
        file_.path() + ": node order " + std::to_string(file_.node_order()) + ", expected 1 or 2");
  for (size_t level = 0; level < kMaxLevels; ++level) {
    const size_t entry = kLevelsAt + level * kLevelEntryBytes;
    const bool there = level <= file_.brick_level();
    const size_t last = file_.version() == kVersion ? entry + 24 : entry + 28;
    check_zeros(there ? last : entry, entry + kLevelEntryBytes, "a reserved byte");
  }
  const bool has_features = file_.version() != kVersion;
  bool any_wide = false;
  for (uint32_t level = 0; level <= file_.brick_level() && !file_.empty(); ++level) {
    const voxdag_reader::Level& words = file_.level(level);
    const uint32_t bits = words.word_count > narrow_words_ ? 64 : 32;
    if (words.pointer_bits != bits)
      broken(where(level), "pointers of " + std::to_string(words.pointer_bits) + " bits into " +
                               std::to_string(words.word_count) + " words, expected " +
                               std::to_string(bits));
    any_wide |= bits == 64;
  }
  uint64_t features = 0;
  if (has_features) std::memcpy(&features, file_.data() + kFeaturesAt, sizeof(features));
  if (has_features && features == 0)
    broken(file_.path() + ": header",
           "the version is 2, but no feature bit is set, expected version 1");
  if (has_features && any_wide != ((features & kWideLevels) != 0))
    broken(file_.path() + ": header", "feature bits " + std::to_string(features) +
                                          ", expected the bit of wide levels to be " +
                                          (any_wide ? "1" : "0"));
  check_attributes((features & kAttributes) != 0);
  check_zeros(has_features ? kReservedAt : kFeaturesAt, kHeaderChecksumAt, "a reserved byte");
}

// Checks the attribute table. Sections of kinds that this program does not know are not valid.
void Verifier::check_attributes(bool has_attributes) const {
  if (!has_attributes) check_zeros(kAttributeCountAt, kLevelsAt, "attribute sections are reserved");
  uint64_t count;
  std::memcpy(&count, file_.data() + kAttributeCountAt, sizeof(count));
  const std::vector<Attribute> kinds = attributes_of(file_).list();
  if (count != kinds.size())
    broken(file_.path() + ": header", std::to_string(count) + " attribute sections, expected " +
                                          std::to_string(kinds.size()) +
                                          ", the number of known sections in the file");
  if (has_attributes == kinds.empty())
    broken(file_.path() + ": header",
           "the feature bit of attributes does not match the attribute table, expected it to be 1 "
           "if and only if there are attribute sections");
  for (size_t i = 0; i < kinds.size(); ++i)
    check_section(kAttributesAt + i * kAttributeEntryBytes, kinds[i]);
  check_zeros(kAttributesAt + kinds.size() * kAttributeEntryBytes, kFeaturesAt, "a reserved byte");
}

// `entry` is the byte offset of the section's entry in the header page. Checks the entry, the
// section's list of names, and its padding.
void Verifier::check_section(size_t entry, Attribute attribute) const {
  const auto field = [&](size_t at) {
    uint64_t value;
    std::memcpy(&value, file_.data() + entry + at, sizeof(value));
    return value;
  };
  const std::string plural = traits_of(attribute).plural;
  const voxdag_reader::ColorSection& section = section_of(file_, attribute);
  uint64_t cells = 0, finest_cells = 0;
  for (uint32_t t = 0; t < section.tier_count(); ++t) cells += section.tier(t).cell_count;
  for (uint64_t i = 0; i < section.tier(0).region_count; ++i) {
    voxdag_reader::ColorRegion region;
    if (!voxdag_reader::ColorSection::region(section.tier(0), i, region))
      broken(file_.path() + ": " + plural,
             "region " + std::to_string(i) +
                 " is damaged: expected counts and an offset within the section");
    finest_cells += region.counts[0];
  }
  if (field(kAttributeCellsAt) != cells || field(kAttributeFinestCellsAt) != finest_cells)
    broken(file_.path() + ": header",
           "the attribute table has " + std::to_string(field(kAttributeCellsAt)) + " " + plural +
               ", the section has " + std::to_string(cells) + "; " +
               std::to_string(field(kAttributeFinestCellsAt)) +
               " of them on the finest level, the section has " + std::to_string(finest_cells));
  // End of the section, without the padding up to the next page.
  const uint64_t end = field(kAttributeOffsetAt) + field(kAttributeBytesAt);
  if (traits_of(attribute).has_names()) {
    const voxdag_reader::ColorTier& last = section.tier(section.tier_count() - 1);
    const uint64_t names = static_cast<uint64_t>(last.directory - file_.data()) +
                           32 * last.region_count + list_bytes(section.names());
    const uint64_t tiers = end - 32 * section.tier_count();
    if (tiers != (names + 15) / 16 * 16 || !section.names().back().empty())
      broken(file_.path() + ": " + plural,
             "the list of names does not end as it must, expected an empty last name, and the tier "
             "table at the next multiple of 16 bytes");
    check_zeros(names, tiers, "padding after the names of " + plural);
  }
  check_zeros(end, round_up_to_page(end), "padding after the " + plural);
  check_zeros(entry + kAttributeReservedAt, entry + kAttributeEntryBytes, "a reserved byte");
}

void Verifier::check_padding() const {
  if (file_.empty()) return;
  for (uint32_t level = 0; level <= file_.brick_level(); ++level) {
    const voxdag_reader::Level& l = file_.level(level);
    const uint64_t end = l.file_offset + sizeof(uint32_t) * l.word_count;
    check_zeros(end, round_up_to_page(end), "padding after level " + std::to_string(level));
  }
}

}  // namespace

void verify_global_file(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                        Progress& progress, const CancelToken& cancel, uint64_t narrow_words,
                        bool is_quick, PageLimit* pages, VerifyScratch* scratch) {
  PageLimit unlimited(file, ~uint64_t{0});
  const VerifyTask task{
      file, threads, budget, progress, cancel, is_quick, pages ? *pages : unlimited, scratch};
  Verifier(task, narrow_words).run();
}

}  // namespace voxdag
