#include "cli/terminal/progress_line.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/base/text.h"

namespace voxdag::cli {
namespace {

constexpr double kTerminalInterval_s = 0.1;
constexpr double kPlainInterval_s = 5;
constexpr int kBarWidth = 24;
constexpr size_t kNameWidth = 11;
constexpr const char* kClearLine = "\r\033[K";

// 1234567 -> "1.23 M"
std::string short_count(double count) {
  const char* suffix = "";
  for (const char* larger : {"k", "M", "G", "T"}) {
    if (count < 1000) break;
    count /= 1000;
    suffix = larger;
  }
  char text[32];
  std::snprintf(text, sizeof text, *suffix ? "%.2f %s" : "%.0f%s", count, suffix);
  return text;
}

std::string bar(double part) {
  const auto full = static_cast<size_t>(std::floor(part * kBarWidth));
  return "[" + std::string(full, '#') + std::string(kBarWidth - full, '.') + "] ";
}

std::string percent(double part) {
  char text[16];
  std::snprintf(text, sizeof text, "%3.0f %%  ", 100 * part);
  return text;
}

}  // namespace

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (open_) std::fputs("\n", stderr);
}

double ProgressLine::interval_s() const {
  return terminal_ ? kTerminalInterval_s : kPlainInterval_s;
}

void ProgressLine::show(const StageView& stage, bool ended) {
  if (quiet_) return;
  const auto done = static_cast<double>(stage.done);
  const auto total = static_cast<double>(stage.total);
  const double part = stage.total ? std::min(1.0, done / total) : 0;
  std::string line = terminal_ ? kClearLine : "";
  const size_t begin = line.size();
  line.append(stage.name).append(" ");
  line.resize(std::max(line.size(), begin + kNameWidth), ' ');
  if (terminal_ && stage.total && !ended) line += bar(part);
  if (stage.total && !ended) line += percent(part);
  line += short_count(done) + (stage.total ? " of " + short_count(total) : "");
  line += " " + std::string(stage.unit) + ", " + short_count(stage.rate) + "/s, " +
          duration_text(stage.elapsed_s);
  if (!ended && stage.eta_s > 0) line += ", " + duration_text(stage.eta_s) + " left";
  open_ = terminal_ && !ended;
  if (!open_) line += "\n";
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::warn(std::string_view message) {
  note(std::string("voxdag: warning: ").append(message));
}

void ProgressLine::note(std::string_view text) {
  open_ = false;
  std::fprintf(stderr, "%s%.*s\n", terminal_ ? kClearLine : "", static_cast<int>(text.size()),
               text.data());
}

}  // namespace voxdag::cli
