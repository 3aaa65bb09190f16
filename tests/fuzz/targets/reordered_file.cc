// Reorders global files (query/reorder): to the order by first parent or to the order by hash,
// whichever the file does not have, and back. global_bytes.h describes the inputs. If the file is
// valid, its copies are valid, and reordering back gives its levels and sections.
#include <algorithm>
#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "query/reorder/reorder.h"
#include "tests/fuzz/support/fuzz_target.h"
#include "tests/fuzz/support/global_bytes.h"
#include "tests/fuzz/support/memory_folder.h"

namespace voxdag {
namespace {

constexpr uint64_t kBudgetBytes = uint64_t{16} << 20;
// Lists of this size make files of a few nodes use scratch files.
constexpr uint64_t kListBytes = 256;

// Writes `file` in an order to memory_folder()/name. Returns the copy, opened.
std::unique_ptr<voxdag_reader::File> reordered(const voxdag_reader::File& file, NodeOrder order,
                                               const std::string& name, uint64_t list_bytes) {
  query::ReorderSpec spec;
  spec.order = order;
  spec.output = fuzz::memory_folder() + "/" + name;
  spec.replace = true;
  spec.memory_bytes = kBudgetBytes;
  spec.narrow_words = fuzz::narrow_words_of(file);
  spec.list_bytes = list_bytes;
  NoProgress progress;
  query::reorder(file, spec, system_files(), progress, CancelToken());
  return open_global_file(spec.output);
}

// True if the levels and sections of two files are equal.
bool have_equal_data(const voxdag_reader::File& a, const voxdag_reader::File& b) {
  constexpr uint64_t kPage = global_layout::kPageBytes;
  return a.checksum_table_offset() == b.checksum_table_offset() &&
         std::equal(a.data() + kPage, a.data() + a.checksum_table_offset(), b.data() + kPage);
}

void reorder_twice(const voxdag_reader::File& file) {
  const bool is_sound = fuzz::is_sound(file);
  const NodeOrder order{file.node_order()};
  const NodeOrder other =
      order == NodeOrder::kByHash ? NodeOrder::kByFirstParent : NodeOrder::kByHash;
  try {
    const auto copy = reordered(file, other, "copy.vdag", kListBytes);
    const auto back = reordered(*copy, order, "back.vdag", ~uint64_t{0});
    if (!is_sound) return;
    fuzz::require(fuzz::is_sound(*copy), "the copy of a valid file is valid");
    fuzz::require(have_equal_data(*back, file), "reordering back gives the original levels");
  } catch (const Error& error) {
    fuzz::require(!is_sound, "a valid file can be reordered");
    fuzz::require(error.is_corruption() || error.code() == ErrorCode::kLimit,
                  "a bad file is an error of kind corrupt");
  }
}

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const fuzz::NamelessFile bytes(fuzz::make_file(fuzz::bytes_of(data, size)));
  try {
    reorder_twice(voxdag_reader::File(bytes.path()));
  } catch (const voxdag_reader::Error&) {
  }
  return 0;
}
