#include "core/scene/gltf/json/json_window.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag::gltf {
namespace {

constexpr size_t kWindowBytes = size_t{64} << 10;
// As long as any name or path of a file need be.
constexpr uint64_t kShownCharacters = 4096;
// The parser keeps a string raw and decoded, in buffers that grow by doubling, and hands on a copy.
constexpr uint64_t kCopies = 6;
constexpr uint64_t kChargeStepBytes = 64 << 10;

// ASCII that stands for itself within a string.
bool is_plain(char c) { return c >= ' ' && c <= '~'; }

}  // namespace

JsonWindow::JsonWindow(const ReadableFile& file, FileRange json, bool cut_strings,
                       MemoryBudget& budget, const CancelToken& cancel)
    : file_(file),
      json_(json),
      cut_strings_(cut_strings),
      cancel_(cancel),
      charge_(budget, 0, "strings of the JSON"),
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
  if (!in_string_) return;
  ++shown_;
  charge_shown();
}

bool JsonWindow::next(char& c) {
  if (position_ == window_begin_ + window_.size()) {
    const uint64_t left = json_.begin + json_.size - position_;
    if (left == 0) return false;
    cancel_.check();
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
  in_string_ = true;
  escaped_ = after_backslash_ = in_escape_ = false;
  hex_digits_left_ = 0;
  shown_ = 0;
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
  }
  string_.size += in_string_;
}

// Neither an escape nor a character of several bytes is ever cut in two.
bool JsonWindow::is_withheld() const {
  return cut_strings_ && in_string_ && string_.size > kShownCharacters && !in_escape_ &&
         is_plain(current_);
}

void JsonWindow::charge_shown() {
  const uint64_t bytes = kCopies * shown_;
  if (bytes <= charge_.bytes() || charge_.try_resize(bytes + kChargeStepBytes)) return;
  throw Error(ErrorCode::kOutOfMemory, "out of memory: a string in the JSON of " + file_.path() +
                                           " has over " + std::to_string(shown_) + " characters");
}

}  // namespace voxdag::gltf
