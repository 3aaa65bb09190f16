#include "core/fields/json_schema.h"

namespace voxdag::json_fields {
namespace {

// The documented form of a size: whole MiB, at least 64, or whole GiB. A decoder also accepts other
// units. The pattern omits them because it could not check their minimum of 64 MiB.
constexpr const char* kSizePattern =
    "^((6[4-9]|[7-9][0-9]|[1-9][0-9]{2,5})MiB|[1-9][0-9]{0,5}GiB)$";
// The printable characters of core/base/text/printable.h.
constexpr const char* kLinePattern =
    "^[^\\u0000-\\u001f\\u007f-\\u009f\\u061c\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069]+$";

}  // namespace

FieldJson integer_schema(const Field& field, bool is_unsigned) {
  FieldJson schema = {{"type", "integer"}};
  if (field.is_power_of_two) {
    schema["enum"] = FieldJson::array();
    for (int64_t power = *field.min; power <= *field.max; power *= 2)
      schema["enum"].push_back(power);
    return schema;
  }
  if (field.min)
    schema["minimum"] = *field.min;
  else if (is_unsigned)
    schema["minimum"] = 0;
  if (field.max) schema["maximum"] = *field.max;
  if (!field.is_bytes) return schema;
  const FieldJson text = {{"type", "string"}, {"pattern", kSizePattern}};
  return {{"oneOf", FieldJson::array({text, schema})}};
}

FieldJson line_schema(const Field& field) {
  FieldJson schema = {{"type", "string"}};
  if (!field.is_line) return schema;
  schema["minLength"] = *field.min;
  schema["maxLength"] = *field.max;
  schema["pattern"] = kLinePattern;
  return schema;
}

FieldJson numbers_schema(const Field& field, size_t count) {
  FieldJson items = FieldJson::array();
  for (size_t i = 0; i < count; ++i) items.push_back({{"type", "number"}});
  if (field.is_above_zero) items.back()["exclusiveMinimum"] = 0;
  // maxItems forbids further items, so `items` could be `false`. But generators of client libraries
  // do not accept this, and need the type of the items.
  return {{"type", "array"},
          {"minItems", count},
          {"maxItems", count},
          {"prefixItems", items},
          {"items", {{"type", "number"}}}};
}

}  // namespace voxdag::json_fields
