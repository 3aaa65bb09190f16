// Writes Python keyword arguments from a description of options (core/fields/field.h).
#pragma once

#include <string>

#include "core/fields/field.h"

namespace voxdag::python {

template <class T>
std::string python_type(const Field& field) {
  if constexpr (IsOptional<T>::value) {
    return python_type<typename T::value_type>(field);
  } else if constexpr (std::is_same_v<T, bool>) {
    return "bool";
  } else if constexpr (std::is_integral_v<T>) {
    return field.is_bytes ? "Union[int, str]" : "int";
  } else if constexpr (std::is_floating_point_v<T>) {
    return "float";
  } else if constexpr (IsNumbers<T>::value) {
    return "Sequence[float]";
  } else if constexpr (NamedEnum<T>) {
    return "Literal[\"" + joined(choices_of<T>(), "\", \"") + "\"]";
  } else if constexpr (NameSet<T>) {
    return "Sequence[Literal[\"" + joined(NameSetTraits<T>::all(), "\", \"") + "\"]]";
  } else if constexpr (IsVector<T>::value) {
    const std::string item = python_type<typename T::value_type>(field);
    return "Union[" + item + ", Sequence[" + item + "]]";
  } else {
    return field.is_path ? "Path" : "str";
  }
}

// Collects the texts of _options.py from the fields of a BuildSpec. Each field becomes one keyword:
// a line in `members` with its type, and a line in `documents` with its description. `paths` has
// the quoted names of the keywords whose values are paths. Skips required fields, because they are
// parameters of the Python functions, not keywords.
class KeywordWriter {
 public:
  template <class T>
  void operator()(const Field& field, T& value) {
    if (field.is_required) return;
    const std::string name = field.name;
    std::string type = python_type<T>(field);
    if (name == "solid") type = "Union[bool, " + type + "]";  // True selects the recommended rule
    members += "    " + name + ": Optional[" + type + "]\n";
    documents += "    " + name + std::string(name.size() < 17 ? 18 - name.size() : 1, ' ') +
                 documentation(field, value, true) + "\n";
    if (field.is_path) paths += "\"" + name + "\", ";
  }

  std::string members, documents, paths;
};

}  // namespace voxdag::python
