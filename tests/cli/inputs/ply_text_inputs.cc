// PLY files as text: tolerant headers and numbers, colors, textures, points.
#include <sstream>

#include "tests/cli/inputs/input.h"
#include "tests/support/image_files.h"

namespace input_files {
namespace {

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kList = "property list uchar int vertex_indices\n";

struct Text {
  std::string comments = "";
  std::string of_vertex = "", vertex_values = "";  // after x, y, z
  std::string of_face = "", face_values = "";      // after the indices
};

std::string faces(const Text& text) {
  std::ostringstream out;
  for (const auto& triangle : band().triangles()) {
    out << 3;
    for (const uint32_t index : triangle) out << ' ' << index;
    out << text.face_values << '\n';
  }
  return out.str();
}

std::string vertices(const Text& text) {
  std::ostringstream out;
  for (const auto& v : band().vertices)
    out << v[0] << ' ' << v[1] << ' ' << v[2] << text.vertex_values << '\n';
  return out.str();
}

std::string head(const Text& text) {
  return "ply\nformat ascii 1.0\n" + text.comments + "element vertex 12\n" + kXyz + text.of_vertex;
}

std::string ply(const Text& text) {
  return head(text) + "element face 8\n" + kList + text.of_face + "end_header\n" + vertices(text) +
         faces(text);
}

std::string properties(const std::string& type, const std::vector<std::string>& names) {
  std::string lines;
  for (const std::string& name : names) lines += "property " + type + " " + name + "\n";
  return lines;
}

// Returns the mesh as a PLY file with triangle strips. With `are_joined`, all strips are in one
// row, separated by the index -1.
std::string strips(const Text& text, bool are_joined, bool with_faces = false) {
  std::string rows;
  size_t entries = 0, count = 0;
  for (const auto& strip : band().strips) {
    std::string row;
    for (const uint32_t index : strip) row += ' ' + std::to_string(index);
    if (are_joined) {
      rows += (rows.empty() ? "" : " -1") + row;
      entries += strip.size() + (entries > 0 ? 1 : 0);
      count = 1;
    } else {
      rows += std::to_string(strip.size()) + row + '\n';
      ++count;
    }
  }
  if (are_joined) rows = std::to_string(entries) + rows + '\n';
  return head(text) + (with_faces ? "element face 8\n" + kList : "") + "element tristrips " +
         std::to_string(count) + "\nproperty list int int vertex_indices\nend_header\n" +
         vertices(text) + (with_faces ? faces(text) : "") + rows;
}

WorldTriangles twice(WorldTriangles triangles) {
  const WorldTriangles once = triangles;
  triangles.insert(triangles.end(), once.begin(), once.end());
  return triangles;
}

// Returns a degenerate triangle for each vertex, because a point sets the same voxels as such a
// triangle.
WorldTriangles points() {
  WorldTriangles all;
  for (const auto& v : band().vertices) {
    const oracle::WorldPoint point{v[0], v[1], v[2]};
    all.push_back({point, point, point});
  }
  return all;
}

std::vector<Input> colored() {
  const std::string bytes = " 200 60 20";
  const auto of_vertices = [](const std::string& type, const std::vector<std::string>& names,
                              const std::string& values) {
    return ply({.of_vertex = properties(type, names), .vertex_values = values});
  };
  const std::vector<std::string> names = {"red", "green", "blue"};
  const Text strip_colors = {.of_vertex = properties("uchar", names), .vertex_values = bytes};
  std::vector<Input> all = {
      {"colors of strips", strips(strip_colors, true), {}},
      {"colors named diffuse",
       of_vertices("uchar", {"diffuse_red", "diffuse_green", "diffuse_blue"}, bytes),
       {}},
      {"colors named r, g, b", of_vertices("uchar", {"r", "g", "b"}, bytes), {}},
      {"colors of faces", ply({.of_face = properties("uchar", names), .face_values = bytes}), {}},
      {"colors as float of 0 to 255", of_vertices("float", names, " 200 60 20.0"), {}},
      {"colors as ushort of 0 to 255", of_vertices("ushort", names, bytes), {}},
  };
  for (Input& input : all) input.color = kRed;
  return all;
}

std::vector<Input> textured() {
  const std::string image = voxdag::test::png_file({}, "\x1e\xa0\x5a\xff");
  const std::string comments = "comment TextureFile tex.png\n";
  std::vector<Input> all = {
      {"texture coordinates of faces",
       ply({.comments = comments,
            .of_face = "property list uchar float texcoord\n",
            .face_values = " 6 0 0 1 0 .5 .5"}),
       {{"tex.png", image}}},
      {"texture coordinates of vertices",
       ply({.comments = comments,
            .of_vertex = properties("float", {"s", "t"}),
            .vertex_values = " .25 .5"}),
       {{"tex.png", image}}},
  };
  for (Input& input : all) input.color = kGreen;
  return all;
}

}  // namespace

std::vector<Input> ply_text_inputs() {
  const std::string plain = ply({});
  const std::string data = plain.substr(plain.find("end_header\n") + 11);
  const std::string format = "format ascii 1.0\n";
  const std::string unused = replaced(plain, "vertex 12", "vertex 13");
  std::vector<Input> all = {
      {"strips with restarts", strips({}, true), {}},
      {"strips in rows", strips({}, false), {}},
      {"strips and faces", strips({}, false, true), {}, twice(band().world())},
      {"comment before format", replaced(plain, format, "comment by hand\n" + format), {}},
      {"end of line CR LF at the end of the header",
       replaced(plain, "end_header\n", "end_header\r\n"),
       {}},
      {"end of line CR LF in the first line", replaced(plain, "ply\n", "ply\r\n"), {}},
      {"blank after ply", replaced(plain, "ply\n", "ply \n"), {}},
      {"blank line before ply", "\n" + plain, {}},
      {"unknown line in the header", replaced(plain, format, format + "Created by hand\n"), {}},
      {"one value per line",
       plain.substr(0, plain.size() - data.size()) + replaced(data, " ", "\n"),
       {}},
      {"NaN of Windows in an unused vertex",
       replaced(unused, "12 13 7\n", "12 13 7\n-1.#IND -1.#IND 1.#QNAN\n"),
       {}},
      {"indices with a point", replaced(plain, "3 0 1 2\n", "3 0.0 1.0 2.\n"), {}},
      {"points alone", head({}) + "end_header\n" + vertices({}), {}, points()},
  };
  for (Input& input : all)
    if (input.name == "unknown line in the header") input.warning = "ignored-line";
  for (const auto& more : {colored(), textured()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace input_files
