// Arithmetic and JSON of estimates. An estimate has a low, a likely and a high number.
#pragma once

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "voxdag/build.h"

namespace voxdag {

inline EstimateRange exactly(double value) { return {value, value, value}; }
inline EstimateRange within(double value, double factor) {
  return {value / factor, value, value * factor};
}
inline EstimateRange operator+(const EstimateRange& a, const EstimateRange& b) {
  return {a.low + b.low, a.likely + b.likely, a.high + b.high};
}
inline EstimateRange operator*(double factor, const EstimateRange& a) {
  return {factor * a.low, factor * a.likely, factor * a.high};
}

inline nlohmann::ordered_json range_json(const EstimateRange& r) {
  return {{"low", r.low}, {"likely", r.likely}, {"high", r.high}};
}
// Returns the JSON of an estimated number (of bytes, nodes, ...), rounded down to whole numbers.
inline nlohmann::ordered_json count_json(const EstimateRange& r) {
  const auto whole = [](double count) { return static_cast<uint64_t>(std::min(count, 0x1p63)); };
  return {{"low", whole(r.low)}, {"likely", whole(r.likely)}, {"high", whole(r.high)}};
}

}  // namespace voxdag
