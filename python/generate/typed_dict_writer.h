// Writes Python TypedDicts from the JSON schema of a record (core/fields/json_schema.h).
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "core/fields/json_fields.h"

namespace voxdag::python {

// Collects the definitions of TypedDicts. A nested object has its own TypedDict, which is defined
// before the TypedDict that uses it.
class TypedDictWriter {
 public:
  // Adds the TypedDict `name` for an object's schema.
  void add(const std::string& name, const std::string& documentation, const FieldJson& schema) {
    const auto required = schema["required"].get<std::vector<std::string>>();
    std::string members;
    for (const auto& [member, property] : schema["properties"].items()) {
      const std::string type = type_of(property, name + camel_case(member));
      const bool is_required = std::ranges::count(required, member) > 0;
      members += "    " + member + ": " + (is_required ? type : "NotRequired[" + type + "]") + "\n";
    }
    text +=
        "\n\nclass " + name + "(TypedDict):\n    \"\"\"" + documentation + "\"\"\"\n\n" + members;
  }

  std::string text;

 private:
  static std::string camel_case(const std::string& name) {
    std::string words;
    bool begins = true;
    for (const char c : name) {
      if (c != '_') words += begins ? static_cast<char>(std::toupper(c)) : c;
      begins = c == '_';
    }
    return words;
  }
  std::string type_of(const FieldJson& schema, const std::string& name) {
    const std::string type = schema.value("type", "");
    if (type == "boolean") return "bool";
    if (type == "integer") return "int";
    if (type == "number") return "float";
    if (type == "string") return "str";
    if (type == "array") {
      // False for an array with a fixed number of items.
      const bool has_items = schema["items"].is_object();
      return "list[" + type_of(has_items ? schema["items"] : schema["prefixItems"][0], name) + "]";
    }
    if (!schema.contains("properties")) return "Any";
    add(name, "A part of a report.", schema);
    return name;
  }
};

}  // namespace voxdag::python
