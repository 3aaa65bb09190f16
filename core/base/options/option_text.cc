#include "core/base/options/option_text.h"

#include <algorithm>
#include <atomic>
#include <iterator>

namespace voxdag {
namespace {

std::atomic<const Audience*> g_audience{&kCommandLineUsers};

// The commands that are also functions of the Python package.
constexpr std::string_view kPythonFunctions[] = {"build",   "plan",   "combine", "extract",
                                                 "reorder", "export", "render"};

// Returns the value as JSON and Python write it: numbers as they are, lists of numbers in brackets,
// and texts in quotation marks.
std::string literal(std::string_view value, char open, char close) {
  const bool is_numeric = value.find_first_not_of("0123456789.,-+e") == std::string_view::npos;
  const bool is_list = value.find(',') != std::string_view::npos;
  if (!is_numeric) return '"' + std::string(value) + '"';
  return is_list ? open + std::string(value) + close : std::string(value);
}

}  // namespace

std::string spell_for_command_line(std::string_view name, std::string_view value) {
  std::string text = "--" + std::string(name);
  for (char& letter : text)
    if (letter == '_') letter = '-';
  return value.empty() ? text : text + ' ' + std::string(value);
}

std::string spell_as_member(std::string_view name, std::string_view value) {
  if (value.empty()) return "'" + std::string(name) + "'";
  return '"' + std::string(name) + "\": " + literal(value, '[', ']');
}

std::string spell_as_keyword(std::string_view name, std::string_view value) {
  const std::string text(name);
  return value.empty() ? text : text + '=' + literal(value, '(', ')');
}

std::string spell_command_line(std::string_view command, std::string_view option,
                               std::string_view value) {
  const std::string text = "voxdag " + std::string(command);
  return option.empty() ? text : text + ' ' + spell_for_command_line(option, value);
}

std::string spell_python_call(std::string_view command, std::string_view option,
                              std::string_view value) {
  if (std::ranges::find(kPythonFunctions, command) == std::end(kPythonFunctions))
    return "the shell command " + spell_command_line(command, option, value);
  std::string argument;
  if (!option.empty()) argument = spell_as_keyword(option, value) + (value.empty() ? "=True" : "");
  return "voxdag." + std::string(command) + '(' + argument + ')';
}

void set_audience(const Audience& audience) { g_audience = &audience; }

std::string option_text(std::string_view name, std::string_view value) {
  return g_audience.load()->spell_option(name, value);
}

std::string command_text(std::string_view command, std::string_view option,
                         std::string_view value) {
  return g_audience.load()->spell_command(command, option, value);
}

std::string repeat_text() { return g_audience.load()->repeat; }

}  // namespace voxdag
