#include "core/scene/gltf/json/json_filter.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "core/base/error.h"
#include "core/scene/gltf/json/json_window.h"
#include "core/scene/gltf/json/schema.h"

namespace voxdag::gltf {
namespace {

using nlohmann::json;

constexpr size_t kLongestReason = 300;
constexpr size_t kLongestKey = 64;
constexpr size_t kSectionDepth = 2;  // the root and one of its arrays

// A data: URI had JSON escapes inside, so that its place in the file does not do.
struct EscapedDataUri {};

// What the text before the comma of a data: URI must end with.
constexpr std::string_view kBase64Mark = ";base64";

// Takes the parser's events, follows where in the schema they are, and sorts what it finds.
class Filter : public nlohmann::json_sax<json> {
 public:
  Filter(const std::string& path, const JsonWindow& window, MemoryBudget& budget)
      : path_(path), window_(window), out_(budget, "the JSON of " + path) {}

  FilteredJson take() { return std::move(out_); }

  bool null() override {
    if (const Schema* s = value()) violate(*s, "null");
    return true;
  }
  bool boolean(bool v) override {
    if (const Schema* s = value_of(JsonType::kBoolean, "a boolean"))
      keep_value(*s, v ? "true" : "false");
    return true;
  }
  bool number_integer(number_integer_t v) override {
    const std::string digits = std::to_string(v);
    if (const Schema* s = value_of(JsonType::kNumber, digits.c_str())) keep_value(*s, digits);
    return true;
  }
  bool number_unsigned(number_unsigned_t v) override {
    const Schema* s = value();
    if (s && !is_whole_number_of(s->type, v))
      violate(*s, std::to_string(v));
    else if (s)
      keep_whole_number(*s, v);
    return true;
  }
  bool number_float(number_float_t, const string_t& digits) override {
    if (const Schema* s = value_of(JsonType::kNumber, digits.c_str())) keep_value(*s, digits);
    return true;
  }
  bool string(string_t& v) override {
    const Schema* s = value();
    if (s && !is_string_of(s->type, v))
      violate(*s, s->type == JsonType::kElementType ? printable(v) : "a string");
    else if (s)
      keep_string(*s, v);
    return true;
  }
  bool binary(binary_t&) override { return true; }

  bool start_object(size_t) override { return open(JsonType::kObject, '{', "an object"); }
  bool end_object() override { return close('}'); }
  bool start_array(size_t) override { return open(JsonType::kArray, '[', "an array"); }
  bool end_array() override { return close(']'); }

  bool key(string_t& name) override {
    if (dropped_depth_ > 0) return true;
    Frame& frame = frames_.back();
    const Member* member = frame.schema->find(name);
    pending_ = member ? member->schema : frame.schema->elements;
    frame.key = name;
    if (member) mark_seen(frame, *member);
    return true;
  }

  bool parse_error(size_t position, const std::string&, const json::exception& e) override {
    refuse(path_, "its JSON is broken at character " + std::to_string(position) + ": " +
                      std::string(e.what()).substr(0, kLongestReason));
  }

 private:
  // An object or array that is being kept.
  struct Frame {
    const Schema* schema;
    uint64_t seen = 0;   // bit per named member
    uint64_t count = 0;  // elements of an array so far
    std::string key;     // of an object's value that comes next or is inside

    bool is_array() const { return schema->type == JsonType::kArray; }
  };

  // The schema of the value that begins here, null if it is dropped.
  const Schema* value() {
    if (dropped_depth_ > 0) return nullptr;
    if (frames_.empty()) return &gltf_schema();
    Frame& frame = frames_.back();
    if (!frame.is_array()) return pending_;
    ++frame.count;
    return frame.schema->elements;
  }
  const Schema* value_of(JsonType type, const char* found) {
    const Schema* s = value();
    if (!s || s->type == type) return s;
    violate(*s, found);
    return nullptr;
  }

  bool open(JsonType type, char bracket, const char* found) {
    const Schema* s = value_of(type, found);
    if (!s) {
      ++dropped_depth_;
      return true;
    }
    if (s->keep == Keep::kParsed) out_.slices.open(key_here(), bracket);
    if (s->keep == Keep::kBuffer && type == JsonType::kObject) out_.buffers.emplace_back();
    frames_.push_back({s, 0, 0, {}});
    return true;
  }
  bool close(char bracket) {
    if (dropped_depth_ > 0) {
      --dropped_depth_;
      return true;
    }
    const Schema& s = *frames_.back().schema;
    check_required(frames_.back());
    const uint64_t count = frames_.back().count;
    frames_.pop_back();
    if (frames_.size() == 1) out_.element_counts[frames_[0].key] = count;
    if (s.keep != Keep::kParsed) return true;
    out_.slices.close(bracket);
    if (frames_.size() == kSectionDepth && frames_[1].is_array())
      out_.slices.may_cut(frames_[0].key);
    return true;
  }

  void keep_value(const Schema& s, std::string_view text) {
    if (s.keep == Keep::kParsed) out_.slices.value(key_here(), text);
  }
  void keep_whole_number(const Schema& s, uint64_t v) {
    if (s.keep == Keep::kBuffer) out_.buffers.back().byte_length = v;
    if (s.keep == Keep::kIndices)
      // The root, its meshes, a mesh, its primitives.
      out_.indices.push_back({static_cast<uint32_t>(frames_[1].count - 1),
                              static_cast<uint32_t>(frames_[3].count - 1), static_cast<int>(v)});
    keep_value(s, std::to_string(v));
  }
  void keep_string(const Schema& s, const std::string& v) {
    switch (s.keep) {
      case Keep::kParsed:
        return keep_value(s, json(v).dump());
      case Keep::kHeader:
        (frames_.back().key == "version" ? out_.version : out_.min_version) = v;
        return;
      case Keep::kExtensionsUsed:
        out_.extensions_used.push_back(v);
        return;
      case Keep::kExtensionsRequired:
        out_.extensions_required.push_back(v);
        return;
      case Keep::kBuffer:
        return keep_uri(v);
      case Keep::kIndices:
        return;
    }
  }

  void keep_uri(const std::string& uri) {
    Buffer& buffer = out_.buffers.back();
    if (!uri.starts_with("data:")) {
      buffer.source = Buffer::Source::kExternal;
      buffer.uri = uri;
      if (window_.last_string_is_cut()) violate(path_here() + " is longer than any file name");
      return;
    }
    const size_t comma = uri.find(',');
    if (comma == std::string::npos ||
        !std::string_view(uri).substr(0, comma).ends_with(kBase64Mark))
      return violate(path_here() + " is a data: URI that is not base64");
    if (!window_.last_string_is_escaped()) {
      const FileRange all = window_.last_string();
      buffer.source = Buffer::Source::kBase64;
      buffer.text = {all.begin + comma + 1, all.size - comma - 1};
    } else if (window_.last_string_is_cut()) {
      throw EscapedDataUri{};
    } else {
      buffer.source = Buffer::Source::kMemory;
      buffer.characters = uri.substr(comma + 1);
    }
  }

  void mark_seen(Frame& frame, const Member& member) {
    const uint64_t bit = uint64_t{1} << (&member - frame.schema->members.data());
    if (frame.seen & bit) violate(path_here() + " is given twice");
    frame.seen |= bit;
  }
  void check_required(Frame& frame) {
    for (const Member& member : frame.schema->members) {
      const uint64_t bit = uint64_t{1} << (&member - frame.schema->members.data());
      if (!member.required || (frame.seen & bit)) continue;
      frame.key = member.name;
      violate(path_here() + " is missing");
    }
  }

  void violate(const Schema& s, const std::string& found) {
    violate(path_here() + " is " + found + ", expected " + type_name(s.type));
  }
  void violate(const std::string& what) {
    if (out_.violation.empty()) out_.violation = what;
  }

  const std::string* key_here() const {
    return frames_.empty() || frames_.back().is_array() ? nullptr : &frames_.back().key;
  }
  // "nodes[3].children[0]"
  std::string path_here() const {
    std::string path;
    for (const Frame& frame : frames_) {
      if (!frame.is_array() && !path.empty()) path += '.';
      path += frame.is_array() ? std::to_string(frame.count - 1).insert(0, 1, '[').append(1, ']')
                               : frame.key.substr(0, kLongestKey);
    }
    return path.empty() ? "the root" : path;
  }

  const std::string& path_;
  const JsonWindow& window_;
  FilteredJson out_;
  std::vector<Frame> frames_;
  const Schema* pending_ = nullptr;  // of the value after the key just read
  uint64_t dropped_depth_ = 0;       // open brackets of what is being dropped
};

FilteredJson filter_once(JsonWindow window, const std::string& path, MemoryBudget& budget) {
  Filter filter(path, window, budget);
  json::sax_parse(JsonIterator(window), JsonIterator(), &filter);
  return filter.take();
}

}  // namespace

FilteredJson filter_json(const ReadableFile& file, FileRange range, MemoryBudget& budget,
                         const CancelToken& cancel) {
  constexpr bool kCutStrings = true;
  try {
    return filter_once(JsonWindow(file, range, kCutStrings, budget, cancel), file.path(), budget);
  } catch (const EscapedDataUri&) {
    return filter_once(JsonWindow(file, range, !kCutStrings, budget, cancel), file.path(), budget);
  }
}

}  // namespace voxdag::gltf
