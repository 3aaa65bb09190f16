#include "server/site/single_page.h"

#include <span>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/io/outputs/temporary_work.h"
#include "query/dag/locked_outputs.h"
#include "query/package/package_reader.h"
#include "server/site/base64.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxPageFileBytes = uint64_t{1} << 30;

// Writes a text file in several parts. finish() returns the size of the file.
class TextWriter {
 public:
  TextWriter(FileSystem& files, const std::string& path) : out_(files.create(path)) {}
  void add(std::string_view text) {
    out_->write_at(bytes_, std::as_bytes(std::span(text.data(), text.size())));
    bytes_ += text.size();
  }
  uint64_t finish() {
    out_->sync();
    out_->close();
    return bytes_;
  }

 private:
  const std::unique_ptr<WritableFile> out_;
  uint64_t bytes_ = 0;
};

// Writes the page to `path`: the page of the viewer, into which the files of the package in the
// folder `package` are inserted as base64. Returns the size of the page.
uint64_t write_page(const std::string& package, const PageContents& contents,
                    const std::string& path, FileSystem& files, const CancelToken& cancel) {
  const query::PackageIndex index = query::PackageReader(files, package).index();
  std::vector<std::string> names = {query::kIndexName, index.directory.name};
  if (!index.head.name.empty()) names.push_back(index.head.name);
  for (const query::PackageFile& pack : index.packs) names.push_back(pack.name);
  const std::string page = page_with_module(contents), end = "</body>";
  const size_t data = page.rfind(end);
  TextWriter out(files, path);
  out.add(page.substr(0, data));
  for (const std::string& name : names) {
    cancel.check();
    out.add("<script type=\"text/plain\" data-file=\"" + name + "\">");
    out.add(base64_of(read_small_file(files, package + "/" + name, kMaxPageFileBytes)));
    out.add("</script>\n");
  }
  out.add(page.substr(data));
  return out.finish();
}

}  // namespace

query::PackageReport write_single_page(const voxdag_reader::File& file, query::PackageSpec spec,
                                       const std::function<PageContents()>& make_contents,
                                       bool replace, FileSystem& files, Progress& progress,
                                       const CancelToken& cancel) {
  const std::string output = spec.output, partial = output + ".partial";
  query::LockedOutputs outputs(files, {{output}, {file.path()}, replace});
  const TemporaryWork work(files, output + ".work-");
  const PageContents contents = make_contents();
  spec.output = work.path() + "/package";
  query::PackageReport report = query::write_package(file, spec, {}, files, progress, cancel);
  if (report.bytes > kMaxSinglePageBytes)
    throw Error(ErrorCode::kLimit, output + ": the package has " + size_text(report.bytes) +
                                       ", expected at most " + size_text(kMaxSinglePageBytes) +
                                       " with --single-file");
  try {
    report.bytes = write_page(spec.output, contents, partial, outputs.files(), cancel);
    outputs.files().rename(partial, output);
  } catch (const Error&) {
    if (files.exists(partial)) files.remove(partial);
    throw;
  }
  files.sync_directory(parent_directory(output));
  report.files = 1;
  return report;
}

}  // namespace voxdag::server
