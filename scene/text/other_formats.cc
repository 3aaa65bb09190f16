#include "scene/text/other_formats.h"

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/base/options/option_text.h"
#include "core/image/image_formats.h"
#include "core/io/lfs_pointer.h"
#include "scene/messages.h"
#include "scene/text/characters.h"
#include "scene/text/numbers.h"

namespace voxdag {
namespace {

constexpr size_t kFirstBytes = 4096;

constexpr const char* kUnpack = "unpack it first";
constexpr const char* kConvert = "convert it first, for example with Blender";
#ifdef VOXDAG_HAS_ASSIMP
constexpr bool kCanImport = true;
#else
constexpr bool kCanImport = false;
#endif
// Stand for remedy_text().
constexpr const char* kImport = "import";
constexpr const char* kUnpackOrImport = "unpack or import";

// Returns the advice that the message about a format ends with. Names voxdag import if the users
// have this command.
std::string remedy_text(std::string_view remedy) {
  if (remedy != kImport && remedy != kUnpackOrImport) return std::string(remedy);
  const std::string import = kCanImport ? command_text("import") : "";
  if (import.empty()) return kConvert;
  return (remedy == kImport ? "convert it first: " : "unpack it first, or convert a 3MF file: ") +
         import + " IN OUT.glb";
}

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
    {0, "\x1f\x9d", "compressed by compress", kUnpack},
    {0, {"]\0\0", 3}, "compressed by lzma", kUnpack},
    {0, "LZIP", "compressed by lzip", kUnpack},
    {0, "\x89LZO", "compressed by lzop", kUnpack},
    {0, "!<arch>", "an ar archive", kUnpack},
    {0, "MSCF", "a cabinet archive", kUnpack},
    {0, "7z\xbc\xaf\x27\x1c", "a 7z archive", kUnpack},
    {0, "Rar!", "a RAR archive", kUnpack},
    {257, "ustar", "a tar archive", kUnpack},
    {0, "PK\x03\x04", "a zip archive, as 3MF, USDZ and KMZ files are", kUnpackOrImport},
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

// An encoding of text in units of `bytes` bytes. If a unit is an ASCII character, its byte `at` is
// the character, and its other bytes are 0.
struct WideEncoding {
  const char* name;
  std::string_view mark;  // byte order mark
  size_t bytes, at;
};

// UTF-32 comes first, because its byte order mark begins with the mark of UTF-16.
constexpr WideEncoding kWide[] = {{"UTF-32LE", {"\xff\xfe\0\0", 4}, 4, 0},
                                  {"UTF-32BE", {"\0\0\xfe\xff", 4}, 4, 3},
                                  {"UTF-16LE", "\xff\xfe", 2, 0},
                                  {"UTF-16BE", "\xfe\xff", 2, 1}};

// True if the first characters of the text (at least 4, at most 16) are ASCII characters in this
// encoding.
bool is_ascii_in(const WideEncoding& encoding, std::string_view begin) {
  constexpr size_t kMinUnits = 4, kMaxUnits = 16;
  const size_t units = std::min(begin.size() / encoding.bytes, kMaxUnits);
  for (size_t i = 0; i < units * encoding.bytes; ++i) {
    const char c = begin[i];
    const bool is_text = is_blank(c) || is_line_end(c) || (c >= ' ' && c <= '~');
    if (i % encoding.bytes == encoding.at ? !is_text : c != '\0') return false;
  }
  return units >= kMinUnits;
}

const WideEncoding* wide_encoding_of(std::string_view begin) {
  for (const WideEncoding& encoding : kWide)
    if (begin.starts_with(encoding.mark) || is_ascii_in(encoding, begin)) return &encoding;
  return nullptr;
}

// True if the file begins with the header of a tar file, also of a tar file from before POSIX,
// which has no magic number. The header contains its checksum in octal digits: the sum of its
// bytes, with blanks in place of the digits.
bool is_tar_header(std::string_view begin) {
  constexpr size_t kHeader = 512, kDigitsAt = 148, kDigits = 8;
  if (begin.size() < kHeader) return false;
  uint64_t sum = kDigits * ' ', declared = 0;
  for (size_t i = 0; i < kHeader; ++i) {
    const char c = begin[i];
    if (i < kDigitsAt || i >= kDigitsAt + kDigits)
      sum += static_cast<unsigned char>(c);
    else if (c >= '0' && c <= '7')
      declared = 8 * declared + static_cast<uint64_t>(c - '0');
  }
  return sum == declared;
}

std::string contents_of_markup(std::string_view text) {
  std::string small(text);
  for (char& c : small) c = lower(c);
  if (small.find("<collada") != small.npos) return "a COLLADA file: " + remedy_text(kImport);
  if (small.find("<x3d") != small.npos) return "an X3D file: " + remedy_text(kImport);
  if (small.find("<html") != small.npos || small.starts_with("<!doctype html"))
    return "a web page, perhaps the error page of a failed download";
  return "an XML file";
}

// True if the file has the bytes of the format at their offset.
bool matches(const KnownFormat& known, std::string_view begin) {
  if (begin.size() <= known.offset || !begin.substr(known.offset).starts_with(known.bytes))
    return false;
  const size_t end = known.offset + known.bytes.size();
  return !known.is_word || end == begin.size() || is_blank(begin[end]) || is_line_end(begin[end]);
}

// True if text of other formats is unlikely to begin with the bytes of this format.
bool is_distinct_in_text(const KnownFormat& known) {
  return known.offset == 0 && (known.is_word || known.bytes.size() >= 5);
}

// Removes leading white space and comments of JavaScript from the text.
std::string_view without_leading_comments(std::string_view text) {
  for (;;) {
    text = without_leading_space(text);
    const bool is_line = text.starts_with("//");
    if (!is_line && !text.starts_with("/*")) return text;
    const size_t end = is_line ? text.find_first_of("\r\n") : text.find("*/", 2);
    text.remove_prefix(std::min(text.size(), end == text.npos ? end : end + 2 - is_line));
  }
}

// Removes the first line from the text. Returns the number of words in this line if all of them are
// numbers, otherwise 0.
size_t take_line_of_numbers(std::string_view& text) {
  const size_t end = std::min(text.find_first_of("\r\n"), text.size());
  std::string_view line = text.substr(0, end);
  text = without_leading_space(text.substr(end));
  size_t count = 0;
  for (std::string_view word = next_word(line); !word.empty(); word = next_word(line), ++count)
    if (!parse_real<double>(word)) return 0;
  return count;
}

// Describes a file of the format PTS or PTX. A PTS file begins with the number of its points, and a
// PTX file begins with the size of a grid of points. Returns "" for other texts.
std::string describe_points(std::string_view text) {
  if (take_line_of_numbers(text) != 1) return "";
  size_t numbers = take_line_of_numbers(text);
  if (numbers >= 3)
    return "is a PTS point cloud: remove its first line, and name the rest .xyz; " +
           option_text("columns", "x,y,z,_,r,g,b") + " reads its colors";
  if (numbers == 1 && take_line_of_numbers(text) == 3)
    return "is a PTX point cloud: convert it to LAS or PLY";
  return "";
}

std::string describe_text(std::string_view text) {
  if (text.starts_with('<')) return "is " + contents_of_markup(text);
  if (text.starts_with('/') && without_leading_comments(text).starts_with('{'))
    return "is JSON with comments, which glTF does not allow: remove the comments";
  return describe_points(text);
}

}  // namespace

std::string_view without_leading_space(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
}

std::string first_bytes_of(const ReadableFile& file) {
  std::string begin(std::min<uint64_t>(file.size(), kFirstBytes), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(begin)));
  return begin;
}

std::string describe_other_format(std::string_view begin) {
  const ImageFormat* const image = image_format_of(std::as_bytes(std::span(begin)));
  if (image && image->is_image) return std::string("is ") + image->name;
  if (const WideEncoding* const wide = wide_encoding_of(begin)) {
    const std::string name = wide->name;
    return "is text in " + name + ": convert it first: iconv -f " + name + " -t UTF-8 IN > OUT";
  }
  for (const KnownFormat& known : kKnown)
    if (matches(known, begin))
      return "is " + std::string(known.name) + (*known.remedy ? ": " : "") +
             remedy_text(known.remedy);
  if (is_tar_header(begin)) return std::string("is a tar archive: ") + kUnpack;
  return describe_text(without_leading_space(begin));
}

bool is_other_text(std::string_view begin) {
  return without_leading_space(begin).starts_with('<') ||
         std::ranges::any_of(kKnown, [&](const KnownFormat& known) {
           return is_distinct_in_text(known) && matches(known, begin);
         });
}

bool is_no_text(std::string_view begin) {
  return begin.find('\0') != begin.npos || std::ranges::any_of(begin, [](char c) {
           return c > '\0' && c < ' ' && !is_blank(c) && !is_line_end(c) && c != kEndMark;
         });
}

}  // namespace voxdag
