#include "server/site/module_bundle.h"

#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace voxdag::server {
namespace {

// Returns the path of the module that the module at `from` imports as `name`, such as
// "../lib/dom.js".
std::string resolve_module(const std::string& from, std::string_view name) {
  std::string folder = from.substr(0, from.rfind('/') + 1);
  for (;;) {
    if (name.starts_with("./")) {
      name.remove_prefix(2);
    } else if (name.starts_with("../")) {
      name.remove_prefix(3);
      const size_t end = folder.size() < 2 ? folder.npos : folder.rfind('/', folder.size() - 2);
      folder.resize(end == folder.npos ? 0 : end + 1);
    } else {
      return folder + std::string(name);
    }
  }
}

// Converts the names of an import, "{a, b as c}", to the left side of an assignment, "{a, b: c}".
std::string pattern_of(const std::string& names) {
  static const std::regex as(R"(\s+as\s+)");
  return std::regex_replace(names, as, ": ");
}

// Returns `source` without indentation, without empty lines, and without lines that only have a
// comment.
std::string without_comments(const std::string& source) {
  std::istringstream lines(source);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    const size_t begin = line.find_first_not_of(' ');
    if (begin == line.npos || line.compare(begin, 2, "//") == 0) continue;
    result += line.substr(begin) + '\n';
  }
  return result;
}

class Bundle {
 public:
  explicit Bundle(const std::function<std::string(const std::string&)>& source_of)
      : source_of_(source_of) {}

  // Adds the modules that a module imports, and then the module itself, unless they were already
  // added. Returns the name of the variable that has the exports of the module.
  std::string add(const std::string& path) {
    const auto [known, is_new] = names_.try_emplace(path, "");
    if (!is_new) {
      if (known->second.empty())
        throw std::logic_error(path + " imports itself through other modules");
      return known->second;
    }
    std::string source = source_of_(path);
    const std::string imports = take_imports(path, source), exports = take_exports(path, source);
    const std::string name = "module" + std::to_string(count_++);
    text_ += "const " + name + " = (() => {\n" + imports + without_comments(source) + "return {" +
             exports + "};\n})();\n";
    return names_[path] = name;
  }
  const std::string& text() const { return text_; }

 private:
  // Removes the imports from `source`, and adds the imported modules. Returns the statements that
  // assign the imported names.
  std::string take_imports(const std::string& path, std::string& source) {
    static const std::regex statement(
        "(?:^|\n)import\\s+(?:(\\{[^}]*\\})\\s*from\\s+)?\"([^\"]+)\";");
    std::string statements;
    for (std::smatch match; std::regex_search(source, match, statement);) {
      const std::string names = match[1], module = add(resolve_module(path, match[2].str()));
      if (!names.empty()) statements += "const " + pattern_of(names) + " = " + module + ";\n";
      source = match.prefix().str() + "\n" + match.suffix().str();
    }
    if (source.starts_with("import ") || source.find("\nimport ") != source.npos)
      throw std::logic_error(path + " has an import of another form");
    return statements;
  }

  // Removes the word "export" from declarations, and removes lists of exports. Returns all exported
  // names, separated by commas.
  static std::string take_exports(const std::string& path, std::string& source) {
    static const std::regex declaration("(^|\n)export ((?:async )?function|class|const) (\\w+)");
    static const std::regex list("(^|\n)export \\{([\\w, ]+)\\};");
    std::string names;
    const auto add = [&](const std::regex& form, size_t group) {
      for (std::sregex_iterator at(source.begin(), source.end(), form), end; at != end; ++at)
        names += (names.empty() ? "" : ", ") + (*at)[group].str();
    };
    add(declaration, 3);
    add(list, 2);
    source = std::regex_replace(source, declaration, "$1$2 $3");
    source = std::regex_replace(source, list, "$1");
    if (source.starts_with("export ") || source.find("\nexport ") != source.npos)
      throw std::logic_error(path + " has an export of another form");
    return names;
  }

  const std::function<std::string(const std::string&)>& source_of_;
  std::map<std::string, std::string> names_;  // results of add(), by path; "" during the call
  std::string text_;
  int count_ = 0;
};

}  // namespace

std::string bundle_modules(const std::string& entry,
                           const std::function<std::string(const std::string& path)>& source_of) {
  Bundle bundle(source_of);
  bundle.add(entry);
  return bundle.text();
}

}  // namespace voxdag::server
