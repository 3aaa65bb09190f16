// The part of a scene file that tinygltf reads: asset, extensions, materials, textures and
// samplers. The elements are collected as text, which tinygltf parses once. ModelReader itself puts
// the images into tinygltf's model, because tinygltf would load them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scene/gltf/document/document.h"
#include "scene/gltf/json/json_element.h"

namespace voxdag::gltf {

class ModelReader {
 public:
  ModelReader(const std::string& scene_path, MemoryBudget& budget);

  // Adds an element of a top-level section (asset, materials, ...) to the JSON text that parse()
  // passes to tinygltf. Throws Violation if the asset's version or minVersion, or the name of an
  // extension, is not a string. Throws Error{kOutOfMemory} if the model would not fit the budget.
  void add(const JsonElement& element);
  void add_image(const JsonElement& element);

  // Sets the model of the document and its image_uris. Materials, textures and samplers that
  // tinygltf refuses are left out with a warning. Call it once, after all elements were added.
  void parse(Document& document);

 private:
  std::string text_ = "{";
  std::string section_;           // last section in text_
  bool section_is_open_ = false;  // the section's array needs a closing bracket
  std::shared_ptr<tinygltf::Model> model_;
  std::vector<RawString> image_uris_;
  GrowingCharge model_charge_;
  GrowingCharge parse_charge_;
};

}  // namespace voxdag::gltf
