#include "scene/formats/unknown_file.h"

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "core/image/image_formats.h"
#include "core/io/lfs_pointer.h"
#include "scene/formats/formats.h"
#include "scene/messages.h"
#include "scene/text/characters.h"

namespace voxdag {
namespace {

constexpr size_t kFirstBytes = 512;

constexpr const char* kUnpack = "unpack it first";
constexpr const char* kRecode = "convert it first: iconv -f UTF-16 -t UTF-8 IN > OUT";
constexpr const char* kConvert = "convert it first, for example with Blender";
#ifdef VOXDAG_HAS_ASSIMP
constexpr const char* kImport = "convert it first: voxdag import IN OUT.glb";
constexpr const char* kUnpackOrImport =
    "unpack it first, or convert a 3MF file: voxdag import IN OUT.glb";
#else
constexpr const char* kImport = kConvert;
constexpr const char* kUnpackOrImport = kConvert;
#endif

// A file format that voxdag does not read but recognizes, to name it in the error message. Its
// files have `bytes` at `offset`. `remedy` is advice for the user. Image formats are not in this
// table.
struct KnownFormat {
  size_t offset;
  std::string_view bytes;
  const char* name;  // follows "is" in the message: "compressed by gzip"
  const char* remedy = "";
  bool is_word = false;  // a blank or a line end follows the bytes
};

// The first matching row is used, so longer patterns come before their prefixes.
constexpr KnownFormat kKnown[] = {
    {0, kLfsPointerBegin, "a Git LFS pointer, not the file itself", "run git lfs pull"},
    {0, "\x1f\x8b", "compressed by gzip", kUnpack},
    {0, "\x28\xb5\x2f\xfd", "compressed by Zstandard", kUnpack},
    {0, {"\xfd\x37zXZ\0", 6}, "compressed by xz", kUnpack},
    {0, "BZh", "compressed by bzip2", kUnpack},
    {0, "\x04\x22\x4d\x18", "compressed by LZ4", kUnpack},
    {0, "7z\xbc\xaf\x27\x1c", "a 7z archive", kUnpack},
    {0, "Rar!", "a RAR archive", kUnpack},
    {257, "ustar", "a tar archive", kUnpack},
    {0, "PK\x03\x04", "a zip archive, as 3MF, USDZ and KMZ files are", kUnpackOrImport},
    {0, "\xff\xfe", "text in UTF-16", kRecode},
    {0, "\xfe\xff", "text in UTF-16", kRecode},
    {0, "Kaydara FBX Binary", "an FBX file", kImport},
    {0, "; FBX", "an FBX file", kImport},
    {0, "BLENDER", "a Blender file", "export it as .glb"},
    {0, "PXR-USDC", "a USD file", kConvert},
    {0, "#usda", "a USD file", kConvert},
    {0, "MM", "a 3DS file", kImport},
    {0, "Ogawa", "an Alembic file", kConvert},
    {0, "\x89HDF\r\n\x1a\n", "an HDF5 file", kConvert},
    {0, "# vtk DataFile", "a VTK file", kConvert},
    {0, "<VTKFile", "a VTK file", kConvert},
    {0, "# .PCD", "a PCD point cloud", "convert it to PLY"},
    {0, ".PCD", "a PCD point cloud", "convert it to PLY"},
    {0, "ASTM-E57", "an E57 point cloud", "convert it to PLY or LAS"},
    {0, "#VRML", "a VRML file", kConvert},
    {0, "OFF", "an OFF file", kImport, true},
    {0, "COFF", "an OFF file", kImport, true},
    {0, "NOFF", "an OFF file", kImport, true},
    {0, "xof 0", "a DirectX file", kImport},
    {0, "AC3D", "an AC3D file", kImport},
    {0, "MS3D", "a MilkShape 3D file", kImport},
    {0, "BB3D", "a Blitz3D file", kImport},
    {0, "IDP2", "a Quake II model", kImport},
    {0, "IDP3", "a Quake III model", kImport},
    {0, "MD5Version", "a Doom 3 model", kImport},
    {0, "INTERQUAKEMODEL", "an Inter-Quake model", kImport},
    {8, "LWO", "a LightWave file", kImport},
    {0, "ISO-10303-21", "a STEP or IFC file", kConvert},
    {0, "AC10", "a DWG file", kConvert},
    {0, "VOX ", "a MagicaVoxel file"},
    {0, "DRACO", "a bare Draco file", "convert it to .glb"},
    {0, "%PDF", "a PDF document"},
    {0, "SQLite format 3", "an SQLite database"},
    {0,
     "\x7f"
     "ELF",
     "a program"},
};

std::string contents_of_markup(std::string_view text) {
  std::string small(text);
  for (char& c : small) c = lower(c);
  if (small.find("<collada") != small.npos) return std::string("a COLLADA file: ") + kImport;
  if (small.find("<x3d") != small.npos) return std::string("an X3D file: ") + kImport;
  if (small.find("<html") != small.npos || small.starts_with("<!doctype html"))
    return "a web page, perhaps the error page of a failed download";
  return "an XML file";
}

// Returns the first bytes of a file, which identify its format.
std::string read_begin(const ReadableFile& file) {
  std::string begin(std::min<uint64_t>(file.size(), kFirstBytes), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(begin)));
  return begin;
}

// True if the file has the bytes of the format.
bool matches(const KnownFormat& known, std::string_view begin) {
  if (begin.size() <= known.offset || !begin.substr(known.offset).starts_with(known.bytes))
    return false;
  const size_t end = known.offset + known.bytes.size();
  return !known.is_word || end == begin.size() || is_blank(begin[end]) || is_line_end(begin[end]);
}

// True if no other text is likely to begin with the bytes of the format.
bool is_distinct_in_text(const KnownFormat& known) {
  return known.offset == 0 && (known.is_word || known.bytes.size() >= 5);
}

std::string_view without_leading_space(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
}

// Returns the file's format and a remedy for the error message, such as "is compressed by gzip:
// unpack it first". `begin` is the beginning of the file.
std::string describe(std::string_view begin) {
  if (begin.empty()) return "is empty";
  const ImageFormat* const image = image_format_of(std::as_bytes(std::span(begin)));
  if (image && image->is_image) return std::string("is ") + image->name;
  for (const KnownFormat& known : kKnown)
    if (matches(known, begin))
      return "is " + std::string(known.name) + (*known.remedy ? ": " : "") + known.remedy;
  const std::string_view text = without_leading_space(begin);
  if (text.empty()) return "begins with blanks only";
  if (text.starts_with('<')) return "is " + contents_of_markup(text);
  return "has an unknown format; it begins with " + printable(text, 16);
}

std::string list_formats() {
  std::string list;
  for (const SceneFormat& format : scene_formats()) {
    list += (list.empty() ? "" : "; ") + std::string(format.name) + " (";
    for (size_t i = 0; i < format.endings.size(); ++i)
      list += (i > 0 ? ", " : "") + std::string(format.endings[i]);
    list += ")";
  }
  return list;
}

}  // namespace

bool is_other_text(const ReadableFile& file) {
  const std::string begin = read_begin(file);
  return without_leading_space(begin).starts_with('<') ||
         std::ranges::any_of(kKnown, [&](const KnownFormat& known) {
           return is_distinct_in_text(known) && matches(known, begin);
         });
}

void refuse_unknown_file(const ReadableFile& file) {
  refuse(file.path(), describe(read_begin(file)) + "; expected a scene: " + list_formats());
}

}  // namespace voxdag
