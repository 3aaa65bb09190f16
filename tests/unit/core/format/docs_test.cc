// docs/format.md and its example agree with the code.
#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <sstream>

#include "core/dag/node_hash.h"
#include "core/format/global/global_layout.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

const std::string kSource = VOXDAG_SOURCE_DIR;
const std::string kScene = kSource + "/tests/golden/floor_and_pillar.vdag";

std::vector<std::string> lines_of(const std::string& document) {
  std::istringstream in(read_bytes(kSource + "/docs/" + document));
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Returns the cells of a line that is a row of a Markdown table, without surrounding blanks and
// backquotes. Returns an empty list for other lines.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  if (line.empty() || line[0] != '|') return cells;
  std::istringstream in(line.substr(1));
  for (std::string cell; std::getline(in, cell, '|');) {
    const size_t first = cell.find_first_not_of(" `"), last = cell.find_last_not_of(" `");
    cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return cells;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

// Returns the bytes of the hexdump in a document.
ByteString parse_hexdump(const std::vector<std::string>& lines) {
  ByteString bytes;
  bool inside = false, repeat = false;
  for (const std::string& line : lines) {
    if (line == "```hexdump" || line == "```") inside = line.size() > 3;
    if (inside && line == "*") repeat = true;
    if (!inside || line.find_first_not_of("0123456789abcdef") != 8) continue;
    const size_t offset = std::stoul(line.substr(0, 8), nullptr, 16);
    while (repeat && bytes.size() < offset) bytes += bytes.substr(bytes.size() - 16);
    repeat = false;
    EXPECT_EQ(bytes.size(), offset) << line;
    // Each byte takes three columns. There is one more blank in the middle.
    std::istringstream digits(line.substr(8, 51));
    for (std::string byte; digits >> byte;)
      bytes += static_cast<char>(std::stoul(byte, nullptr, 16));
  }
  return bytes;
}

TEST(FormatDocTest, WorkedExampleIsTheGoldenFile) {
  EXPECT_EQ(parse_hexdump(lines_of("format.md")), read_bytes(kScene));
}

// The table in docs/format.md has every field of the header with its offset.
TEST(FormatDocTest, HeaderTableIsTheLayout) {
  using namespace global_layout;
  const std::map<std::string, size_t> fields = {{"magic", kMagicAt},
                                                {"version", kVersionAt},
                                                {"header bytes", kHeaderBytesAt},
                                                {"L", kGridLevelsAt},
                                                {"hash bits", kHashBitsAt},
                                                {"node order", kNodeOrderAt},
                                                {"checksum block bytes", kChecksumBlockBytesAt},
                                                {"origin", kOriginAt},
                                                {"edge", kEdgeAt},
                                                {"voxels", kVoxelsAt},
                                                {"octree nodes", kSvoNodesAt},
                                                {"DAG nodes", kDagNodesAt},
                                                {"file bytes", kFileBytesAt},
                                                {"table offset", kTableOffsetAt},
                                                {"checksum block count", kTableCountAt},
                                                {"table checksum", kTableChecksumAt},
                                                {"attribute sections", kAttributeCountAt},
                                                {"levels", kLevelsAt},
                                                {"attribute table", kAttributesAt},
                                                {"feature bits", kFeaturesAt},
                                                {"", kReservedAt},
                                                {"header checksum", kHeaderChecksumAt}};
  std::map<std::string, size_t> found;
  bool inside = false;
  for (const std::string& line : lines_of("format.md")) {
    if (line == "### Header page") inside = true;
    if (line == "A level entry:") inside = false;
    const auto cells = cells_of(line);
    if (inside && cells.size() == 4 && is_number(cells[0])) found[cells[2]] = std::stoul(cells[0]);
  }
  EXPECT_EQ(found, fields);
}

// The code gives the test vectors of the node hash in docs/format.md.
TEST(FormatDocTest, NodeHashVectorsHold) {
  const uint64_t one = hash_brick(1), all = hash_brick(~uint64_t{0});
  const uint64_t two[] = {one, all}, eight[] = {all, all, all, all, all, all, all, all};
  const uint64_t two_cut[] = {truncate_hash(one, 16), truncate_hash(all, 16)};
  const uint64_t expected[] = {one,
                               hash_brick(uint64_t{1} << 63),
                               all,
                               hash_node(0x01, &one),
                               hash_node(0x80, &one),
                               hash_node(0x81, two),
                               truncate_hash(hash_node(0x81, two_cut), 16),
                               hash_node(0xff, eight)};
  std::vector<uint64_t> found;
  for (const std::string& line : lines_of("format.md")) {
    const auto cells = cells_of(line);
    if (cells.size() == 2 && cells[1].size() == 16 &&
        cells[1].find_first_not_of("0123456789abcdef") == std::string::npos)
      found.push_back(std::stoull(cells[1], nullptr, 16));
  }
  EXPECT_THAT(found, testing::ElementsAreArray(expected));
}

// docs/errors.md has the same table as core/base/error.cc.
TEST(ErrorsDocTest, TableIsThatOfTheCode) {
  std::map<std::string, std::pair<int, int>> documented, coded;
  for (const std::string& line : lines_of("errors.md")) {
    const auto cells = cells_of(line);
    if (cells.size() == 4 && is_number(cells[1]))
      documented[cells[0]] = {std::stoi(cells[1]), std::stoi(cells[2])};
  }
  for (int i = 0; i <= static_cast<int>(ErrorCode::kLimit); ++i) {
    const ErrorCode code = static_cast<ErrorCode>(i);
    coded[error_name(code)] = {exit_status(code), http_status(code)};
  }
  EXPECT_EQ(documented, coded);
}

// The example program compiles as its first lines describe: with C++17, and with the reader's
// folder as the only include path. It prints the facts of the golden file kScene.
TEST(ReaderExampleTest, CompilesOnItsOwnAndRuns) {
  if (std::system("c++ --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no c++ on this machine";
  TemporaryFolder folder;
  const std::string program = folder.file("reader_example"), output = folder.file("output");
  ASSERT_EQ(std::system(("c++ -std=c++17 -pedantic -Wall -Wextra -Wshadow -Werror -I " + kSource +
                         "/core/format/global " + kSource + "/docs/examples/reader_example.cc -o " +
                         program)
                            .c_str()),
            0);
  ASSERT_EQ(std::system((program + " " + kScene + " > " + output).c_str()), 0);
  EXPECT_EQ(read_bytes(output), "71 voxels of edge 0.25 in 4 nodes\nthe highest reaches y = 2\n");
}

}  // namespace
}  // namespace voxdag
