#include "scene/import/import.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/io/overwrite.h"
#include "scene/glb_file.h"
#include "scene/import/confined_process.h"
#include "scene/import/glb_export.h"

namespace voxdag {
namespace {

using nlohmann::json;

// Converts the file. Runs in the child process.
void convert(FileSystem& files, const std::string& input, const std::string& output,
             uint64_t memory_bytes, const SendMessage& send) {
  WarningList warnings;
  size_t sent = 0;
  const auto send_warnings = [&] {
    for (; sent < warnings.list().size(); ++sent) {
      const Warning& warning = warnings.list()[sent];
      send({{"warning", warning.code},
            {"place", warning.place},
            {"text", warning.message},
            {"count", warning.count}});
    }
  };
  const AssimpScene scene(input);
  warnings.add(scene.losses().list());
  GlbExport glb(scene, files, warnings);
  std::vector<std::string> inputs = glb.image_files();
  inputs.insert(inputs.end(), scene.opened().begin(), scene.opened().end());
  const std::string outputs[] = {output, output + ".partial"};
  refuse_inputs(files, outputs, inputs);
  send_warnings();
  send({{"triangles", glb.report().triangles}});
  MemoryBudget budget(memory_bytes);
  glb.write(output, budget, [&](uint64_t triangles) { send({{"written", triangles}}); });
  send_warnings();
  const ImportReport& report = glb.report();
  send({{"report",
         {report.triangles, report.meshes, report.nodes, report.materials, report.images,
          report.bytes}}});
}

// Receives the messages of the child process in the parent process, and forwards warnings and
// progress.
class Receiver {
 public:
  // `bytes` is the size of the scene file.
  Receiver(uint64_t bytes, const std::function<void(const Warning&)>& warn, Progress& progress)
      : bytes_(bytes), warn_(warn), progress_(progress) {
    progress_.begin_stage("read", bytes, "bytes");
  }

  void operator()(const json& message) {
    if (message.contains("warning")) {
      warn_({message["warning"], message["place"], message["text"], message["count"]});
    } else if (message.contains("triangles")) {
      is_writing = true;
      progress_.advance(bytes_);
      progress_.end_stage();
      progress_.begin_stage("write", message["triangles"], "triangles");
    } else if (message.contains("written")) {
      progress_.advance(message["written"]);
    } else if (message.contains("report")) {
      const auto& numbers = message["report"];
      report = {numbers.at(0), numbers.at(1), numbers.at(2),
                numbers.at(3), numbers.at(4), numbers.at(5)};
    }
  }

  ImportReport report;
  bool is_writing = false;  // the child may have changed the output

 private:
  const uint64_t bytes_;
  const std::function<void(const Warning&)>& warn_;
  Progress& progress_;
};

}  // namespace

ImportReport import_scene(FileSystem& files, const std::string& input, const std::string& output,
                          uint64_t memory_bytes, const std::function<void(const Warning&)>& warn,
                          Progress& progress, const CancelToken& cancel) {
  const uint64_t input_bytes = files.open_read(input)->size();
  const std::string partial = output + ".partial";
  // An existing file is kept until the child has found out that the scene does not consist of it.
  const bool is_new = !files.exists(partial);
  if (is_new) files.create(partial)->close();  // so that the child may replace this file
  Receiver receiver(input_bytes, warn, progress);
  try {
    run_confined(
        input, memory_bytes,
        [&](const SendMessage& send) { convert(files, input, output, memory_bytes, send); },
        [&](const json& message) { receiver(message); }, cancel);
    files.rename(partial, output);
    files.sync_directory(parent_directory(output));
    progress.end_stage();
    return receiver.report;
  } catch (...) {
    if ((is_new || receiver.is_writing) && files.exists(partial)) files.remove(partial);
    throw;
  }
}

bool is_imported_scene(const ReadableFile& file) { return is_glb_of(file, GlbExport::kGenerator); }

}  // namespace voxdag
