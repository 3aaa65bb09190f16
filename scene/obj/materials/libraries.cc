#include "scene/obj/materials/libraries.h"

#include <algorithm>
#include <memory>

#include "core/base/error.h"
#include "scene/lfs_pointer.h"
#include "scene/messages.h"
#include "scene/text/characters.h"
#include "scene/text/other_formats.h"
#include "scene/text/side_files.h"

namespace voxdag::obj {
namespace {

constexpr std::string_view kEnding = ".mtl";

// Divides the arguments of mtllib into file names, which may contain blanks. A name ends at a word
// that ends with ".mtl". If no word does, each word is a name.
std::vector<std::string> names_of(std::string_view arguments) {
  std::vector<std::string> names;
  std::string_view rest = trimmed(arguments), name_begin = rest;
  bool has_ending = false;
  std::vector<std::string> words;
  for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
    words.emplace_back(word);
    const std::string_view end = word.substr(word.size() - std::min(word.size(), kEnding.size()));
    if (!equals_in_any_case(end, kEnding)) continue;
    has_ending = true;
    names.emplace_back(trimmed(name_begin.substr(0, name_begin.size() - rest.size())));
    name_begin = rest;
  }
  return has_ending ? names : words;
}

// Throws Error if the file is not a text file, for example a compressed library.
void refuse_other_format(const ReadableFile& file) {
  const std::string begin = first_bytes_of(file);
  const std::string_view text = file.size() == begin.size() ? without_end_marks(begin) : begin;
  if (!is_no_text(text)) return;
  const std::string known = describe_other_format(begin);
  refuse(file.path(),
         known.empty() ? "is not a text file, expected a library of materials" : known);
}

class LibraryList {
 public:
  LibraryList(FileSystem& files, const ObjFile& obj, MemoryBudget& budget, GrowingCharge& charge,
              WarningList& warnings)
      : files_(files), obj_(obj), budget_(budget), charge_(charge), warnings_(warnings) {}

  Libraries read() {
    for (const ObjFile::Library& library : obj_.libraries()) {
      if (open(library.names, nullptr)) continue;
      const std::vector<std::string> names = names_of(library.names);
      for (const std::string& name : names) open(name, &library);
    }
    return std::move(result_);
  }

 private:
  // Opens a library and adds its materials. If the library cannot be opened, returns false, and
  // warns about the statement `from` unless `from` is null.
  bool open(const std::string& name, const ObjFile::Library* from) {
    std::unique_ptr<ReadableFile> file;
    try {
      file = open_side_file(files_, obj_.file().path(), name);
      refuse_lfs_pointer(*file, "the library of materials");
      refuse_other_format(*file);
    } catch (const Error& error) {
      if (from) warn(*from, name, error.message());
      return false;
    }
    const SourceFile source{file->path(), file->identity()};
    if (std::ranges::count(result_.files, source) == 0) add(*file, source);
    return true;
  }

  void add(const ReadableFile& file, const SourceFile& source) {
    charge_.add(sizeof(SourceFile) + source.path.size());
    for (LibraryMaterial& material : read_library(file, budget_, charge_, warnings_)) {
      const auto number = static_cast<uint32_t>(result_.materials.size());
      charge_.add(kNodeBytes + 2 * sizeof(LibraryEntry) + material.name.size());
      if (result_.numbers.try_emplace(material.name, number).second)
        result_.materials.push_back({std::move(material), result_.files.size()});
    }
    result_.files.push_back(source);
  }

  void warn(const ObjFile::Library& from, const std::string& name, const std::string& reason) {
    warnings_.add({"missing-file", obj_.file().path() + ": line " + std::to_string(from.line),
                   "mtllib " + printable(name) + " cannot be opened (" + reason +
                       "); its materials are white"});
  }

  static constexpr uint64_t kNodeBytes = 96;  // bytes of a hash table's node

  FileSystem& files_;
  const ObjFile& obj_;
  MemoryBudget& budget_;
  GrowingCharge& charge_;
  WarningList& warnings_;
  Libraries result_;
};

}  // namespace

std::optional<uint32_t> Libraries::find(std::string_view name) const {
  const auto known = numbers.find(std::string(name));
  if (known != numbers.end()) return known->second;
  const size_t comment = name.find(" #");
  if (comment == name.npos) return std::nullopt;
  const auto shorter = numbers.find(std::string(trimmed(name.substr(0, comment))));
  return shorter == numbers.end() ? std::nullopt : std::optional(shorter->second);
}

Libraries read_libraries(FileSystem& files, const ObjFile& obj, MemoryBudget& budget,
                         GrowingCharge& charge, WarningList& warnings) {
  return LibraryList(files, obj, budget, charge, warnings).read();
}

}  // namespace voxdag::obj
