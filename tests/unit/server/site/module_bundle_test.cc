#include "server/site/module_bundle.h"

#include <gtest/gtest.h>

#include <map>
#include <stdexcept>

#include "query/package/gzip_block.h"
#include "query/package/package_index.h"
#include "server/site/base64.h"
#include "server/site/viewer_site.h"

namespace voxdag::server {
namespace {

std::string bundle(const std::map<std::string, std::string>& sources) {
  return bundle_modules("a/main.js",
                        [&](const std::string& path) -> std::string { return sources.at(path); });
}

TEST(ModuleBundle, PutsModulesBeforeTheirImporters) {
  EXPECT_EQ(
      bundle({{"a/main.js",
               "// A comment.\nimport {\n  f,\n  g as h\n} from \"../b/b.js\";\nimport "
               "\"./c.js\";\n\nf(h);\n"},
              {"b/b.js", "export function f() {\n  return 1;  // one\n}\nexport const g = 2;\n"},
              {"a/c.js", "import {g} from \"../b/b.js\";\nexport {g};\n"}}),
      "const module0 = (() => {\nfunction f() {\nreturn 1;  // one\n}\nconst g = 2;\n"
      "return {f, g};\n})();\n"
      "const module1 = (() => {\nconst {g} = module0;\nreturn {g};\n})();\n"
      "const module2 = (() => {\nconst {\n  f,\n  g: h\n} = module0;\nf(h);\nreturn {};\n})();\n");
}

TEST(ModuleBundle, RefusesOtherForms) {
  EXPECT_THROW(bundle({{"a/main.js", "import x from \"./b.js\";\n"}}), std::logic_error);
  EXPECT_THROW(bundle({{"a/main.js", "export let x = 1;\n"}}), std::logic_error);
  EXPECT_THROW(
      bundle({{"a/main.js", "import \"./b.js\";\n"}, {"a/b.js", "import \"./main.js\";\n"}}),
      std::logic_error);
}

TEST(ViewerSite, RefersToNoOtherFile) {
  const std::vector<query::ViewerFile> site = viewer_site({"a <b> & \"c\"", "", ""});
  ASSERT_EQ(site.size(), 4u);
  EXPECT_EQ(site[0].name, query::hashed_name("start", site[0].contents, ".js"));
  EXPECT_EQ(site[1].name, query::hashed_name("viewer", site[1].contents, ".bin"));
  EXPECT_EQ(site[2].name, query::hashed_name("viewer", site[2].contents, ".js"));
  EXPECT_EQ(site[3].name, "index.html");
  EXPECT_EQ(query::gunzip_block(site[1].contents, 1 << 20), site[2].contents);
  const std::string& page = site[3].contents;
  EXPECT_NE(page.find("<title>a &lt;b&gt; &amp; &quot;c&quot;</title>"), page.npos);
  EXPECT_NE(page.find("src=\"" + site[0].name + "\""), page.npos);
  EXPECT_NE(page.find("content=\"" + site[1].name + " " + site[2].name + "\""), page.npos);
  EXPECT_EQ(page.find("=\"/"), page.npos);
  const std::string single = page_with_module({"a", "", ""});
  EXPECT_EQ(single.find("=\"/"), single.npos);
  EXPECT_NE(single.find(site[0].contents), single.npos);
  EXPECT_NE(single.find("data-module>" + base64_of(site[1].contents) + "</script>"), single.npos);
  for (const size_t file : {0, 2})
    EXPECT_EQ(site[file].contents.find("</script"), std::string::npos);
}

TEST(ViewerSite, HasAPoster) {
  const std::vector<query::ViewerFile> site =
      viewer_site({"a", "picture", "https://example.org/a&b/"});
  ASSERT_EQ(site.size(), 5u);
  EXPECT_EQ(site[3].name, query::hashed_name("poster", "picture", ".png"));
  EXPECT_EQ(site[3].contents, "picture");
  const std::string& page = site[4].contents;
  EXPECT_NE(page.find("src=\"" + site[3].name + "\""), page.npos);
  EXPECT_NE(page.find("<meta property=\"og:image\" content=\"https://example.org/a&amp;b/" +
                      site[3].name + "\">"),
            page.npos);
  const std::string single = page_with_module({"a", "picture", ""});
  EXPECT_NE(single.find("src=\"data:image/png;base64,cGljdHVyZQ==\""), single.npos);
  EXPECT_EQ(single.find("og:image"), single.npos);
  const std::string jpeg = "\xff\xd8\xff\xe0";
  EXPECT_EQ(viewer_site({"a", jpeg, ""})[3].name, query::hashed_name("poster", jpeg, ".jpg"));
  EXPECT_NE(page_with_module({"a", jpeg, ""}).find("src=\"data:image/jpeg;base64,/9j/4A==\""),
            std::string::npos);
}

}  // namespace
}  // namespace voxdag::server
