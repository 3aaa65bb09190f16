// Offsets and sizes in the global file, as docs/format.md, "The global file", describes them.
// The voxdag_reader headers include no other headers of voxdag, so they repeat the numbers that
// they need.
//
//   [header page] [level L-2] [level L-3] ... [level 0] [attribute sections] [checksum table]
//
// Levels and sections begin at multiples of kPageBytes, with zeros between them. The bytes between
// the header page and the checksum table are divided into checksum blocks of 64 KiB. The table has
// one XXH64 for each block.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::global_layout {

inline constexpr uint64_t kMagic = 0x0a1a0a4741445689;  // 0x89 "VDAG" LF 0x1a LF
inline constexpr uint32_t kVersion = 1;
inline constexpr uint32_t kVersionWithFeatures = 2;
// Feature bits of the header. kWideLevels: at least one level is wide. kAttributes: the file has
// attribute sections.
inline constexpr uint64_t kWideLevels = 1;
inline constexpr uint64_t kAttributes = 2;
inline constexpr uint64_t kPageBytes = 4096;
inline constexpr uint64_t kChecksumBlockBytes = uint64_t{1} << 16;
inline constexpr uint64_t kMaxLevelWords = uint64_t{1} << 40;
// Pointers into a level of more words than this are 64 bits wide; all other pointers have 32 bits.
// Tests define a smaller limit.
#ifndef VOXDAG_NARROW_LEVEL_WORDS
#define VOXDAG_NARROW_LEVEL_WORDS (uint64_t{1} << 32)
#endif
inline constexpr uint64_t kNarrowLevelWords = VOXDAG_NARROW_LEVEL_WORDS;
// Maximum number of words of a node: a child mask and eight wide offsets.
inline constexpr uint64_t kMaxNodeWords = 17;

// Offsets in an entry of the attribute table. All other bytes of an entry are reserved and 0.
inline constexpr size_t kAttributeKindAt = 0;
inline constexpr size_t kAttributeLevelsAt = 4;
inline constexpr size_t kAttributeOffsetAt = 8;
inline constexpr size_t kAttributeBytesAt = 16;
inline constexpr size_t kAttributeCellsAt = 24;
inline constexpr size_t kAttributeFinestCellsAt = 32;
inline constexpr size_t kAttributeBlockBytesAt = 40;
inline constexpr size_t kAttributeReservedAt = 44;

// Offsets in the header page.
inline constexpr size_t kMagicAt = 0;
inline constexpr size_t kVersionAt = 8;
inline constexpr size_t kHeaderBytesAt = 12;
inline constexpr size_t kGridLevelsAt = 16;
inline constexpr size_t kHashBitsAt = 20;
inline constexpr size_t kNodeOrderAt = 24;
inline constexpr size_t kChecksumBlockBytesAt = 28;
inline constexpr size_t kOriginAt = 32;  // three doubles
inline constexpr size_t kEdgeAt = 56;
inline constexpr size_t kVoxelsAt = 64;
inline constexpr size_t kSvoNodesAt = 72;
inline constexpr size_t kDagNodesAt = 80;
inline constexpr size_t kFileBytesAt = 88;
inline constexpr size_t kTableOffsetAt = 96;
inline constexpr size_t kTableCountAt = 104;
inline constexpr size_t kTableChecksumAt = 112;
inline constexpr size_t kAttributeCountAt = 120;
inline constexpr size_t kLevelsAt = 128;        // entry l describes level l
inline constexpr size_t kLevelEntryBytes = 32;  // offset, nodes, words, pointer bits
inline constexpr size_t kMaxLevels = 32;        // capacity of the table; 19 are used at most
inline constexpr size_t kAttributesAt = kLevelsAt + kMaxLevels * kLevelEntryBytes;
inline constexpr size_t kAttributeEntryBytes = 64;
inline constexpr size_t kMaxAttributes = 16;
inline constexpr size_t kFeaturesAt = kAttributesAt + kMaxAttributes * kAttributeEntryBytes;
inline constexpr size_t kReservedAt = kFeaturesAt + sizeof(uint64_t);
inline constexpr size_t kHeaderChecksumAt = kPageBytes - sizeof(uint64_t);
static_assert(kReservedAt <= kHeaderChecksumAt);

inline constexpr uint64_t round_up_to_page(uint64_t bytes) {
  return (bytes + kPageBytes - 1) / kPageBytes * kPageBytes;
}

}  // namespace voxdag::global_layout

namespace voxdag {

// Order of the nodes in each level (docs/format.md, "Node order"). The numbers are the values of
// the field in the header.
enum class NodeOrder : uint32_t { kByHash = 1, kByFirstParent = 2 };

// Returns the name of an order as users write it; "" for an order that is not known.
constexpr const char* name_of(NodeOrder order) {
  switch (order) {
    case NodeOrder::kByHash:
      return "hash";
    case NodeOrder::kByFirstParent:
      return "first-parent";
  }
  return "";
}

}  // namespace voxdag
