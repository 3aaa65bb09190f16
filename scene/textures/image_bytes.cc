#include "scene/textures/image_bytes.h"

#include <algorithm>
#include <string_view>

#include "core/base/error.h"
#include "core/base/text.h"
#include "scene/base64.h"

namespace voxdag {
namespace {

constexpr size_t kImageWindow = 64 << 10;

}  // namespace

ImageBytes::ImageBytes(FileSystem& files, const ImageSource& source)
    : file_(files.open_read(source.file.path)),
      at_(source.offset),
      end_(source.offset + source.size),
      is_text_(source.is_base64 || source.is_data_uri),
      is_base64_(source.is_base64),
      left_(source.bytes) {
  const FileIdentity &before = source.file.identity, now = file_->identity();
  if (before.inode != now.inode || before.bytes != now.bytes ||
      before.modified_ns != now.modified_ns)
    throw Error(ErrorCode::kInvalidInput, source.name +
                                              ": its file changed while the scene was read: "
                                              "expected files that do not change");
  end_ = std::min(end_, file_->size());
  if (!is_text_) {
    at_ = std::min(end_, at_ + std::min(source.skip, end_ - std::min(at_, end_)));
    return;
  }
  char c = source.is_data_uri ? '\0' : ',';
  while (c != ',' && next_character(c)) {
  }
  for (uint64_t i = 0; i < source.skip; ++i) {
    if (group_at_ == group_size_ && !next_group()) break;
    ++group_at_;
  }
}

size_t ImageBytes::read(std::span<std::byte> out) {
  out = out.first(static_cast<size_t>(std::min<uint64_t>(out.size(), left_)));
  size_t size = 0;
  if (!is_text_) {
    size = read_plain(out);
  } else {
    while (size < out.size() && (group_at_ < group_size_ || next_group()))
      out[size++] = group_[group_at_++];
  }
  left_ -= size;
  return size;
}

size_t ImageBytes::read_plain(std::span<std::byte> out) {
  const auto size =
      static_cast<size_t>(std::min<uint64_t>(out.size(), at_ < end_ ? end_ - at_ : 0));
  if (size > 0) file_->read_at(at_, out.first(size));
  at_ += size;
  return size;
}

// Reads the next character of the text. Returns false at the end of the range. Decodes JSON's
// escapes; a \u escape over \u007f becomes "!", which is not base64.
bool ImageBytes::next_character(char& c) {
  if (!pending_.empty()) {
    c = pending_.front();
    pending_.erase(0, 1);
    return true;
  }
  const auto raw = [&](char& out) {
    if (window_at_ == window_.size()) {
      window_.resize(kImageWindow);
      window_.resize(read_plain(window_));
      window_at_ = 0;
      if (window_.empty()) return false;
    }
    out = static_cast<char>(window_[window_at_++]);
    return true;
  };
  if (!raw(c)) return false;
  if (c != '\\') return true;
  if (!raw(c)) return false;
  constexpr std::string_view kEscapes = "bfnrt", kMeanings = "\b\f\n\r\t";
  if (const size_t at = kEscapes.find(c); at != kEscapes.npos) c = kMeanings[at];
  if (c != 'u') return true;
  int code = 0;
  for (int i = 0; i < 4; ++i) {
    char digit = 0;
    if (!raw(digit)) return false;
    const bool is_digit = digit >= '0' && digit <= '9';
    code = code * 16 + (is_digit ? digit - '0' : ((digit | 0x20) - 'a' + 10));
  }
  c = code > 0 && code < 128 ? static_cast<char>(code) : '!';
  return true;
}

// Reads the next character of the base64 text. Skips white space, decodes percent escapes, and
// translates the URL-safe alphabet.
bool ImageBytes::next_base64_character(char& c) {
  do {
    if (!next_character(c)) return false;
  } while (c == ' ' || (c >= '\t' && c <= '\r'));
  if (c == '%') {
    std::string escape = "%00";
    if (!next_character(escape[1]) || !next_character(escape[2])) return false;
    c = percent_decoded(escape).value_or("!").front();
  }
  if (c == '-') c = '+';
  if (c == '_') c = '/';
  return true;
}

// Reads the next byte of a percent-encoded text. A percent sign without two hexadecimal digits
// means itself.
bool ImageBytes::next_percent_decoded(char& c) {
  if (!next_character(c)) return false;
  if (c != '%') return true;
  std::string escape = "%";
  char digit = 0;
  while (escape.size() < 3 && next_character(digit)) escape += digit;
  const auto decoded = percent_decoded(escape);
  if (decoded && decoded->size() == 1)
    c = decoded->front();
  else
    pending_.insert(0, escape.substr(1));
  return true;
}

bool ImageBytes::next_group() {
  group_at_ = group_size_ = 0;
  if (is_base64_) return next_base64_group();
  char c = 0;
  if (!next_percent_decoded(c)) return false;
  group_[group_size_++] = static_cast<std::byte>(c);
  return true;
}

bool ImageBytes::next_base64_group() {
  std::array<std::byte, 4> characters;
  size_t count = 0;
  char c = 0;
  while (!has_ended_ && count < characters.size() && next_base64_character(c)) {
    has_ended_ = c == '=' || c == '"';
    if (!has_ended_) characters[count++] = static_cast<std::byte>(c);
  }
  if (!decode_base64(std::span(characters).first(count), group_.data()))
    throw BrokenImage{"has a data: URI that is not base64"};
  if (count < 2) return false;
  group_size_ = count - 1;
  return true;
}

}  // namespace voxdag
