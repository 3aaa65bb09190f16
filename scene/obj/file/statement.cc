#include "scene/obj/file/statement.h"

#include <utility>

namespace voxdag::obj {
namespace {

constexpr std::pair<std::string_view, Kind> kKeywords[] = {
    {"v", Kind::kVertex},
    {"vt", Kind::kTexture},
    {"f", Kind::kFace},
    {"fo", Kind::kFace},  // the name of f before version 3
    {"usemtl", Kind::kUseMaterial},
    {"mtllib", Kind::kLibrary},
    {"p", Kind::kPointOrLine},
    {"l", Kind::kPointOrLine},
    {"call", Kind::kCall},
    // Names, normals and properties for display, which do not affect voxels.
    {"vn", Kind::kIgnored},
    {"vp", Kind::kIgnored},  // only free-form statements use these points
    {"o", Kind::kIgnored},
    {"g", Kind::kIgnored},
    {"s", Kind::kIgnored},
    {"mg", Kind::kIgnored},
    {"lod", Kind::kIgnored},
    {"bevel", Kind::kIgnored},
    {"c_interp", Kind::kIgnored},
    {"d_interp", Kind::kIgnored},
    {"maplib", Kind::kIgnored},
    {"usemap", Kind::kIgnored},
    {"shadow_obj", Kind::kIgnored},
    {"trace_obj", Kind::kIgnored},
    {"ctech", Kind::kIgnored},
    {"stech", Kind::kIgnored},
    // Free-form curves and surfaces, of version 3 and of earlier versions.
    {"cstype", Kind::kFreeForm},
    {"deg", Kind::kFreeForm},
    {"bmat", Kind::kFreeForm},
    {"step", Kind::kFreeForm},
    {"curv", Kind::kFreeForm},
    {"curv2", Kind::kFreeForm},
    {"surf", Kind::kFreeForm},
    {"parm", Kind::kFreeForm},
    {"trim", Kind::kFreeForm},
    {"hole", Kind::kFreeForm},
    {"scrv", Kind::kFreeForm},
    {"sp", Kind::kFreeForm},
    {"con", Kind::kFreeForm},
    {"bsp", Kind::kFreeForm},
    {"bzp", Kind::kFreeForm},
    {"cdc", Kind::kFreeForm},
    {"cdp", Kind::kFreeForm},
    {"res", Kind::kFreeForm},
};

}  // namespace

Statement other_statement(std::string_view line) {
  std::string_view arguments = line;
  const std::string_view keyword = next_word(arguments);
  if (keyword.empty() || keyword.front() == '#') return {Kind::kIgnored, keyword, {}};
  for (const auto& [known, kind] : kKeywords)
    if (keyword == known) return {kind, keyword, trimmed(arguments)};
  return {Kind::kUnknown, keyword, trimmed(arguments)};
}

}  // namespace voxdag::obj
