#include "core/scene/gltf/json_window.h"

#include <algorithm>
#include <string_view>

namespace voxdag::gltf {
namespace {

constexpr size_t kWindowBytes = size_t{64} << 10;
constexpr std::string_view kDataPrefix = "data:";
// Room for the media type; what follows is withheld.
constexpr uint64_t kShownCharacters = 256;

bool is_base64(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' ||
         c == '/' || c == '=';
}

}  // namespace

JsonWindow::JsonWindow(const ReadableFile& file, FileRange json, bool withhold)
    : file_(file),
      json_(json),
      withhold_(withhold),
      window_begin_(json.begin),
      position_(json.begin) {
  advance();
}

void JsonWindow::advance() {
  char c;
  do {
    if (!next(c)) {
      ended_ = true;
      return;
    }
    track(c);
    current_ = c;
  } while (withhold_current());
}

bool JsonWindow::next(char& c) {
  if (position_ == window_begin_ + window_.size()) {
    const uint64_t left = json_.begin + json_.size - position_;
    if (left == 0) return false;
    window_begin_ = position_;
    window_.resize(static_cast<size_t>(std::min<uint64_t>(left, kWindowBytes)));
    file_.read_at(window_begin_, std::as_writable_bytes(std::span(window_)));
  }
  c = window_[static_cast<size_t>(position_ - window_begin_)];
  ++position_;
  return true;
}

// Follows where strings begin and end, escapes included.
void JsonWindow::track(char c) {
  if (!in_string_) {
    if (c != '"') return;
    in_string_ = true;
    is_data_uri_ = true;
    escaped_ = withheld_ = after_backslash_ = false;
    string_ = {position_, 0};
    return;
  }
  if (after_backslash_) {
    after_backslash_ = false;
  } else if (c == '\\') {
    after_backslash_ = escaped_ = true;
  } else if (c == '"') {
    in_string_ = false;
    return;
  }
  const uint64_t i = string_.size++;
  if (i < kDataPrefix.size() && c != kDataPrefix[static_cast<size_t>(i)]) is_data_uri_ = false;
}

bool JsonWindow::withhold_current() {
  const bool withhold = withhold_ && in_string_ && is_data_uri_ &&
                        string_.size > kShownCharacters && is_base64(current_);
  withheld_ = withheld_ || withhold;
  return withhold;
}

}  // namespace voxdag::gltf
