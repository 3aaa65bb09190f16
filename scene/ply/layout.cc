#include "scene/ply/layout.h"

#include <algorithm>
#include <initializer_list>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/ply/rows/numbers.h"

namespace voxdag::ply {
namespace {

constexpr size_t kNone = Layout::kNone;

size_t find_element(const Header& header, const char* name) {
  const size_t found = header.find(name);
  return found == header.elements.size() ? kNone : found;
}

// Returns the first of the properties `names` that exists and has the right form: a list if
// `is_list` is true, otherwise a number. Returns kNone if no property matches.
size_t find_property(const Element& element, std::initializer_list<const char*> names,
                     bool is_list) {
  for (const char* name : names) {
    const size_t found = element.find(name);
    if (found < element.properties.size() && element.properties[found].is_list == is_list)
      return found;
  }
  return kNone;
}

// `families` has alternative names for the same N numbers, such as red, green, blue and r, g, b.
// Returns the properties of the first family whose N properties all exist. If no family is
// complete, returns an empty list.
template <size_t N>
std::vector<size_t> find_family(const Element& element,
                                std::initializer_list<std::array<const char*, N>> families) {
  for (const auto& family : families) {
    std::vector<size_t> found;
    for (const char* name : family) {
      const size_t property = find_property(element, {name}, false);
      if (property != kNone) found.push_back(property);
    }
    if (found.size() == N) return found;
  }
  return {};
}

std::vector<size_t> find_colors(const Element& element) {
  std::vector<size_t> colors =
      find_family<3>(element, {{"red", "green", "blue"},
                               {"r", "g", "b"},
                               {"diffuse_red", "diffuse_green", "diffuse_blue"},
                               {"ambient_red", "ambient_green", "ambient_blue"}});
  if (colors.empty()) return colors;
  const size_t alpha =
      find_property(element, {"alpha", "a", "diffuse_alpha", "ambient_alpha"}, false);
  if (alpha != kNone) colors.push_back(alpha);
  return colors;
}

// Adds the names of the element's color properties that are not in `read` to `out`.
void list_ignored_colors(const Element& element, const std::vector<size_t>& read,
                         std::vector<std::string>& out) {
  constexpr const char* kNames[] = {"red",          "green",          "blue",
                                    "diffuse_red",  "diffuse_green",  "diffuse_blue",
                                    "specular_red", "specular_green", "specular_blue",
                                    "ambient_red",  "ambient_green",  "ambient_blue"};
  for (const char* name : kNames) {
    const size_t property = element.find(name);
    if (property == element.properties.size()) continue;
    if (std::ranges::find(read, property) == read.end())
      out.push_back(printable(element.properties[property].name));
  }
}

class LayoutFinder {
 public:
  LayoutFinder(const Header& header, const std::string& path) : header_(header), path_(path) {}

  Layout find() {
    out_.vertex = find_element(header_, "vertex");
    out_.face = find_rows("face");
    out_.strips = find_rows("tristrips");
    if (out_.vertex == kNone)
      refuse("has no element vertex, expected the line \"element vertex COUNT\" in its header");
    find_axes();
    if (out_.face != kNone) out_.face_indices = find_indices(out_.face, "faces");
    if (out_.strips != kNone) out_.strip_indices = find_indices(out_.strips, "tristrips");
    find_surfaces();
    return std::move(out_);
  }

 private:
  const Element& element(size_t index) const { return header_.elements[index]; }

  // Returns the index of the element with this name. Returns kNone if the file has no such element,
  // or if the element has no rows.
  size_t find_rows(const char* name) const {
    const size_t index = find_element(header_, name);
    return index == kNone || element(index).count == 0 ? kNone : index;
  }

  void find_axes() {
    const Element& vertex = element(out_.vertex);
    if (vertex.count >= kNoVertex)
      throw Error(ErrorCode::kLimit, path_ + ": has " + std::to_string(vertex.count) +
                                         " vertices, the limit is 2^32 - 2");
    constexpr const char* kNames[] = {"x", "y", "z"};
    for (size_t a = 0; a < 3; ++a) {
      out_.axes[a] = find_property(vertex, {kNames[a]}, false);
      if (out_.axes[a] == kNone)
        refuse(std::string("has vertices without a property ") + kNames[a] +
               ", expected x, y and z");
    }
  }

  size_t find_indices(size_t index, const std::string& what) const {
    const Element& rows = element(index);
    const size_t list = find_property(rows, {"vertex_indices", "vertex_index"}, true);
    if (list == kNone)
      refuse("has " + what + " without vertices, expected a list vertex_indices or vertex_index");
    const Property& property = rows.properties[list];
    if (!is_integer(property.type))
      refuse("has " + what + " whose property " + property.name +
             " is not a list of integers, expected an integer type");
    return list;
  }

  void find_surfaces() {
    const Element& vertex = element(out_.vertex);
    out_.vertex_colors = find_colors(vertex);
    list_ignored_colors(vertex, out_.vertex_colors, out_.ignored_colors);
    const bool has_textures = !header_.texture_files.empty();
    if (has_textures)
      out_.vertex_texture = find_family<2>(
          vertex, {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}});
    if (out_.face == kNone) return;
    const Element& face = element(out_.face);
    if (out_.vertex_colors.empty()) out_.face_colors = find_colors(face);
    list_ignored_colors(face, out_.face_colors, out_.ignored_colors);
    if (!has_textures) return;
    out_.face_texture = find_property(face, {"texcoord", "texcoords"}, true);
    out_.texture_number = find_property(face, {"texnumber", "texture_number"}, false);
  }

  [[noreturn]] void refuse(const std::string& what) const { voxdag::refuse(path_, what); }

  const Header& header_;
  const std::string& path_;
  Layout out_;
};

}  // namespace

Layout find_layout(const Header& header, const std::string& path) {
  return LayoutFinder(header, path).find();
}

}  // namespace voxdag::ply
