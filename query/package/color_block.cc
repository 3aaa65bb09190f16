#include "query/package/color_block.h"

#include <cstring>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

constexpr size_t kMaxPageWords = 17 + 512;
constexpr size_t kEntryWords = 3;  // per page, at the beginning of a block: code and size

}  // namespace

std::string encode_color_block(const std::vector<CodedPage>& pages) {
  std::vector<uint32_t> words = {static_cast<uint32_t>(pages.size())};
  for (const CodedPage& page : pages) words.push_back(static_cast<uint32_t>(page.code));
  for (const CodedPage& page : pages) words.push_back(static_cast<uint32_t>(page.code >> 32));
  for (const CodedPage& page : pages) words.push_back(static_cast<uint32_t>(page.words.size()));
  for (const CodedPage& page : pages)
    words.insert(words.end(), page.words.begin(), page.words.end());
  return {reinterpret_cast<const char*>(words.data()), words.size() * sizeof(uint32_t)};
}

std::vector<CodedPage> decode_color_block(std::string_view bytes) {
  const auto expect = [](bool is_true, const char* what) {
    if (!is_true)
      throw Error(ErrorCode::kCorrupt, std::string("a block of color pages is damaged: ") + what);
  };
  expect(!bytes.empty() && bytes.size() % sizeof(uint32_t) == 0,
         "its size is not a whole number of 32-bit words, expected one or more words");
  std::vector<uint32_t> words(bytes.size() / sizeof(uint32_t));
  std::memcpy(words.data(), bytes.data(), bytes.size());
  const size_t count = words[0];
  expect(count > 0 && count <= (words.size() - 1) / kEntryWords,
         "its list of pages is empty or ends beyond the block, expected an entry for each page");
  std::vector<CodedPage> pages(count);
  size_t at = 1 + kEntryWords * count;
  for (size_t i = 0; i < count; ++i) {
    pages[i].code = words[1 + i] | uint64_t{words[1 + count + i]} << 32;
    expect(i == 0 || pages[i].code > pages[i - 1].code,
           "its pages are in a wrong order, expected increasing codes");
    const size_t length = words[1 + 2 * count + i];
    expect(length > 0 && length <= kMaxPageWords && length <= words.size() - at,
           "a page is empty, too long, or ends beyond the block, expected complete pages");
    const auto first = words.begin() + static_cast<ptrdiff_t>(at);
    pages[i].words.assign(first, first + static_cast<ptrdiff_t>(length));
    at += length;
  }
  expect(at == words.size(), "words follow after the last page, expected none");
  return pages;
}

}  // namespace voxdag::query
