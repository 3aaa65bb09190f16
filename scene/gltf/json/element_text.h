// Writes the JSON text of one element from its values, as a parser delivers them. Numbers, strings
// and the order of members are kept; blanks are not. Whole numbers have no decimal point.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace voxdag::gltf {

// The JSON text of an element, and counts from which the memory of its values is estimated.
struct ElementText {
  std::string text;
  uint64_t values = 0;                // number of values, including the element itself
  uint64_t values_in_extensions = 0;  // number of values inside a member "extensions"
  uint64_t members = 0;               // number of members of objects
  uint64_t string_bytes = 0;          // bytes of all strings and keys of members
};

class ElementTextWriter {
 public:
  // add_scalar() and start() add a value. `key` is the value's name if the value is a member of an
  // object; otherwise `key` is ignored. start() takes an empty object or array. All values that are
  // added before the matching call of end() are inside this object or array.
  void add_scalar(std::string_view key, const nlohmann::json& value);
  void start(std::string_view key, const nlohmann::json& value);
  void end();

  const ElementText& written() const { return written_; }
  // Returns the text of the element, and begins the next element.
  ElementText take();

 private:
  struct Container {
    bool is_object;
    bool is_extensions;  // the container, or one around it, is a member "extensions"
    bool is_empty;
  };

  void begin_value(std::string_view key);

  ElementText written_;
  std::vector<Container> open_;
};

}  // namespace voxdag::gltf
