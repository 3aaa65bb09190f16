// Writes the first inputs of the fuzz targets to a folder:
//
//     fuzz_make_corpus tests/fuzz/corpus
//
// Run it again when a format gets a new version. Inputs that fuzzers found are committed in the
// same folders; their names are hashes.
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "merge/checkpoint/merge_state.h"
#include "query/package/gzip_block.h"
#include "query/package/package_index.h"
#include "query/package/write_package.h"
#include "query/reorder/reorder.h"
#include "scheduler/state/checkpoint/ingest_record.h"
#include "tests/fuzz/scene/compressed_scenes.h"
#include "tests/fuzz/scene/rich_scene.h"
#include "tests/support/image_files.h"
#include "tests/support/modern_image_files.h"
#include "tests/unit/core/format/color/valued_files.h"
#include "tests/unit/core/format/test_artifacts.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag::test {
namespace {

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class Corpus {
 public:
  explicit Corpus(std::filesystem::path root) : root_(std::move(root)) {}
  void add(const std::string& target, const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories(root_ / target);
    write_bytes((root_ / target / name).string(), bytes);
  }
  // Returns the bytes of an input that was added.
  std::string read(const std::string& target, const std::string& name) const {
    return read_bytes((root_ / target / name).string());
  }

 private:
  const std::filesystem::path root_;
};

void add_scenes(const Corpus& corpus) {
  const SceneBuilder rich = rich_scene();
  corpus.add("gltf_document", "triangle.glb", one_triangle().glb());
  corpus.add("gltf_document", "rich.glb", rich.glb());
  corpus.add("gltf_document", "rich.gltf",
             rich.gltf("data:application/octet-stream;base64," + base64(rich.bin)));
  corpus.add("gltf_document", "empty.gltf", R"({"asset":{"version":"2.0"}})");
  for (const auto& [name, file] : compressed_scenes()) corpus.add("gltf_document", name, file);
}

void add_text_scenes(const Corpus& corpus) {
  corpus.add("obj_file", "faces",
             "vt 0.5 1\nvn 0 0 1\ng a\nf 1 2 3\nf 1/1 2/2 3/1\nf 1//1 2//1 3//1\n"
             "f -3/-1/1 -2/-2/1 -1/-1/1 1\n");
  corpus.add("obj_file", "lines", "# a\\\r\nl 1 2\rp 1\nf 1 2 \\\n 3 # b\nusemtl a\nv 1 2");
  corpus.add("obj_file", "materials",
             "newmtl a\nKd 0.5 1 0\nd 0.5\nmap_Kd -s 2 2 -clamp on a.png\nmap_d a.png\n"
             "newmtl b\nTr 1\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 2 3\n");
  corpus.add("obj_file", "free_form", "vp 0 1\ncstype bspline\ndeg 3\ncurv 0 1 1 2 3\nend\n");
  const std::string facet =
      "outer loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\n";
  corpus.add("stl_file", "ascii", '\0' + facet + "endsolid a\nsolid b\n" + facet);
  corpus.add("stl_file", "ascii_square",
             std::string(1, '\0') +
                 "OUTER LOOP\nvertex 0 0\n0 vertex 1 0 0\nvertex 1 1 0\n"
                 "vertex 0 1 0\nENDLOOP\ncolor 1 0 0\nENDFACET\n");
  std::string facets;
  for (int i = 0; i < 2; ++i) {
    const float numbers[] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};
    facets += text_of(std::as_bytes(std::span(numbers))) + "\x1f\x80";
  }
  const std::string header = "COLOR=" + std::string(74, '\xff');
  corpus.add("stl_file", "binary", '\1' + header + little_endian(2) + facets);
  corpus.add("stl_file", "trailing_bytes", '\2' + header + little_endian(1) + facets);
}

// Adds the index of an artifact without the rest of the file to the corpus of artifact_index. Adds
// frames to the corpus of artifact_frame, each after the five bytes that this target expects (see
// targets/artifact_frame.cc).
void add_artifacts(const Corpus& corpus) {
  TemporaryFolder folder;
  constexpr uint32_t kGridLevels = 6, kHashBits = 64;
  MemoryBudget budget(uint64_t{64} << 20);
  SegmentWriter segment(system_files(), folder.path(), 1, budget);
  const SubDag dag = random_rows(1, 24, kGridLevels, 2, kHashBits);
  ArtifactRoot root;
  root.cube.level = kGridLevels - 4;
  root.hash = dag.levels.back().hashes[0];
  root.voxels = root.svo_nodes = 1;
  const ArtifactRef ref = write_artifact(segment, dag, kGridLevels, kHashBits, std::span(&root, 1));
  const std::string file = read_bytes(segment_path(folder.path(), 1));
  corpus.add("artifact_index", "two_levels", file.substr(ref.index_offset));

  const auto prefix = [](bool bricks, size_t rows, size_t children) {
    const size_t r = rows - 1, c = children - rows;
    std::string bytes(5, '\0');
    bytes[0] = static_cast<char>((bricks ? 1 : 0) | (kHashBits - 4) << 1);
    bytes[1] = static_cast<char>(r);
    bytes[2] = static_cast<char>(r >> 8);
    bytes[3] = static_cast<char>(c);
    bytes[4] = static_cast<char>(c >> 8);
    return bytes;
  };
  for (const size_t rows : {size_t{24}, size_t{600}}) {
    const SubDag level = random_rows(2, rows, kGridLevels, 1, kHashBits);
    const NodeLevelView nodes = level.levels[0].view();
    FrameEncoder encoder;
    const std::string name = std::to_string(rows);
    corpus.add("artifact_frame", "bricks_" + name,
               prefix(true, level.brick_masks.size(), level.brick_masks.size()) +
                   text_of(encoder.encode_bricks(level.brick_masks)));
    corpus.add("artifact_frame", "nodes_" + name,
               prefix(false, nodes.masks.size(), nodes.children.size()) +
                   text_of(encoder.encode_nodes(nodes)));
  }
}

// Returns the input that stands for a global file (support/global_bytes.h): the first
// `header_bytes` bytes of the header page, then all bytes between this page and the checksum table.
std::string global_input(const std::string& path, size_t header_bytes) {
  const std::string file = read_bytes(path);
  uint64_t table_at = 0;
  std::memcpy(&table_at, file.data() + global_layout::kTableOffsetAt, sizeof table_at);
  const size_t page = global_layout::kPageBytes;
  return file.substr(0, header_bytes) + file.substr(page, table_at - page);
}

// Adds a global file to the inputs of global_file, and its copy in the order by first parent to the
// inputs of reordered_file.
void add_global_file(const Corpus& corpus, const std::string& name, const std::string& path,
                     size_t header_bytes) {
  corpus.add("global_file", name, global_input(path, header_bytes));
  const auto file = open_global_file(path);
  bool is_wide = false;
  for (uint32_t l = 0; l <= file->brick_level(); ++l) is_wide |= file->level(l).pointer_bits == 64;
  query::ReorderSpec spec;
  spec.output = path + ".first_parent";
  if (is_wide) spec.narrow_words = 2;
  NoProgress progress;
  query::reorder(*file, spec, system_files(), progress, CancelToken());
  corpus.add("reordered_file", name, global_input(spec.output, header_bytes));
}

// Adds pairs of inputs of the target global_file.
void add_combined_files(const Corpus& corpus) {
  struct Input {
    const char* name;
    std::string options;  // the operation and options, and three coordinates of the offset
    const char *a, *b;
  };
  for (const auto& [name, options, a, b] :
       {Input{"union", std::string("\x00\0\0\0", 4), "16", "colored_16"},
        Input{"minus", std::string("\x45\3\0\xfe", 4), "16", "16"},
        Input{"and", std::string("\x46\1\1\1", 4), "64", "16"},
        Input{"xor", std::string("\x0f\xf0\3\2", 4), "16", "64"},
        Input{"wide", std::string("\x44\0\1\0", 4), "wide_16", "wide_16"},
        Input{"colors", std::string("\x0c\4\0\1", 4), "colored_16", "colored_16"},
        Input{"moved_colors", std::string("\x4c\0\4\0", 4), "colored_16", "colored_64"},
        Input{"fill_color", std::string("\x24\1\2\3", 4), "4", "colored_4"},
        Input{"values", std::string("\x0c\1\0\0", 4), "valued_8", "valued_8"},
        Input{"minus_colors", std::string("\x0d\1\1\0", 4), "colored_two_tiers", "valued_8"}}) {
    const std::string first = corpus.read("global_file", a);
    corpus.add("combined_files", name,
               options + little_endian(static_cast<uint32_t>(first.size())) + first +
                   corpus.read("global_file", b));
  }
}

// Adds files without attributes. The header part of an input ends before the attribute table.
void add_global_files(const Corpus& corpus) {
  TemporaryFolder folder;
  struct Input {
    const char* name;
    int edge;
    uint64_t narrow_words;
  };
  constexpr uint64_t kNever = uint64_t{1} << 32;
  for (const auto& [name, edge, narrow_words] :
       {Input{"4", 4, kNever}, Input{"16", 16, kNever}, Input{"64", 64, kNever},
        Input{"wide_16", 16, 2}, Input{"wide_64", 64, 2}}) {
    const std::string path = folder.path() + "/" + name + ".vdag";
    write_global(path, oracle::build_dag(random_voxels(1, edge), 64), grid_of(edge), 64,
                 narrow_words);
    add_global_file(corpus, name, path, global_layout::kAttributesAt);
  }
}

// Adds files with attributes. The header part of an input ends after the attribute table.
void add_colored_files(const Corpus& corpus) {
  TemporaryFolder folder;
  struct Input {
    const char* name;
    uint32_t levels, color_levels;
    int lines;
    uint64_t narrow_words;
  };
  constexpr uint64_t kNever = uint64_t{1} << 32;
  for (const auto& [name, levels, color_levels, lines, narrow_words] :
       {Input{"colored_4", 2, 2, 3, kNever}, Input{"colored_16", 4, 3, 8, kNever},
        Input{"colored_64", 6, 6, 4, kNever}, Input{"colored_wide_32", 5, 5, 9, 2},
        Input{"colored_two_tiers", 7, 7, 2, kNever}}) {
    const std::string path = folder.path() + "/" + name;
    write_colored(path,
                  {levels, color_levels, random_codes(levels, levels, lines * 10),
                   smooth_colors(color_levels, 9)},
                  true, narrow_words);
    add_global_file(corpus, name, path, global_layout::kFeaturesAt);
  }
  for (const uint32_t levels : {3u, 7u}) {
    const std::string name = "valued_" + std::to_string(1 << levels),
                      path = folder.path() + "/" + name;
    write_valued(
        path, {levels, levels, random_codes(levels, levels, 30), smooth_colors(levels, 9)},
        levels == 3 ? AttributeSet::all() : AttributeSet::all().without(Attribute::kColor));
    add_global_file(corpus, name, path, global_layout::kFeaturesAt);
  }
}

// Returns a section of a complete package: the bytes after their size.
std::string section_of(const std::string& bytes) {
  const auto size = static_cast<uint32_t>(bytes.size());
  return std::string(reinterpret_cast<const char*>(&size), sizeof size) + bytes;
}

// Adds the package in `folder`, its index, and the last block of each of its bands.
void add_package(const Corpus& corpus, const std::string& name, const std::string& folder,
                 uint32_t grid_levels) {
  constexpr size_t kMaxBytes = size_t{1} << 20;
  const std::string text = read_bytes(folder + "/package.json");
  const query::PackageIndex index = query::parse_index(text, folder);
  const std::string page =
      query::gunzip_block(read_bytes(folder + "/" + index.directory.name), kMaxBytes);
  std::string packs, complete = section_of(text) + section_of(page);
  for (const query::PackageFile& pack : index.packs) packs += read_bytes(folder + "/" + pack.name);
  const std::string head =
      index.head.name.empty() ? "" : read_bytes(folder + "/" + index.head.name);
  size_t head_offset = 0;
  for (const uint16_t size : index.head.lengths) {
    complete += section_of(query::gunzip_block(head.substr(head_offset, size), kMaxBytes));
    head_offset += size;
  }
  size_t block = 0, offset = 0;
  for (const query::PackageBand& band : index.bands) {
    std::string plain;
    if (band.pack_blocks() == 0) continue;
    for (uint64_t i = 0; i < band.pack_blocks(); ++i, ++block) {
      uint16_t size = 0;
      std::memcpy(&size, page.data() + sizeof size * block, sizeof size);
      const std::string packed = packs.substr(offset, size);
      if (block == 0) corpus.add("package", name + "_gzip", "\x03" + packed);
      plain = query::gunzip_block(packed, kMaxBytes);
      complete += section_of(plain);
      offset += size;
    }
    const std::string numbers = {static_cast<char>(grid_levels - 3), static_cast<char>(band.level),
                                 static_cast<char>((band.items - 1) % query::kBlockTiles)};
    corpus.add("package",
               name + (band.is_color ? "_colors_" : "_tiles_") + std::to_string(band.level),
               band.is_color ? "\x02" + plain : "\x01" + numbers + plain);
  }
  corpus.add("package", name + "_index", std::string(1, '\0') + text);
  corpus.add("package", name, "\x04" + complete);
}

void add_packages(const Corpus& corpus) {
  TemporaryFolder folder;
  for (const auto& [name, levels, has_head] :
       {std::tuple{"16", 4u, false}, {"64", 6u, false}, {"64_head", 6u, true}}) {
    const std::string path = folder.file(name);
    write_colored(path + ".vdag",
                  {levels, levels, random_codes(levels, levels, 30), smooth_colors(levels, 9)},
                  true);
    const auto file = open_global_file(path + ".vdag");
    query::PackageSpec spec;
    spec.output = path;
    spec.manifest = "{\"levels\":" + std::to_string(levels) + ",\"tile_levels\":2}";
    if (has_head) spec.camera = query::Placement{{{90, 70, 120}}, {{32, 32, 32}}, 35};
    NoProgress progress;
    query::write_package(*file, spec, {}, system_files(), progress, CancelToken());
    add_package(corpus, name, path, levels);
  }
}

void add_records(const Corpus& corpus) {
  const auto without_checksum = [](const std::vector<std::byte>& bytes) {
    return text_of(std::span(bytes).first(bytes.size() - sizeof(uint64_t)));
  };
  MergeState state;
  state.inputs_checksum = 7;
  state.intermediates = {{.segment = 1, .offset = 32, .bytes = 64}};
  corpus.add("merge_state", "pass", without_checksum(encode_state(state)));
  FinalPassState& pass = state.final_pass.emplace();
  pass.level = 3;
  pass.output = "out.vdag";
  pass.file.levels = {{4, 20}};
  pass.file.checksums = {1, 2};
  pass.map_rows = {5};
  pass.placed = {{}};
  pass.roots = {{}};
  corpus.add("merge_state", "final_pass", without_checksum(encode_state(state)));

  IngestRecord record;
  record.request = R"({"resolution":1024})";
  record.files = {{"scene.glb", {1, 2, 3, 4}}};
  record.state.digest = ContentDigest(grid_of(64));
  corpus.add("ingest_record", "one_file", without_checksum(encode(record)));
}

// Adds small images of every format that voxdag reads, and the first bytes of unsupported formats.
void add_images(const Corpus& corpus) {
  std::string pixels;
  for (size_t i = 0; i < size_t{16} * 12 * 8; ++i) pixels += static_cast<char>(i * i / 7 % 251);
  const auto png = [&](const std::string& name, const PngFormat& format, size_t bytes) {
    corpus.add("image_file", name + ".png", png_file(format, pixels.substr(0, bytes)));
  };
  const std::string palette =
      png_chunk("PLTE", pixels.substr(0, 12)) + png_chunk("tRNS", "\x10\x7f");
  png("rgba", {16, 12, 8, 6, ""}, 16 * 12 * 4);
  png("rgb_16_interlaced", {9, 11, 16, 2, "", true}, 9 * 11 * 6);
  png("gray_1", {16, 12, 1, 0, png_chunk("tRNS", std::string("\0\1", 2))}, 2 * 12);
  png("gray_alpha", {7, 5, 8, 4, png_chunk("gAMA", big_endian(45455))}, 7 * 5 * 2);
  png("palette_2", {16, 12, 2, 3, palette}, 4 * 12);
  png("palette_8_interlaced", {5, 4, 8, 3, palette, true}, 5 * 4);
  const auto jpeg = [&](const std::string& name, int components, bool is_progressive) {
    corpus.add(
        "image_file", name + ".jpg",
        jpeg_file(24, 17, components, pixels.substr(0, 24 * 17 * 3) + pixels, is_progressive));
  };
  jpeg("gray", 1, false);
  jpeg("color", 3, false);
  jpeg("color_progressive", 3, true);
  jpeg("cmyk", 4, false);
  corpus.add("image_file", "webp", std::string("RIFF\x24\0\0\0WEBPVP8 ", 16));
#ifdef VOXDAG_HAS_WEBP
  for (const bool is_lossless : {false, true})
    corpus.add("image_file", is_lossless ? "lossless.webp" : "lossy.webp",
               webp_file(20, 16, pixels.substr(0, 4 * 20 * 16), is_lossless));
#endif
#ifdef VOXDAG_HAS_AVIF
  for (const int chroma : {420, 444})
    corpus.add("image_file", "chroma_" + std::to_string(chroma) + ".avif",
               avif_file({.width = 20, .height = 16, .chroma = chroma, .matrix = 6},
                         pixels.substr(0, 4 * 20 * 16)));
#endif
  corpus.add("image_file", "ktx2", "\xabKTX 20\xbb\r\n\x1a\n");
}

void add_requests(const Corpus& corpus) {
  corpus.add(
      "job_request", "all_options",
      R"({"scene":["a.glb","b.glb"],"resolution":1024,"name":"all","priority":-3,"options":{)"
      R"("bounds":[0,0,0,1.5],"skip_invalid":true,"hash_bits":64,"memory":"2GiB","threads":2,)"
      R"("subvolume":256,"backend":"cpu","method":"consing"}})");
  corpus.add("job_request", "one_scene", R"({"scene":"a.glb","resolution":4})");
  corpus.add("job_request", "voxel_size",
             R"({"scene":"a.glb","resolution":64,"options":{"voxel_size":0.5,"memory":1e9}})");
  const std::string host = "Host: localhost\r\n";
  corpus.add("http_request", "get", "GET /api/v1/jobs?limit=2 HTTP/1.1\r\n" + host + "\r\n");
  corpus.add("http_request", "pipelined",
             "GET / HTTP/1.1\r\n" + host + "\r\nHEAD /a%20b HTTP/1.1\r\n" + host +
                 "Range: bytes=0-1\r\nConnection: close\r\n\r\n");
  corpus.add("http_request", "post",
             "POST /x HTTP/1.1\r\n" + host + "Content-Length: 5\r\n\r\nhello");
  corpus.add("http_request", "chunked",
             "PUT /x HTTP/1.1\r\n" + host +
                 "Transfer-Encoding: chunked\r\n\r\n5;a=b\r\nhello\r\n0\r\nTrailer: 1\r\n\r\n");
  corpus.add("http_request", "expect",
             "PUT /x HTTP/1.1\r\n" + host + "Expect: 100-continue\r\nContent-Length: 2\r\n\r\nab");
}

}  // namespace
}  // namespace voxdag::test

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  const voxdag::test::Corpus corpus(argv[1]);
  voxdag::test::add_scenes(corpus);
  voxdag::test::add_text_scenes(corpus);
  voxdag::test::add_artifacts(corpus);
  voxdag::test::add_global_files(corpus);
  voxdag::test::add_colored_files(corpus);
  voxdag::test::add_combined_files(corpus);
  voxdag::test::add_packages(corpus);
  voxdag::test::add_records(corpus);
  voxdag::test::add_images(corpus);
  voxdag::test::add_requests(corpus);
  return 0;
}
