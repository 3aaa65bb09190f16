// Decodes MagicaVoxel's .vox: models of at most 256^3 voxels, and a scene that places the models.
#include <map>
#include <vector>

#include "tests/export/whole/formats.h"

namespace voxdag::test {
namespace {

struct VoxModel {
  std::array<int32_t, 3> size;
  uint64_t voxels = 0;  // offset of the first voxel
  uint32_t count = 0;
};

// A node of the scene graph. A transform node has one child and a place (its translation), a group
// node has children, and a shape node has a model.
struct VoxNode {
  std::array<int64_t, 3> place{};
  std::vector<int32_t> children;
  int32_t model = -1;
};

struct VoxFields {
  const MappedFile& file;
  uint64_t at;

  int32_t number() { return file.get<int32_t>((at += 4) - 4); }
  std::string text() {
    const auto bytes = static_cast<uint64_t>(number());
    at += bytes;
    return file.text(at - bytes, bytes);
  }
  std::map<std::string, std::string> dictionary() {
    std::map<std::string, std::string> entries;
    for (int32_t left = number(); left > 0; --left) {
      const std::string key = text();
      entries[key] = text();
    }
    return entries;
  }
};

class VoxScene {
 public:
  VoxScene(const MappedFile& file, int64_t resolution, Digest& digest)
      : file_(file), resolution_(resolution), digest_(digest) {
    expect(file.text(0, 4) == "VOX " && file.get<int32_t>(4) == 150, "MagicaVoxel's version 150");
    uint64_t at = 20;
    while (at < file.size()) {
      const auto bytes = file.get<uint32_t>(at + 4);
      chunk(file.text(at, 4), at + 12);
      at += 12 + bytes;
    }
    expect(at == file.size() && !models_.empty(), "whole chunks");
    visit(0, {0, 0, 0});
  }

 private:
  void chunk(const std::string& name, uint64_t at) {
    if (name == "SIZE") {
      models_.emplace_back();
      std::memcpy(models_.back().size.data(), file_.at(at, 12), 12);
    } else if (name == "XYZI") {
      models_.back().count = file_.get<uint32_t>(at);
      models_.back().voxels = at + 4;
    } else if (name != "RGBA") {
      VoxFields fields{file_, at};
      const int32_t number = fields.number();
      fields.dictionary();
      nodes_[number] = node(name, fields);
    }
  }
  static VoxNode node(const std::string& name, VoxFields& fields) {
    VoxNode node;
    if (name == "nTRN") {
      node.children = {fields.number()};
      fields.number();
      fields.number();
      expect(fields.number() == 1, "one frame");
      auto frame = fields.dictionary();
      if (frame.contains("_t"))
        expect(std::sscanf(frame["_t"].c_str(), "%ld %ld %ld", &node.place[0], &node.place[1],
                           &node.place[2]) == 3,
               "a translation");
    } else if (name == "nGRP") {
      for (int32_t left = fields.number(); left > 0; --left)
        node.children.push_back(fields.number());
    } else {
      expect(name == "nSHP" && fields.number() == 1, "a shape of one model");
      node.model = fields.number();
    }
    return node;
  }
  void visit(int32_t number, std::array<int64_t, 3> place) const {
    const VoxNode& node = nodes_.at(number);
    for (size_t axis = 0; axis < 3; ++axis) place[axis] += node.place[axis];
    for (const int32_t child : node.children) visit(child, place);
    if (node.model >= 0) show(models_.at(static_cast<size_t>(node.model)), place);
  }
  // Adds a model's voxels. `place` is the position of the model's center, rounded down, relative to
  // the middle of the grid's floor. The z axis of the file is voxdag's y axis, and its y axis is
  // voxdag's -z axis. The file stores a voxel's low corner; because of the reversed axis, this
  // corner is the high corner along voxdag's z axis.
  void show(const VoxModel& model, const std::array<int64_t, 3>& place) const {
    const int64_t middle = resolution_ / 2;
    for (uint64_t i = 0; i < model.count; ++i) {
      std::array<uint8_t, 4> voxel;
      std::memcpy(voxel.data(), file_.at(model.voxels + 4 * i, 4), 4);
      std::array<int64_t, 3> at;
      for (size_t axis = 0; axis < 3; ++axis)
        at[axis] = voxel[axis] + place[axis] - model.size[axis] / 2;
      digest_.add(at[0] + middle, at[2], middle - 1 - at[1]);
    }
  }

  const MappedFile& file_;
  const int64_t resolution_;
  Digest& digest_;
  std::vector<VoxModel> models_;
  std::map<int32_t, VoxNode> nodes_;
};

}  // namespace

void digest_vox(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  const VoxScene scene(file, grid.resolution(), digest);
}

}  // namespace voxdag::test
