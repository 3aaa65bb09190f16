# Writes a source file that contains the bytes of FILES. Usage:
#     cmake -DOUTPUT=embedded_files.cc -DROOT=server -DFILES="web/app.js;web/lib/dom.js" -P embed.cmake
# The name of a file is its path without the first folder: "app.js", "lib/dom.js".
set(arrays "")
set(rows "")
set(index 0)
foreach(file IN LISTS FILES)
  string(FIND ${file} "/" slash)
  math(EXPR begin "${slash} + 1")
  string(SUBSTRING ${file} ${begin} -1 name)
  file(READ ${ROOT}/${file} hex HEX)
  string(REGEX REPLACE "(..)" "0x\\1," bytes "${hex}")
  string(APPEND arrays "const unsigned char kBytes${index}[] = {${bytes}0};\n")
  string(APPEND rows "    {\"${name}\", kBytes${index}, sizeof kBytes${index} - 1},\n")
  math(EXPR index "${index} + 1")
endforeach()
file(WRITE ${OUTPUT} "#include \"server/web/assets.h\"

namespace voxdag::server {
namespace {

${arrays}
}  // namespace

const EmbeddedFile kEmbeddedFiles[] = {
${rows}    {\"\", nullptr, 0},
};

}  // namespace voxdag::server
")
