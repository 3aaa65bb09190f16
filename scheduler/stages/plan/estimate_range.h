// A quantity that is estimated, and the range in which it is expected.
#pragma once

namespace voxdag {

struct EstimateRange {
  double low = 0, likely = 0, high = 0;
};

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

}  // namespace voxdag
