// Words of messages that depend on the reader. The same message can reach users of the command
// line, of Python and of the HTTP API. They write options and commands in different ways, and they
// repeat a failed operation in different ways.
#pragma once

#include <string>
#include <string_view>

namespace voxdag {

// Spells an option with the given value, or without a value if `value` is empty. The name has
// underscores, as in JSON. A list of numbers has commas and no spaces: "1,2,3". Returns "" if the
// users cannot set the option. Messages then do not mention it.
using OptionSpeller = std::string (*)(std::string_view name, std::string_view value);

// "--hash-bits", "--level 11": the spelling of the command line, which is the default.
std::string spell_for_command_line(std::string_view name, std::string_view value);
// "'hash_bits'", "\"level\": 11", "\"region\": [0,0,0,4,4,4]": members of JSON.
std::string spell_as_member(std::string_view name, std::string_view value);
// "hash_bits", "level=11", "region=(0,0,0,4,4,4)": keyword arguments of Python.
std::string spell_as_keyword(std::string_view name, std::string_view value);

// Spells a command of the program, such as "build", with an option. `option` and `value` are the
// arguments of an OptionSpeller; `option` is "" for a command without options. Returns "" if the
// users cannot run the command. Messages then do not mention it.
using CommandSpeller = std::string (*)(std::string_view command, std::string_view option,
                                       std::string_view value);

// "voxdag verify", "voxdag build --solid winding".
std::string spell_command_line(std::string_view command, std::string_view option,
                               std::string_view value);
// "voxdag.build()", "voxdag.build(color=True)", "voxdag.build(solid=\"winding\")". Commands that
// Python does not have run in a shell: "the shell command voxdag verify".
std::string spell_python_call(std::string_view command, std::string_view option,
                              std::string_view value);

// The users who read the messages of a process.
struct Audience {
  OptionSpeller spell_option;
  CommandSpeller spell_command;
  // How they repeat a failed operation: a clause such as "run the same command again".
  const char* repeat;
};

inline constexpr Audience kCommandLineUsers{&spell_for_command_line, &spell_command_line,
                                            "run the same command again"};
inline constexpr Audience kPythonUsers{&spell_as_keyword, &spell_python_call,
                                       "make the same call again"};

// Sets the audience of this process, which is kCommandLineUsers by default. `audience` must remain
// valid until the process ends. Call it before the process starts threads.
void set_audience(const Audience& audience);

// Returns the option as the users of this process write it, or "" if they cannot set it.
std::string option_text(std::string_view name, std::string_view value = {});

// Returns the command as the users of this process run it, or "" if they cannot run it.
std::string command_text(std::string_view command, std::string_view option = {},
                         std::string_view value = {});

// Returns how the users of this process repeat a failed operation: Audience::repeat.
std::string repeat_text();

}  // namespace voxdag
