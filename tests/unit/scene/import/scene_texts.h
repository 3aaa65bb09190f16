// Small scenes in the formats that voxdag import reads.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace voxdag::test {

// An OFF file with a concave quadrilateral and a triangle.
inline const std::string kOff =
    "OFF\n5 2 0\n0 0 0\n4 1 0\n0 2 0\n1 1 0\n4 4 9\n4 0 1 2 3\n3 0 1 4\n";

inline std::string instance() {
  return R"(<instance_geometry url="#g"><bind_material><technique_common>
    <instance_material symbol="mat" target="#m"><bind_vertex_input semantic="UVSET0" input_semantic="TEXCOORD" input_set="0"/></instance_material>
  </technique_common></bind_material></instance_geometry>)";
}

// A COLLADA file with one triangle, which the node `outer` and its child `inner` draw. The inner
// node is moved by (0 10 0), the outer node is scaled by 2. `extra` is the XML of more libraries,
// and `effect` the XML of the material's diffuse color.
inline std::string collada(const std::string& effect, const std::string& extra = "") {
  return R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Y_UP</up_axis></asset>)" +
         extra + R"(
<library_effects><effect id="e"><profile_COMMON>
  <newparam sid="surface"><surface type="2D"><init_from>image</init_from></surface></newparam>
  <newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>
  <technique sid="common"><lambert><diffuse>)" +
         effect + R"(</diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="paint"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g" name="shape"><mesh>
  <source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
    <accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <source id="t"><float_array id="ta" count="6">0 0 1 0 0 0.25</float_array><technique_common>
    <accessor source="#ta" count="3" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="1" material="mat"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="TEXCOORD" source="#t" offset="1" set="0"/><p>0 0 1 1 2 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
  <node name="outer"><scale>2 2 2</scale>)" +
         instance() + R"(<node name="inner"><translate>0 10 0</translate>)" + instance() +
         R"(</node></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

// An ASCII FBX file in units of half a meter, with the z axis upward: a concave quadrilateral,
// moved by (10 0 0).
inline const std::string kFbx = R"(; FBX 7.4.0 project file
FBXHeaderExtension:  {
  FBXVersion: 7400
}
GlobalSettings:  {
  Properties70:  {
    P: "UpAxis", "int", "Integer", "",2
    P: "UpAxisSign", "int", "Integer", "",1
    P: "FrontAxis", "int", "Integer", "",1
    P: "FrontAxisSign", "int", "Integer", "",-1
    P: "CoordAxis", "int", "Integer", "",0
    P: "CoordAxisSign", "int", "Integer", "",1
    P: "UnitScaleFactor", "double", "Number", "",50
  }
}
Objects:  {
  Geometry: 1001, "Geometry::arrow", "Mesh" {
    Vertices: *12 {
      a: 0,0,0,4,1,0,0,2,0,1,1,0
    }
    PolygonVertexIndex: *4 {
      a: 0,1,2,-4
    }
    LayerElementMaterial: 0 {
      MappingInformationType: "AllSame"
      ReferenceInformationType: "IndexToDirect"
      Materials: *1 {
        a: 0
      }
    }
    Layer: 0 {
      LayerElement:  {
        Type: "LayerElementMaterial"
        TypedIndex: 0
      }
    }
  }
  Model: 1002, "Model::part", "Mesh" {
    Properties70:  {
      P: "Lcl Translation", "Lcl Translation", "", "A",10,0,0
    }
  }
  Material: 1003, "Material::paint", "" {
    ShadingModel: "lambert"
    Properties70:  {
      P: "DiffuseColor", "Color", "", "A",0,1,0
    }
  }
}
Connections:  {
  C: "OO",1002,0
  C: "OO",1001,1002
  C: "OO",1003,1002
}
)";

// A chunk of a 3DS file.
inline std::string chunk(uint16_t id, const std::string& contents) {
  const auto bytes = [](auto value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof value);
  };
  return bytes(id) + bytes(static_cast<uint32_t>(6 + contents.size())) + contents;
}

// A 3DS file with one triangle of a red material.
inline std::string max_3ds() {
  const float xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const uint16_t vertices = 3, faces[] = {1, 0, 1, 2, 7};
  const auto raw = [](const auto& value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const std::string material =
      chunk(0xafff, chunk(0xa000, std::string("red\0", 4)) +
                        chunk(0xa020, chunk(0x0011, std::string("\xff\0\0", 3))));
  const std::string mesh =
      chunk(0x4110, raw(vertices) + raw(xyz)) +
      chunk(0x4120, raw(faces) + chunk(0x4130, std::string("red\0\1\0\0\0", 8)));
  return chunk(0x4d4d, chunk(0x3d3d, material + chunk(0x4000, std::string("box\0", 4) +
                                                                  chunk(0x4100, mesh))));
}

// Returns a zip archive whose files are not compressed.
inline std::string zip_archive(const std::vector<std::pair<std::string, std::string>>& files) {
  const auto u16 = [](size_t value) {
    return std::string{static_cast<char>(value), static_cast<char>(value >> 8)};
  };
  const auto u32 = [&](size_t value) { return u16(value) + u16(value >> 16); };
  std::string archive, directory;
  for (const auto& [name, contents] : files) {
    const auto crc = crc32(0, reinterpret_cast<const Bytef*>(contents.data()),
                           static_cast<uInt>(contents.size()));
    // Version 2.0, no flags, method "stored", no time, date 1980-01-01.
    const std::string common = u16(20) + u32(0) + u16(0) + u16(33) + u32(crc) +
                               u32(contents.size()) + u32(contents.size()) + u16(name.size()) +
                               u16(0);
    directory += "PK\1\2" + u16(20) + common + u16(0) + u16(0) + u16(0) + u32(0) +
                 u32(archive.size()) + name;
    archive += "PK\3\4" + common + name + contents;
  }
  return archive + directory + "PK\5\6" + u32(0) + u16(files.size()) + u16(files.size()) +
         u32(directory.size()) + u32(archive.size()) + u16(0);
}

// A 3MF file with two red triangles, moved by (10 0 0).
inline std::string three_mf() {
  const std::string types = R"(<?xml version="1.0"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>)";
  const std::string relations = R"(<?xml version="1.0"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="rel0"
 Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>)";
  const std::string model = R"(<?xml version="1.0"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>
<basematerials id="1"><base name="paint" displaycolor="#FF0000FF"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh>
<vertices><vertex x="0" y="0" z="0"/><vertex x="4" y="1" z="0"/><vertex x="0" y="2" z="0"/>
<vertex x="1" y="1" z="3"/></vertices>
<triangles><triangle v1="0" v2="1" v3="2"/><triangle v1="0" v2="1" v3="3"/></triangles>
</mesh></object>
</resources>
<build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 10 0 0"/></build>
</model>)";
  return zip_archive(
      {{"[Content_Types].xml", types}, {"_rels/.rels", relations}, {"3D/3dmodel.model", model}});
}

}  // namespace voxdag::test
