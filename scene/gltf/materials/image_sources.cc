#include "scene/gltf/materials/image_sources.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/error.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/document/tinygltf.h"
#include "scene/gltf/uri/data_uri.h"
#include "scene/gltf/uri/file_uri.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

void set_file(const ReadableFile& file, FileRange range, ImageSource& out) {
  out.file = {file.path(), file.identity()};
  out.offset = range.begin;
  out.size = range.size;
}

void set_external(FileSystem& files, const std::string& scene_path, const std::string& uri,
                  const std::string& where, ImageSource& out) {
  const auto file = open_uri(files, scene_path, uri, where);
  set_file(*file, {0, file->size()}, out);
}

// Sets the source to the bytes of a buffer view.
void set_buffer(FileSystem& files, const ReadableFile& scene_file, const Document& d,
                const BufferView& view, ImageSource& out) {
  const BufferSource& buffer = d.buffers[static_cast<size_t>(view.buffer)];
  const std::string where = "buffer " + std::to_string(view.buffer);
  switch (buffer.kind) {
    case BufferSource::Kind::kNone:
      out.problem = "is in " + where + ", which is not in the file";
      return;
    case BufferSource::Kind::kDecoded:
      out.problem = "is in compressed geometry";
      return;
    case BufferSource::Kind::kBinChunk:
      set_file(scene_file, buffer.range, out);
      break;
    case BufferSource::Kind::kExternal:
      set_external(files, d.path, buffer.uri, where, out);
      break;
    case BufferSource::Kind::kBase64:
    case BufferSource::Kind::kMemory:
      set_file(scene_file, buffer.range, out);
      out.is_base64 = buffer.is_base64;
      out.is_data_uri = buffer.kind == BufferSource::Kind::kMemory;
      break;
  }
  out.skip = view.byte_offset;
  out.bytes = view.byte_length;
}

void find(FileSystem& files, const ReadableFile& scene_file, const Document& d, int index,
          ImageSource& out) {
  const tinygltf::Image& image = d.model->images[static_cast<size_t>(index)];
  const RawString& uri = d.image_uris[static_cast<size_t>(index)];
  if (is_data_uri(image.uri)) {
    set_file(scene_file, uri.characters, out);
    const auto parsed = parse_data_uri(image.uri);
    if (!parsed) out.problem = "has a data: URI without data, expected a comma";
    out.is_base64 = parsed && parsed->is_base64;
    out.is_data_uri = true;
  } else if (!image.uri.empty()) {
    if (uri.is_clipped)
      out.problem = "has a uri that is longer than any file name";
    else
      set_external(files, d.path, image.uri, "the image", out);
  } else if (image.bufferView < 0) {
    out.problem = "has no valid uri or bufferView";
  } else if (static_cast<size_t>(image.bufferView) >= d.views.size()) {
    out.problem = "is in bufferView " + std::to_string(image.bufferView) + ", which does not exist";
  } else {
    const BufferView& view = d.views[static_cast<size_t>(image.bufferView)];
    if (static_cast<size_t>(view.buffer) >= d.buffers.size())
      out.problem = "is in buffer " + std::to_string(view.buffer) + ", which does not exist";
    else
      set_buffer(files, scene_file, d, view, out);
  }
}

}  // namespace

ImageSource find_image(FileSystem& files, const ReadableFile& scene_file, const Document& document,
                       int index) {
  ImageSource out;
  out.name = document.path + ": image " +
             numbered(index, document.model->images[static_cast<size_t>(index)].name);
  try {
    find(files, scene_file, document, index, out);
  } catch (const Error& error) {
    out.problem = "cannot be opened (" + error.message() + ")";
  }
  return out;
}

}  // namespace voxdag::gltf
