// Tests `voxdag view`, which serves a viewer of one file on this machine until Ctrl-C. Also tests
// `voxdag publish`.
#include <signal.h>

#include <chrono>
#include <thread>

#include "client/http_client.h"
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class View : public CommandLine {
 protected:
  void SetUp() override {
    make_scene();
    ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", "m.vdag"}).status, 0);
  }
  // Waits until the command has printed a line, and returns its standard output.
  std::string first_line() {
    for (int i = 0; i < 3000 && contents(".stdout").find('\n') == std::string::npos; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return contents(".stdout");
  }
};

TEST_F(View, ServesUntilItIsInterrupted) {
  for (const int signal : {SIGINT, SIGTERM}) {
    put(".stdout", "");
    const pid_t pid = start({"view", "m.vdag", "--json"});
    const std::string url = Json::parse(first_line())["url"];
    EXPECT_TRUE(url.starts_with("http://127.0.0.1:")) << url;
    voxdag::client::HttpClient http({url.substr(0, url.size() - 1), "", "", 60});
    const Json manifest = Json::parse(http.get("/api/v1/view/tiles").body);
    EXPECT_EQ(manifest["resolution"], 64);
    kill(pid, signal);
    const Answer answer = wait_for(pid);
    EXPECT_EQ(answer.status, 0);
    EXPECT_EQ(answer.err, "");
  }
}

// When the first line of output appears, `view` can still be busy with computing the cameras of a
// large file. SIGINT then ends it with status 0.
TEST_F(View, EndsWhileItStarts) {
  ASSERT_EQ(run({"build", "m.glb", "-r", "2048", "-o", "large.vdag"}).status, 0);
  put(".stdout", "");
  const pid_t pid = start({"view", "large.vdag", "--json"});
  first_line();
  kill(pid, SIGINT);
  const Answer answer = wait_for(pid);
  EXPECT_EQ(answer.status, 0);
  EXPECT_EQ(answer.err, "");
}

TEST_F(View, RefusesWhatItCannotShow) {
  put("text.vdag", std::string(10000, 'x'));
  expect_error(3, "none.vdag", {"view", "none.vdag"});
  expect_error(4, "text.vdag", {"view", "text.vdag"});
  expect_error(2, "--port", {"view", "m.vdag", "--port", "65536"});
}

TEST_F(View, IsPublished) {
  const Json report = run_json(
      {"publish", "m.vdag", "-o", "p", "--title", "A <sphere>", "--url", "https://example.org/p"});
  EXPECT_EQ(report["files"], 8);
  EXPECT_NE(contents("p/index.html").find("content=\"https://example.org/p/poster-"),
            std::string::npos);
  const Json checked = run_json({"publish", "--check", "p"});
  // File names can have any bytes; the page shows those that are not UTF-8 as U+FFFD.
  put("\xff.vdag", contents("m.vdag"));
  EXPECT_EQ(run({"publish", "\xff.vdag", "-o", "r"}).status, 0);
  EXPECT_NE(contents("r/index.html").find("\xef\xbf\xbd"), std::string::npos);
  expect_error(2, "expected text that is valid UTF-8",
               {"publish", "m.vdag", "-o", "t", "--title", "\xff"});
  for (const char* member : {"packs", "tiles", "color_pages"})
    EXPECT_EQ(checked[member], report[member]) << member;
  EXPECT_NE(run({"publish", "--check", "p/"}).out.find("intact"), std::string::npos);
  expect_error(2, "--check p: expected no .vdag file and no --output",
               {"publish", "m.vdag", "--check", "p"});
  expect_error(2, "--check p: expected no .vdag file and no --output",
               {"publish", "m.vdag", "-o", "q", "--check", "p"});
  const std::string page = contents("p/index.html");
  put("p/index.html", page.substr(0, page.size() / 50));
  expect_error(4, "p/index.html: it does not name the file start-", {"publish", "--check", "p"});
  std::filesystem::remove(folder_.file("p/index.html"));
  expect_error(3, "open p/index.html", {"publish", "--check", "p"});
  run_json({"publish", "m.vdag", "-o", "p/", "--gray", "--pack-size", "1MiB", "--no-poster"});
  EXPECT_EQ(contents("p/index.html").find("poster-"), std::string::npos);
  expect_error(2, "m.vdag is a file or a link: expected a new folder",
               {"publish", "m.vdag", "-o", "m.vdag", "--no-poster"});
  expect_error(2, "--pack-size 1KiB: expected 256KiB to 1GiB",
               {"publish", "m.vdag", "-o", "q", "--pack-size", "1KiB"});
  expect_error(2, "--url ftp://a: expected an address that begins with https:// or http://",
               {"publish", "m.vdag", "-o", "q", "--url", "ftp://a"});
  const std::vector<std::string> single = {"publish", "m.vdag",        "-o",
                                           "p.html",  "--single-file", "--no-poster"};
  EXPECT_EQ(run_json(single)["files"], 1);
  EXPECT_NE(contents("p.html").find("data-file=\"package.json\">eyJ"), std::string::npos);
  EXPECT_FALSE(exists("p.html.partial") || exists("p.html.lock"));
  expect_error(2, "--force", single);
  run_json({"publish", "m.vdag", "-o", "p.html", "--single-file", "--force", "--no-poster"});
  expect_error(2, "--check DIR", {"publish", "m.vdag"});
  expect_error(3, "package.json", {"publish", "--check", "q"});
}

}  // namespace
}  // namespace command_line
