#include "core/scene/gltf/json/json_slices.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"

namespace voxdag::gltf {
namespace {

constexpr uint64_t kSliceObjects = 4096;
constexpr uint64_t kSliceBytes = 256 << 10;
constexpr uint64_t kChargeStepBytes = 64 << 10;

std::string quoted(const std::string& text) { return nlohmann::json(text).dump(); }

}  // namespace

JsonSlices::JsonSlices(MemoryBudget& budget, const std::string& what)
    : slices_(1), charge_(budget, 0, what), what_(what) {}

void JsonSlices::value(const std::string* key, std::string_view text) {
  JsonSlice& slice = slices_.back();
  if (separator_due_) slice.text += ',';
  if (key) slice.text.append(quoted(*key)).append(1, ':');
  slice.text += text;
  ++slice.value_count;
  separator_due_ = true;
  charge_text();
}

void JsonSlices::open(const std::string* key, char bracket) {
  value(key, std::string_view(&bracket, 1));
  slices_.back().object_count += bracket == '{';
  separator_due_ = false;
}

void JsonSlices::close(char bracket) {
  slices_.back().text += bracket;
  separator_due_ = true;
}

void JsonSlices::may_cut(const std::string& section) {
  JsonSlice& slice = slices_.back();
  if (slice.object_count < kSliceObjects && slice.text.size() < kSliceBytes) return;
  slice.text += "]}";
  slice.text.shrink_to_fit();
  finished_bytes_ += slice.text.capacity();
  slices_.emplace_back().text.append(1, '{').append(quoted(section)).append(":[");
  separator_due_ = false;
}

void JsonSlices::charge_text() {
  // A text that grows is there twice for a moment.
  const uint64_t bytes = finished_bytes_ + 2 * slices_.back().text.capacity();
  if (bytes <= charge_.bytes() || charge_.try_resize(bytes + kChargeStepBytes)) return;
  throw Error(ErrorCode::kOutOfMemory, "out of memory: " + what_ + " needs over " +
                                           std::to_string(bytes) + " bytes of the budget");
}

}  // namespace voxdag::gltf
