// Declares the fields of a struct as options of a command, with their help, groups and limits.
#pragma once

#include <map>
#include <string>

#include "cli/command.h"
#include "core/fields/field.h"

namespace voxdag::cli {

class OptionDeclarer {
 public:
  // Declares only fields whose scope is not after `scope`. A field's scope is the first of the
  // commands submit, plan and build (in this order) that has the field as an option.
  OptionDeclarer(Command& command, Scope scope) : command_(command), scope_(scope) {}

  // Leaves out the field of this name, which the command declares itself.
  void leave_out(const char* field_name) { left_out_ = field_name; }

  template <class T>
  void operator()(const Field& field, T& value) {
    if (field.scope > scope_ || field.name == left_out_) return;
    Option option = declare(field, value);
    if (*field.heading) option.group(field.heading);
    if (field.is_required) option.required();
    if (*field.excluded) option.excludes(at(field.excluded));
    if (*field.needed) option.needs(at(field.needed));
    options_.emplace(field.name, option);
  }
  void object(const char*, const auto& visit_members) { visit_members(*this); }

  // Returns the option that was declared for a field, for example to add an option that needs it.
  Option at(const std::string& field_name) const { return options_.at(field_name); }

 private:
  template <class T>
  Option declare(const Field& field, T& value) {
    const std::string names = option_names(field);
    if constexpr (std::is_same_v<T, bool>) {
      return command_.flag(names.c_str(), value, field.help);
    } else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
      const Option option = command_.option(names.c_str(), value, field.help);
      return field.is_positional ? option : Option(option).one_value_each();
    } else {
      const auto set = [field, &value](const std::string& text) {
        if (const std::string problem = field.is_path ? path_problem(text) : ""; !problem.empty())
          throw Error(ErrorCode::kInvalidInput, option_name(field.name) + ": " + problem);
        if (!parse_text(field, text, value))
          throw Error(ErrorCode::kInvalidInput, option_name(field.name) + ": '" + text +
                                                    "': expected " + expectation<T>(field));
      };
      return command_.text_option(names.c_str(), value_name<T>(field), set,
                                  documentation(field, value, true));
    }
  }

  // Returns the names under which a field's option is declared: "scene" for a positional argument,
  // "--hash-bits", or "-r,--resolution" for an option with a short form.
  static std::string option_names(const Field& field) {
    if (field.is_positional) return field.name;
    const std::string separator = *field.shorthand ? "," : "";
    return field.shorthand + separator + option_name(field.name);
  }

  // Returns the placeholder for a value in --help.
  template <class T>
  static const char* value_name(const Field& field) {
    using Value = typename OptionalValue<T>::type;
    if (*field.parts) return field.parts;
    if (field.is_bytes) return "SIZE";
    if (field.is_path) return "PATH";
    if constexpr (std::is_integral_v<Value>) return "N";
    if constexpr (std::is_floating_point_v<Value>) return "NUMBER";
    if constexpr (NamedEnum<Value>) return "NAME";
    if constexpr (NameSet<Value>) return "NAME,...";
    return "TEXT";
  }

  Command& command_;
  const Scope scope_;
  std::string left_out_;
  std::map<std::string, Option> options_;
};

// Returns work(). Converts a FieldError to an Error whose message has the name of the option, such
// as "--color-resolution", instead of the name of the field.
auto with_option_names(const auto& work) {
  try {
    return work();
  } catch (const FieldError& error) {
    throw Error(ErrorCode::kInvalidInput, option_name(error.field.c_str()) +
                                              " is not valid with the given options: expected " +
                                              error.expectation);
  }
}

}  // namespace voxdag::cli
