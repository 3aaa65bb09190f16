// The documents of this room say what the code does.
#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <regex>
#include <sstream>

#include "core/dag/node_hash.h"
#include "core/format/global_layout.h"
#include "tests/unit/format/test_files.h"

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

// The bytes that a hexdump in a document stands for.
ByteString parse_hexdump(const std::vector<std::string>& lines) {
  ByteString bytes;
  const std::regex row("([0-9a-f]{8})((?: {1,2}[0-9a-f]{2}){0,16})(?: .*)?");
  bool inside = false, repeat = false;
  for (const std::string& line : lines) {
    if (line == "```hexdump" || line == "```") inside = line.size() > 3;
    std::smatch match;
    if (inside && line == "*") repeat = true;
    if (!inside || !std::regex_match(line, match, row)) continue;
    const size_t offset = std::stoul(match[1].str(), nullptr, 16);
    while (repeat && bytes.size() < offset) bytes += bytes.substr(bytes.size() - 16);
    repeat = false;
    EXPECT_EQ(bytes.size(), offset) << line;
    std::istringstream digits(match[2].str());
    for (std::string byte; digits >> byte;)
      bytes += static_cast<char>(std::stoul(byte, nullptr, 16));
  }
  return bytes;
}

TEST(FormatDocTest, WorkedExampleIsTheGoldenFile) {
  EXPECT_EQ(parse_hexdump(lines_of("format.md")), read_bytes(kScene));
}

// Every field of the header stands in the table with its offset.
TEST(FormatDocTest, HeaderTableIsTheLayout) {
  using namespace global_layout;
  const std::map<std::string, size_t> fields = {{"magic", kMagicAt},
                                                {"version", kVersionAt},
                                                {"header bytes", kHeaderBytesAt},
                                                {"L", kGridLevelsAt},
                                                {"hash bits", kHashBitsAt},
                                                {"node order", kNodeOrderAt},
                                                {"block bytes", kBlockBytesAt},
                                                {"origin", kOriginAt},
                                                {"edge", kEdgeAt},
                                                {"voxels", kVoxelsAt},
                                                {"octree nodes", kSvoNodesAt},
                                                {"DAG nodes", kDagNodesAt},
                                                {"file bytes", kFileBytesAt},
                                                {"table offset", kTableOffsetAt},
                                                {"block count", kTableCountAt},
                                                {"table checksum", kTableChecksumAt},
                                                {"attribute sections", kAttributeCountAt},
                                                {"levels", kLevelsAt},
                                                {"attribute table", kAttributesAt},
                                                {"", kReservedAt},
                                                {"header checksum", kHeaderChecksumAt}};
  const std::regex row(R"(\| (\d+) \| [^|]+ \| ([^|]*?) ?\|.*)");
  std::map<std::string, size_t> found;
  bool inside = false;
  for (const std::string& line : lines_of("format.md")) {
    if (line == "### Header page") inside = true;
    if (line == "A level entry:") inside = false;
    std::smatch match;
    if (inside && std::regex_match(line, match, row)) found[match[2]] = std::stoul(match[1]);
  }
  EXPECT_EQ(found, fields);
}

// The test vectors of the node hash.
TEST(FormatDocTest, NodeHashVectorsHold) {
  const uint64_t one = hash_brick(1), all = hash_brick(~uint64_t{0});
  const uint64_t two[] = {one, all}, eight[] = {all, all, all, all, all, all, all, all};
  const uint64_t two_cut[] = {cut_hash(one, 16), cut_hash(all, 16)};
  const uint64_t expected[] = {one,
                               hash_brick(uint64_t{1} << 63),
                               all,
                               hash_node(0x01, &one),
                               hash_node(0x80, &one),
                               hash_node(0x81, two),
                               cut_hash(hash_node(0x81, two_cut), 16),
                               hash_node(0xff, eight)};
  std::vector<uint64_t> found;
  const std::regex row(R"(\| (?:brick|node) .* \| `([0-9a-f]{16})` \|)");
  std::smatch match;
  for (const std::string& line : lines_of("format.md"))
    if (std::regex_match(line, match, row)) found.push_back(std::stoull(match[1], nullptr, 16));
  EXPECT_THAT(found, testing::ElementsAreArray(expected));
}

// docs/errors.md is the table of core/base/error.cc.
TEST(ErrorsDocTest, TableIsThatOfTheCode) {
  std::map<std::string, std::pair<int, int>> documented, coded;
  const std::regex row(R"(\| `(\w+)` \| (\d+) \| (\d+) \| .+ \|)");
  std::smatch match;
  for (const std::string& line : lines_of("errors.md"))
    if (std::regex_match(line, match, row))
      documented[match[1]] = {std::stoi(match[2]), std::stoi(match[3])};
  for (int i = 0; i <= static_cast<int>(ErrorCode::kLimit); ++i) {
    const ErrorCode code = static_cast<ErrorCode>(i);
    coded[error_name(code)] = {exit_status(code), http_status(code)};
  }
  EXPECT_EQ(documented, coded);
}

// The example program compiles as its first lines tell users to, C++17 and no include path but the
// reader's folder, and finds the top of the pillar.
TEST(ReaderExampleTest, CompilesOnItsOwnAndRuns) {
  if (std::system("c++ --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no c++ on this machine";
  ScratchFolder folder;
  const std::string program = folder.file("reader_example"), output = folder.file("output");
  ASSERT_EQ(std::system(("c++ -std=c++17 -pedantic -Wall -Wextra -Wshadow -Werror -I " + kSource +
                         "/core/format " + kSource + "/docs/reader_example.cc -o " + program)
                            .c_str()),
            0);
  ASSERT_EQ(std::system((program + " " + kScene + " > " + output).c_str()), 0);
  EXPECT_EQ(read_bytes(output), "71 voxels of edge 0.25 in 4 nodes\nthe highest reaches y = 2\n");
}

}  // namespace
}  // namespace voxdag
