// The statements of an OBJ file: one per line, a keyword and its arguments.
#pragma once

#include <string_view>

#include "scene/text/characters.h"

namespace voxdag::obj {

enum class Kind {
  kIgnored,  // a blank line, a comment, or a statement that does not affect voxels
  kVertex,
  kTexture,
  kFace,
  kUseMaterial,
  kLibrary,
  kPointOrLine,
  kFreeForm,  // part of a free-form curve or surface
  kCall,      // includes another file
  kUnknown,
};

struct Statement {
  Kind kind;
  std::string_view keyword;
  std::string_view arguments;  // the rest of the line, without blanks at its ends
};

// Returns the statement of a line that begins with a keyword other than v, vt, vn and f.
Statement other_statement(std::string_view line);

// Returns the statement of a line without line end.
inline Statement statement_of(std::string_view line) {
  while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
  const auto with_arguments = [&](Kind kind, size_t keyword) {
    return Statement{kind, line.substr(0, keyword), line.substr(keyword)};
  };
  if (line.size() < 2) return other_statement(line);
  if (is_blank(line[1])) {
    if (line[0] == 'v') return with_arguments(Kind::kVertex, 1);
    if (line[0] == 'f') return with_arguments(Kind::kFace, 1);
  } else if (line[0] == 'v' && line.size() > 2 && is_blank(line[2])) {
    if (line[1] == 'n') return with_arguments(Kind::kIgnored, 2);
    if (line[1] == 't') return with_arguments(Kind::kTexture, 2);
  }
  return other_statement(line);
}

}  // namespace voxdag::obj
