#include "scene/gltf/json/json_sections.h"

#include <algorithm>
#include <istream>
#include <set>
#include <utility>

#include "core/base/error.h"
#include "scene/gltf/json/json_window.h"
#include "scene/growing_charge.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxParserReasonBytes = 300;
// Values nested deeper than this inside an element are skipped. glTF nests about eight deep.
constexpr size_t kMaxNesting = 32;

// Memory of a value: its space in a growing array or in a map, and its own allocations.
constexpr uint64_t kBytesPerArrayElement = 3 * sizeof(Json);
constexpr uint64_t kBytesPerObjectMember = 112;
constexpr uint64_t kBytesPerContainer = 64;
// Copies of a string in memory while it grows: its old and its new characters exist together.
constexpr uint64_t kGrowingCopies = 2;

// Receives the parser's events. Builds each element of the requested sections: its JSON text if the
// section is read as text, otherwise a Json value. Skips the members "extras", and values that are
// nested more deeply than kMaxNesting.
class SectionParser : public nlohmann::json_sax<Json> {
 public:
  SectionParser(const std::string& path, const JsonWindow& window,
                const std::vector<JsonSection>& sections,
                const std::function<void(const std::string&)>& ignore, MemoryBudget& budget)
      : path_(path),
        window_(window),
        sections_(sections),
        ignore_(ignore),
        charge_(budget, "an element in the JSON of " + path) {}

  const std::string& violation() const { return violation_; }

  bool null() override { return scalar(nullptr); }
  bool boolean(bool v) override { return scalar(v); }
  bool number_integer(number_integer_t v) override { return scalar(v); }
  bool number_unsigned(number_unsigned_t v) override { return scalar(v); }
  bool number_float(number_float_t v, const string_t&) override { return scalar(v); }
  bool string(string_t& v) override {
    if (depth_ == 1 && key_ == "uri") uri_ = window_.last_string();
    if (skipped_depth_ == 0 && !skips_next_) element_bytes_ += v.size() + sizeof(string_t);
    return scalar(std::move(v));
  }
  bool binary(binary_t&) override { return true; }  // never called for text

  bool start_object(size_t) override { return start(Json::object()); }
  bool end_object() override { return end(); }
  bool start_array(size_t) override { return start(Json::array()); }
  bool end_array() override { return end(); }

  bool key(string_t& name) override {
    if (skipped_depth_ > 0) return true;
    if (depth_ > 0) {
      key_ = std::move(name);
      skips_next_ = key_ == "extras";
      return true;
    }
    const auto found = std::ranges::find(sections_, name, &JsonSection::name);
    skips_next_ = found == sections_.end();
    if (skips_next_) return true;
    section_ = &*found;
    index_ = 0;
    if (!seen_.insert(name).second) violate(name + " is given twice, expected it once");
    return true;
  }

  bool parse_error(size_t, const std::string&, const Json::exception& e) override {
    refuse(path_, "its JSON is broken at byte " + std::to_string(window_.position()) + ": " +
                      printable(without_prefix(e.what()), kMaxParserReasonBytes));
  }

 private:
  // Kind of the next value: part of a skipped value, the root, the array of a section, an element
  // of a section, or a value inside an element.
  enum class Place { kSkipped, kRoot, kSection, kElement, kInElement };

  Place next_place() {
    if (skipped_depth_ > 0 || std::exchange(skips_next_, false)) return Place::kSkipped;
    if (depth_ > 0) return Place::kInElement;
    if (!in_root_) return Place::kRoot;
    return section_->is_array && !in_section_ ? Place::kSection : Place::kElement;
  }

  bool scalar(Json value) {
    const Place place = next_place();
    if (place == Place::kRoot || place == Place::kSection) {
      violate_type(value);
    } else if (place != Place::kSkipped) {
      add_scalar(place, std::move(value));
      if (depth_ == 0) finish_element();
    }
    return true;
  }

  bool start(Json value) {
    const Place place = next_place();
    const bool is_nested_too_deep = depth_ == kMaxNesting;
    if (place == Place::kSkipped || is_nested_too_deep) {
      ++skipped_depth_;
    } else if (place == Place::kRoot || place == Place::kSection) {
      if (value.is_object() == (place == Place::kRoot)) {
        (place == Place::kRoot ? in_root_ : in_section_) = true;
      } else {
        violate_type(value);
        ++skipped_depth_;
      }
    } else {
      start_container(place, std::move(value));
      ++depth_;
    }
    return true;
  }

  bool end() {
    if (skipped_depth_ > 0) {
      --skipped_depth_;
    } else if (depth_ > 0) {
      end_container();
      if (--depth_ == 0) finish_element();
    } else {
      in_section_ = false;
    }
    return true;
  }

  void add_scalar(Place place, Json value) {
    if (!section_->is_read_as_text()) {
      insert(place, std::move(value));
      return;
    }
    writer_.add_scalar(key_, value);
    charge_.grow_to(kGrowingCopies * writer_.written().text.size());
  }
  void start_container(Place place, Json value) {
    if (section_->is_read_as_text()) {
      writer_.start(key_, value);
    } else {
      element_bytes_ += kBytesPerContainer;
      open_.push_back(insert(place, std::move(value)));
    }
  }
  void end_container() {
    if (section_->is_read_as_text())
      writer_.end();
    else
      open_.pop_back();
  }

  // Inserts the value and returns its address.
  Json* insert(Place place, Json value) {
    if (place == Place::kElement) return &(element_ = std::move(value));
    Json& parent = *open_.back();
    if (parent.is_array()) {
      charge(kBytesPerArrayElement);
      return &parent.emplace_back(std::move(value));
    }
    charge(kBytesPerObjectMember + key_.size());
    if (parent.contains(key_))
      violate(element().path() + ": the member " + printable(key_) +
              " is given twice in an object, expected it once");
    Json& member = parent[key_];
    member = std::move(value);
    return &member;
  }
  void charge(uint64_t bytes) { charge_.grow_to(element_bytes_ += bytes); }

  JsonElement element() const {
    return {element_, section_->name, section_->is_array ? index_ : JsonElement::kNoIndex, uri_};
  }
  void finish_element() {
    try {
      if (section_->is_read_as_text())
        std::get<1>(section_->read)(writer_.take());
      else
        std::get<0>(section_->read)(element());
    } catch (const Violation& v) {
      violate(v.message);
    }
    element_ = nullptr;
    element_bytes_ = 0;
    uri_ = {};
    ++index_;
  }

  void violate_type(const Json& value) {
    const std::string_view name = in_root_ ? std::string_view(section_->name) : "the root";
    const JsonElement found(value, name, JsonElement::kNoIndex, uri_);
    try {
      found.violate(in_root_ ? "an array" : "an object");
    } catch (const Violation& v) {
      violate(v.message);
    }
  }
  void violate(const std::string& message) {
    if (in_root_ && !section_->is_checked)
      ignore_(message);
    else if (violation_.empty())
      violation_ = message;
  }

  const std::string& path_;
  const JsonWindow& window_;
  const std::vector<JsonSection>& sections_;
  const std::function<void(const std::string&)>& ignore_;
  // Charge for the largest element so far. It never shrinks, because the allocator may retain the
  // memory.
  GrowingCharge charge_;
  std::set<std::string> seen_;
  std::string violation_;

  bool in_root_ = false;
  const JsonSection* section_ = nullptr;
  bool in_section_ = false;  // inside the array of *section_
  int64_t index_ = 0;        // index of the element within its section

  uint64_t depth_ = 0;  // number of open objects and arrays of the element
  Json element_;
  std::vector<Json*> open_;   // the depth_ open objects and arrays within element_
  ElementTextWriter writer_;  // used instead of element_ if the section is read as text
  uint64_t element_bytes_ = 0;
  RawString uri_;
  std::string key_;  // key of the next value, if it is a member
  bool skips_next_ = false;
  uint64_t skipped_depth_ = 0;  // open brackets of a value that is being skipped
};

}  // namespace

std::string read_sections(const ReadableFile& file, FileRange json,
                          const std::vector<JsonSection>& sections,
                          const std::function<void(const std::string&)>& ignore,
                          MemoryBudget& budget, const CancelToken& cancel) {
  JsonWindow window(file, json, budget, cancel);
  SectionParser parser(file.path(), window, sections, ignore, budget);
  std::istream text(&window);
  Json::sax_parse(text, &parser);
  return parser.violation();
}

}  // namespace voxdag::gltf
