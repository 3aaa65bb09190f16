# cmake -DOUTPUT=embedded_files.cc -DFILES="a.html;b.css" -P embed.cmake
# Writes a source file that holds the files' bytes; server/assets.h finds them by name.
set(arrays "")
set(rows "")
set(index 0)
foreach(file IN LISTS FILES)
  get_filename_component(name ${file} NAME)
  file(READ ${file} hex HEX)
  string(REGEX REPLACE "(..)" "0x\\1," bytes "${hex}")
  string(APPEND arrays "const unsigned char kBytes${index}[] = {${bytes}0};\n")
  string(APPEND rows "    {\"${name}\", kBytes${index}, sizeof kBytes${index} - 1},\n")
  math(EXPR index "${index} + 1")
endforeach()
file(WRITE ${OUTPUT} "#include \"server/assets.h\"

namespace voxdag::server {
namespace {

${arrays}
}  // namespace

const EmbeddedFile kEmbeddedFiles[] = {
${rows}    {\"\", nullptr, 0},
};

}  // namespace voxdag::server
")
