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
  } while (is_withheld());
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

// Follows where strings begin and end.
void JsonWindow::track(char c) {
  if (in_string_) return track_in_string(c);
  if (c != '"') return;
  in_string_ = is_data_uri_ = true;
  escaped_ = after_backslash_ = in_escape_ = false;
  hex_digits_left_ = 0;
  string_ = {position_, 0};
}

void JsonWindow::track_in_string(char c) {
  in_escape_ = true;
  if (after_backslash_) {
    after_backslash_ = false;
    hex_digits_left_ = c == 'u' ? 4 : 0;
  } else if (hex_digits_left_ > 0) {
    --hex_digits_left_;
  } else if (c == '\\') {
    after_backslash_ = escaped_ = true;
  } else {
    in_escape_ = false;
    in_string_ = c != '"';
    if (!in_string_) return;
  }
  const uint64_t i = string_.size++;
  if (i < kDataPrefix.size() && c != kDataPrefix[static_cast<size_t>(i)]) is_data_uri_ = false;
}

// An escape is never cut in two: it is not withheld, wherever it is.
bool JsonWindow::is_withheld() const {
  return withhold_ && in_string_ && is_data_uri_ && !in_escape_ &&
         string_.size > kShownCharacters && is_base64(current_);
}

}  // namespace voxdag::gltf
