#include "core/scene/gltf/json_filter.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "core/base/error.h"
#include "core/scene/gltf/json_window.h"
#include "core/scene/gltf/schema.h"

namespace voxdag::gltf {
namespace {

using nlohmann::json;

constexpr uint64_t kChargeStepBytes = 64 << 10;

constexpr size_t kLongestReason = 300;
constexpr size_t kLongestKey = 64;

// A base64 data: URI had JSON escapes inside, so that its place in the file does not do.
struct EscapedDataUri {};

// Where the text before the comma of a data: URI must end.
constexpr std::string_view kBase64Mark = ";base64";

class Filter : public nlohmann::json_sax<json> {
 public:
  Filter(const std::string& path, const JsonWindow& window, bool withheld, MemoryBudget& budget)
      : path_(path), window_(window), withheld_(withheld) {
    out_.charge = MemoryCharge(budget, 0, "the JSON of " + path);
  }

  FilteredJson take() {
    out_.text += "  ";  // tinygltf takes no text of less than four characters, "{}" is one
    return std::move(out_);
  }

  bool null() override {
    if (const Schema* s = value()) violate(*s, "null");
    return true;
  }
  bool boolean(bool v) override {
    if (const Schema* s = value_of(JsonType::kBoolean, "a boolean")) emit(*s, v ? "true" : "false");
    return true;
  }
  bool number_integer(number_integer_t v) override {
    const Schema* s = value();
    if (s && s->type != JsonType::kNumber) violate(*s, std::to_string(v));
    if (s && s->type == JsonType::kNumber) emit(*s, std::to_string(v));
    return true;
  }
  bool number_unsigned(number_unsigned_t v) override {
    if (const Schema* s = value()) whole_number(*s, v);
    return true;
  }
  bool number_float(number_float_t, const string_t& digits) override {
    if (const Schema* s = value_of(JsonType::kNumber, digits.c_str())) emit(*s, digits);
    return true;
  }
  bool string(string_t& v) override {
    const Schema* s = value_of(JsonType::kString, "a string");
    if (!s) return true;
    if (s->keep == Keep::kParsed)
      emit(*s, json(v).dump());
    else
      note_string(*s, v);
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
    uint64_t count = 0;  // values so far
    std::string key;     // of the value that comes next or is inside
  };

  // The schema of the value that begins here, null if it is dropped.
  const Schema* value() {
    if (dropped_depth_ > 0) return nullptr;
    if (frames_.empty()) return &gltf_schema();
    Frame& frame = frames_.back();
    const Schema* schema =
        frame.schema->type == JsonType::kArray ? frame.schema->elements : pending_;
    if (frame.schema->type == JsonType::kArray) ++frame.count;
    return schema;
  }
  const Schema* value_of(JsonType type, const char* found) {
    const Schema* s = value();
    if (!s || s->type == type) return s;
    violate(*s, found);
    return nullptr;
  }

  void whole_number(const Schema& s, uint64_t v) {
    const uint64_t limit = s.type == JsonType::kIndex ? INT32_MAX : INT64_MAX;
    const bool fits = s.type == JsonType::kIndex || s.type == JsonType::kSize
                          ? v <= limit
                          : s.type == JsonType::kNumber;
    if (!fits) return violate(s, std::to_string(v));
    if (s.keep == Keep::kBuffer) out_.buffers.back().byte_length = v;
    emit(s, std::to_string(v));
  }

  bool open(JsonType type, char bracket, const char* found) {
    const Schema* s = value_of(type, found);
    if (!s) {
      ++dropped_depth_;
      return true;
    }
    emit(*s, std::string_view(&bracket, 1));
    frames_.push_back({s, 0, 0, {}});
    if (s->keep == Keep::kParsed) {
      separator_due_ = false;
      if (type == JsonType::kObject) ++out_.object_count;
    }
    if (type == JsonType::kObject && s->keep == Keep::kBuffer) out_.buffers.emplace_back();
    return true;
  }
  bool close(char bracket) {
    if (dropped_depth_ > 0) {
      --dropped_depth_;
      return true;
    }
    const Schema& s = *frames_.back().schema;
    check_required(frames_.back());
    if (s.keep == Keep::kParsed) {
      out_.text += bracket;
      separator_due_ = true;
    }
    frames_.pop_back();
    return true;
  }

  // Appends a value that is handed on, with its comma and its key.
  void emit(const Schema& s, std::string_view value) {
    if (s.keep != Keep::kParsed) return;
    if (separator_due_) out_.text += ',';
    if (!frames_.empty() && frames_.back().schema->type == JsonType::kObject)
      out_.text += json(frames_.back().key).dump() + ":";
    out_.text += value;
    separator_due_ = true;
    ++out_.value_count;
    const uint64_t bytes = out_.text.capacity();
    if (bytes > out_.charge.bytes() && !out_.charge.try_resize(bytes + kChargeStepBytes))
      throw Error(ErrorCode::kOutOfMemory, "out of memory: the JSON of " + path_ + " needs over " +
                                               std::to_string(bytes) + " bytes of the budget");
  }

  void note_string(const Schema& s, const std::string& v) {
    switch (s.keep) {
      case Keep::kHeader:
        (frames_.back().key == "version" ? out_.version : out_.min_version) = v;
        break;
      case Keep::kExtensionsUsed:
        out_.extensions_used.push_back(v);
        break;
      case Keep::kExtensionsRequired:
        out_.extensions_required.push_back(v);
        break;
      case Keep::kBuffer:
        note_uri(v);
        break;
      case Keep::kParsed:
        break;
    }
  }

  void note_uri(const std::string& uri) {
    Buffer& buffer = out_.buffers.back();
    if (!uri.starts_with("data:")) {
      buffer.source = Buffer::Source::kExternal;
      buffer.uri = uri;
      return;
    }
    const size_t comma = uri.find(',');
    if (comma == std::string::npos ||
        !std::string_view(uri).substr(0, comma).ends_with(kBase64Mark))
      return violate(path_here() + " is a data: URI that is not base64");
    if (!window_.last_string_escaped()) {
      const FileRange all = window_.last_string();
      buffer.source = Buffer::Source::kBase64;
      buffer.text = {all.begin + comma + 1, all.size - comma - 1};
    } else if (withheld_) {
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
  // "nodes[3].children[0]"
  std::string path_here() const {
    std::string path;
    for (const Frame& frame : frames_) {
      const bool is_array = frame.schema->type == JsonType::kArray;
      if (!is_array && !path.empty()) path += '.';
      path += is_array ? std::to_string(frame.count - 1).insert(0, 1, '[').append(1, ']')
                       : frame.key.substr(0, kLongestKey);
    }
    return path.empty() ? "the root" : path;
  }

  const std::string& path_;
  const JsonWindow& window_;
  const bool withheld_;
  FilteredJson out_;
  std::vector<Frame> frames_;
  const Schema* pending_ = nullptr;  // of the value after the key just read
  uint64_t dropped_depth_ = 0;       // open brackets of what is being dropped
  bool separator_due_ = false;
};

FilteredJson filter_once(const ReadableFile& file, FileRange range, bool withhold,
                         MemoryBudget& budget) {
  JsonWindow window(file, range, withhold);
  Filter filter(file.path(), window, withhold, budget);
  json::sax_parse(JsonIterator(window), JsonIterator(), &filter);
  return filter.take();
}

}  // namespace

FilteredJson filter_json(const ReadableFile& file, FileRange range, MemoryBudget& budget) {
  try {
    return filter_once(file, range, true, budget);
  } catch (const EscapedDataUri&) {
    // The URI itself, the parser's copy and the one that is kept.
    const MemoryCharge strings(budget, 3 * range.size, "escaped data: URIs of " + file.path());
    return filter_once(file, range, false, budget);
  }
}

}  // namespace voxdag::gltf
