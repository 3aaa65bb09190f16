// The part of a scene file that tinygltf reads: materials, textures and samplers. ModelReader
// collects their text, and tinygltf parses it once. ModelReader itself puts the images into
// tinygltf's model, because tinygltf would load them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scene/gltf/document/document.h"
#include "scene/gltf/json/element_text.h"
#include "scene/gltf/json/json_element.h"

namespace voxdag::gltf {

class ModelReader {
 public:
  ModelReader(const std::string& scene_path, MemoryBudget& budget);

  // Each function appends an element to the JSON text that parse() passes to tinygltf, or to the
  // images. Throws Error{kOutOfMemory} if the model would not fit the budget.
  void add_material(const ElementText& element);
  void add_texture(const ElementText& element);
  void add_sampler(const ElementText& element);
  void add_image(const JsonElement& element);

  // Sets the model of the document and its image_uris. Materials, textures and samplers that
  // tinygltf refuses are left out with a warning. Call it once, after all elements were added.
  void parse(Document& document);

 private:
  // Appends the element to `section`. `bytes` is its size in the array of tinygltf's model.
  void add(std::string& section, const ElementText& element, uint64_t bytes);

  std::string materials_, textures_, samplers_;  // elements with commas between them
  std::shared_ptr<tinygltf::Model> model_;
  std::vector<RawString> image_uris_;
  GrowingCharge model_charge_;
  GrowingCharge parse_charge_;
};

}  // namespace voxdag::gltf
