// Makes JSON schemas (2020-12, as in OpenAPI 3.1) of structs that have a `fields` function.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/fields/json_fields.h"

namespace voxdag {
namespace json_fields {

template <class T>
void write_schema(FieldJson& schema, Members members);

FieldJson integer_schema(const Field& field, bool is_unsigned);
FieldJson line_schema(const Field& field);
// Returns the schema of an array of `count` numbers. If field.is_above_zero, the last number must
// be above 0.
FieldJson numbers_schema(const Field& field, size_t count);

template <class T>
FieldJson value_schema(const Field& field, Members members) {
  FieldJson schema;
  if constexpr (IsOptional<T>::value) {
    return value_schema<typename T::value_type>(field, members);
  } else if constexpr (std::is_same_v<T, bool>) {
    schema["type"] = "boolean";
  } else if constexpr (std::is_integral_v<T>) {
    return integer_schema(field, std::is_unsigned_v<T>);
  } else if constexpr (std::is_floating_point_v<T>) {
    schema["type"] = "number";
    if (field.is_above_zero) schema["exclusiveMinimum"] = 0;
  } else if constexpr (std::is_same_v<T, std::string>) {
    return line_schema(field);
  } else if constexpr (NamedEnum<T>) {
    schema = {{"type", "string"}, {"enum", choices_of<T>()}};
  } else if constexpr (NameSet<T>) {
    schema = {{"type", "array"},
              {"minItems", 1},
              {"maxItems", kMaxNames},
              {"items", {{"type", "string"}, {"enum", NameSetTraits<T>::all()}}}};
  } else if constexpr (IsNumbers<T>::value) {
    return numbers_schema(field, std::tuple_size_v<T>);
  } else if constexpr (IsVector<T>::value) {
    FieldJson item = value_schema<typename T::value_type>(field, members);
    schema = {{"type", "array"}, {"items", item}};
    if (!field.max_items) return schema;
    schema["minItems"] = 1;
    schema["maxItems"] = field.max_items;
    return {{"oneOf", FieldJson::array({item, schema})}};
  } else if constexpr (Described<T>) {
    write_schema<T>(schema, members);
  } else {
    schema["type"] = "object";
  }
  return schema;
}

class SchemaWriter {
 public:
  SchemaWriter(FieldJson& schema, Members members) : schema_(schema), members_(members) {
    schema_ = {
        {"type", "object"}, {"required", FieldJson::array()}, {"properties", FieldJson::object()}};
    if (members_ == Members::kGiven) schema_["additionalProperties"] = false;
  }

  template <class T>
  void operator()(const Field& field, T& value) {
    FieldJson& property = schema_["properties"][field.name];
    property = value_schema<T>(field, members_);
    if (*field.help) property["description"] = documentation(field, value, false);
    if (*field.excluded)
      schema_["not"]["required"] = FieldJson::array({field.excluded, field.name});
    if (members_ == Members::kGiven ? field.is_required
                                    : !IsOptional<T>::value && !field.is_left_if_empty)
      schema_["required"].push_back(field.name);
  }
  void object(const char* name, const auto& visit_members) {
    FieldJson members;
    SchemaWriter writer(members, members_);
    visit_members(writer);
    schema_["properties"][name] = std::move(members);
    if (members_ == Members::kAll) schema_["required"].push_back(name);
  }
  template <class T>
  void derived(const char* name, const T&) {
    schema_["properties"][name] = value_schema<T>(Field(name), members_);
    schema_["required"].push_back(name);
  }

 private:
  FieldJson& schema_;
  const Members members_;
};

template <class T>
void write_schema(FieldJson& schema, Members members) {
  T value{};
  SchemaWriter writer(schema, members);
  fields(writer, value);
}

}  // namespace json_fields

// Returns the schema of a record (json_fields.h). The schema requires all members, except optional
// members and members with omit_empty().
template <class T>
FieldJson record_schema() {
  FieldJson schema;
  json_fields::write_schema<T>(schema, json_fields::Members::kAll);
  return schema;
}

// Returns the schema of options (json_fields.h). The schema requires only the members whose Field
// is required().
template <class T>
FieldJson options_schema() {
  FieldJson schema;
  json_fields::write_schema<T>(schema, json_fields::Members::kGiven);
  return schema;
}

}  // namespace voxdag
