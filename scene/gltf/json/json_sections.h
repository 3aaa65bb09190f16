// Reads the JSON of a scene file once, from beginning to end. The root's members ("nodes",
// "asset", ...) are its sections. The caller names the sections to read, and receives one element
// after the other; memory holds one element. Other sections and all members "extras" are skipped.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/gltf/json/element_text.h"
#include "scene/gltf/json/json_element.h"
#include "voxdag/cancel_token.h"

namespace voxdag::gltf {

struct JsonSection {
  std::string name;
  bool is_array;    // each element is read separately; otherwise the section is one element
  bool is_checked;  // true: read_sections() returns the message of a Violation
  // Receives each element as a value or as text. May throw Violation. The argument is valid during
  // the call.
  std::variant<std::function<void(const JsonElement&)>, std::function<void(const ElementText&)>>
      read;

  bool is_read_as_text() const { return read.index() == 1; }
};

// Passes the elements of `sections` to their readers in the order of the file. Returns the message
// of the first Violation in a checked section, or "". Passes the messages of Violations in other
// sections to `ignore`. Continues to read after a Violation, because the file's glTF version may
// follow. If the version is unsupported, the caller reports the version, not the Violation. Throws
// Error{kInvalidInput} for a text that is not JSON, Error{kOutOfMemory} for an element that does
// not fit the budget.
std::string read_sections(const ReadableFile& file, FileRange json,
                          const std::vector<JsonSection>& sections,
                          const std::function<void(const std::string&)>& ignore,
                          MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag::gltf
