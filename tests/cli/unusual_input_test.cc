// Regression tests for defects that were found by giving the program hostile input.
#include <sys/stat.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/cli/command_line.h"
#include "tests/cli/serve_process.h"

namespace command_line {
namespace {

class UnusualInput : public CommandLine {
 protected:
  void SetUp() override { make_scene(); }
  void build() { run_json({"build", "m.glb", "-r", "64", "-o", "m.vdag"}); }
  // Runs a command that would overwrite the file `name`. Checks that the command fails and does not
  // change the file.
  void expect_refused(const std::string& name, const std::vector<std::string>& args) {
    SCOPED_TRACE(name);
    const std::string before = contents(name);
    expect_error(2, name, args);
    EXPECT_TRUE(contents(name) == before);
  }
};

// Commands do not print the control characters of a file's name, which could control the terminal
// or start a false line of output. In JSON these characters are escaped.
TEST_F(UnusualInput, ControlCharactersOfNamesAreNotPrinted) {
  const std::string evil = "a\x1b[31m\nforged\xc2\x9b\xe2\x80\xae";
  ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", evil + ".vdag"}).status, 0);
  const auto expect_printable = [&](const std::vector<std::string>& args) {
    SCOPED_TRACE(args[0]);
    const Answer answer = run(args);
    const std::string text = answer.out + answer.err;
    EXPECT_NE(text.find("forged"), std::string::npos) << text;
    for (const std::string control : {"\x1b", "\nforged", "\xc2\x9b", "\xe2\x80\xae"})
      EXPECT_EQ(text.find(control), std::string::npos) << text;
  };
  expect_printable({"info", evil + ".vdag"});
  expect_printable({"info", evil + "x.vdag"});
  expect_printable({"verify", evil + ".vdag"});
  expect_printable({"build", evil + ".glb", "-r", "64", "-o", "b.vdag"});
  expect_printable({"build", "m.glb", "-r", "64", "-o", evil + ".vdag"});
  expect_printable({"build", "m.glb", "-r", "64", "-o", evil + ".vdag", "--json"});
  expect_printable({"render", evil + ".vdag", "-o", evil + ".png", "--size", "32x32"});
  expect_printable({"generate", "menger", evil + ".glb", "--level", "1"});
  expect_printable({"export", evil + ".vdag", "-o", evil + ".ply", "--to", "ply"});
}

constexpr const char* kReplacement = "\xef\xbf\xbd";  // U+FFFD, for a byte that is not UTF-8

// A path can have bytes that are not UTF-8. The created file has exactly this name. In JSON, U+FFFD
// replaces such bytes, because JSON must be UTF-8.
TEST_F(UnusualInput, PathsNeedNotBeUtf8) {
  build();
  const auto expect_output = [&](std::vector<std::string> args, const std::string& suffix) {
    SCOPED_TRACE(suffix);
    EXPECT_EQ(run_json(std::move(args)).at("output"), "p" + std::string(kReplacement) + suffix);
    EXPECT_TRUE(exists("p\xff" + suffix));
  };
  expect_output({"generate", "menger", "p\xff.glb", "--level", "1"}, ".glb");
  expect_output({"render", "m.vdag", "-o", "p\xff.png", "--size", "32x32"}, ".png");
  expect_output({"build", "m.glb", "-r", "64", "-o", "p\xff.vdag"}, ".vdag");
  run_json({"info", "p\xff.vdag"});
  run_json({"verify", "p\xff.vdag"});
  run_json({"diff", "p\xff.vdag", "m.vdag"});
}

// A request cannot contain bytes that are not UTF-8, so the client reports them as invalid input
// before it sends the request.
TEST_F(UnusualInput, ClientsRefuseNamesThatAreNotUtf8) {
  std::filesystem::create_directory(folder_.file("server"));
  ServeProcess server(folder_.file("server"));
  const auto client = [&](std::vector<std::string> args) {
    args.insert(args.end(), {"--server", server.url()});
    return args;
  };
  expect_error(2, "UTF-8", client({"submit", "m.glb", "-r", "64", "--name", "\xff"}));
  expect_error(2, "UTF-8", client({"submit", "/none\xff.glb", "-r", "64"}));
  const std::string id = run_json(client({"submit", "m.glb", "-r", "64", "--wait"})).at("id");
  const Json report = run_json(client({"download", id, "-o", "d\xff.vdag"}));
  EXPECT_EQ(report.at("output"), "d" + std::string(kReplacement) + ".vdag");
  EXPECT_TRUE(exists("d\xff.vdag"));
  // Without --force, download replaces an existing file only if it is a .vdag file.
  put("notes.txt", "mine");
  expect_refused("notes.txt", client({"download", id, "-o", "notes.txt"}));
  run_json(client({"download", id, "-o", "notes.txt", "--force"}));
  run_json(client({"download", id, "-o", "notes.txt"}));
  EXPECT_EQ(server.stop(), 0);
}

// Without --force, a command replaces only files made by the same command. It never replaces its
// input.
TEST_F(UnusualInput, ForeignFilesAreNotOverwritten) {
  build();
  const std::vector<std::string> render = {"render", "m.vdag", "--size", "32x32", "-o"};
  const std::vector<std::string> generate = {"generate", "menger", "--level", "1"};
  for (std::vector<std::string> args : {render, generate}) {
    SCOPED_TRACE(args[0]);
    // These files are not replaced: a text, the beginnings of a picture and of a scene, which
    // another program could have made, and a file of one byte.
    for (const char* bytes : {"mine", "\x89PNG\r\n\x1a\n", "glTF", "g"}) {
      put("mine", bytes);
      args.push_back("mine");
      expect_refused("mine", args);
      args.back() = "other";
      std::filesystem::rename(folder_.file("mine"), folder_.file("other.partial"));
      expect_refused("other.partial", args);
      std::filesystem::remove(folder_.file("other.partial"));
      args.pop_back();
    }
    put("mine", "mine");
    args.push_back("mine");
    args.push_back("--force");
    run_json(args);
    args.pop_back();
    run_json(args);
    args.back() = folder_.path();
    expect_error(2, "not a regular file", args);
  }
  expect_refused("m.vdag", {"render", "m.vdag", "-o", "m.vdag", "--force"});
  std::filesystem::create_hard_link(folder_.file("m.vdag"), folder_.file("same.partial"));
  expect_refused("same.partial", {"render", "m.vdag", "-o", "same", "--force"});
}

// A build refuses to overwrite a file that it did not create, not only at its output, but also at
// the paths of its partial file and its report.
TEST_F(UnusualInput, ABuildRefusesToOverwriteItsNeighbors) {
  for (const char* name : {"q", "q.partial", "q.report.json", "q.report.json.partial"}) {
    put(name, "mine");
    expect_refused(name, {"build", "m.glb", "-r", "64", "-o", "q"});
    std::filesystem::remove(folder_.file(name));
  }
  std::filesystem::copy_file(folder_.file("m.glb"), folder_.file("s.partial"));
  expect_refused("s.partial", {"build", "s.partial", "-r", "64", "-o", "s"});
  run_json({"build", "m.glb", "-r", "64", "-o", "q"});
  run_json({"build", "m.glb", "-r", "128", "-o", "q"});
}

// An input that is not a regular file, such as a folder or a pipe, is invalid input for every
// command.
TEST_F(UnusualInput, InputsThatAreNoFilesHaveOneStatus) {
  build();
  ASSERT_EQ(mkfifo(folder_.file("pipe").c_str(), 0600), 0);
  std::filesystem::create_directory(folder_.file("folder"));
  for (const std::string name : {"pipe", "folder"})
    for (const std::vector<std::string>& args :
         std::vector<std::vector<std::string>>{{"build", name, "-r", "64", "-o", "x.vdag"},
                                               {"info", name},
                                               {"verify", name},
                                               {"diff", "m.vdag", name},
                                               {"render", name, "-o", "x.png"}}) {
      SCOPED_TRACE(args[0]);
      expect_error(2, name + " is not a regular file", args);
    }
}

// If the folder of the output does not exist, the command fails before it begins its work.
TEST_F(UnusualInput, AMissingOutputFolderIsNoticedFirst) {
  build();
  expect_error(3, "the folder none does not exist",
               {"generate", "menger", "none/x.glb", "--level", "1"});
  expect_error(3, "the folder none does not exist", {"render", "m.vdag", "-o", "none/x.png"});
}

// A text that is not exactly a number in the option's range is refused, and so is a mistyped
// command or option. The error is one line that names the expected values.
TEST_F(UnusualInput, NumbersAndMessages) {
  const std::vector<std::string> build = {"build", "m.glb", "-o", "m.vdag", "-r"};
  for (const char* number : {"-4", "abc", "64x", "", "99999999999999999999", "6.4"}) {
    SCOPED_TRACE(number);
    std::vector<std::string> args = build;
    args.push_back(number);
    expect_error(2, "--resolution: '" + std::string(number) + "': expected a power of two from 4",
                 args);
  }
  expect_error(2, "--threads: '-1'",
               {"build", "m.glb", "-o", "m.vdag", "-r", "64", "--threads", "-1"});
  expect_error(2, "from 1 to", {"generate", "city", "c.glb", "--triangles", "0"});
  for (const std::vector<std::string>& args : {std::vector<std::string>{},
                                               {"biuld"},
                                               {"info"},
                                               {"info", "x", "--frob"},
                                               {"serve", "--port", "x"}}) {
    const Answer answer = run(args);
    EXPECT_EQ(answer.status, 2);
    EXPECT_EQ(answer.err.find("voxdag: error: "), 0u) << answer.err;
    EXPECT_EQ(answer.err.find('\n'), answer.err.size() - 1) << answer.err;
    EXPECT_EQ(answer.err.find("Run with"), std::string::npos) << answer.err;
  }
}

// Messages about the command line have the form of other messages: they say what is expected.
TEST_F(UnusualInput, WrongArgumentsNameWhatIsExpected) {
  const std::string once = "--resolution is given several times: expected it once";
  expect_error(2, once, {"build", "m.glb", "-r", "64", "-r", "128", "-o", "m.vdag"});
  expect_error(2, "--output has no value: expected one", {"build", "m.glb", "-o"});
  expect_error(2, "diff: the argument 'b' is required", {"diff", "m.vdag"});
  expect_error(2, "--view: 'foo': expected one of auto, iso",
               {"render", "m.vdag", "-o", "m.png", "--view", "foo"});
  expect_error(2, "--fov: '171': expected a number from 1 to 170",
               {"render", "m.vdag", "-o", "m.png", "--fov", "171"});
  expect_error(2, "--threads: '0': expected a whole number from 1 to 1024",
               {"reorder", "m.vdag", "-o", "n.vdag", "--threads", "0"});
}

// `build` and `plan` refuse a scene for which the disk has no space. The message of `build` names
// the option --force; the message of `plan`, which has no such option, does not. The scene has 1000
// * (2^32 - 1) instances of one triangle.
TEST_F(UnusualInput, OnlyBuildNamesForce) {
  Json nodes = Json::array(), roots = Json::array();
  for (int i = 0; i < 1000; ++i) {
    nodes.push_back(
        {{"mesh", 0},
         {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", 1}}}}}}}});
    roots.push_back(i);
  }
  put("many.gltf", R"({"asset":{"version":"2.0"},"extensionsUsed":["EXT_mesh_gpu_instancing"],
    "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)" +
                       std::string("AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA") + R"("}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                 {"componentType":5126,"count":4294967295,"type":"VEC3"}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "scene":0,"scenes":[{"nodes":)" +
                       roots.dump() + R"(}],"nodes":)" + nodes.dump() + "}");
  const std::vector<std::string> scene = {"many.gltf", "-r", "64", "--memory", "64MiB"};
  const auto with = [&](std::vector<std::string> args) {
    args.insert(args.begin() + 1, scene.begin(), scene.end());
    return args;
  };
  expect_error(7, "expected more free space (--force builds anyway)",
               with({"build", "-o", "many.vdag"}));
  const Answer plan = run(with({"plan"}));
  EXPECT_EQ(plan.status, 7);
  EXPECT_EQ(plan.err.find("--force"), std::string::npos) << plan.err;
}

// `plan` works even if TMPDIR does not name a writable folder, because it then spills triangles to
// another folder.
TEST_F(UnusualInput, PlanNeedsNoTmpdir) {
  for (const char* folder : {"/proc/none", ""}) {
    SCOPED_TRACE(folder);
    setenv("TMPDIR", folder, 1);
    const Answer plan = run({"plan", "m.glb", "-r", "256"});
    unsetenv("TMPDIR");
    EXPECT_EQ(plan.status, 0) << plan.err;
  }
}

// A command whose standard output cannot be written fails, and its error names the standard output.
// The reason is also known for outputs that the program writes in several pieces (build --help).
TEST_F(UnusualInput, OutputThatCannotBeWrittenIsAnError) {
  build();
  for (const char* command : {"info m.vdag --json", "--version", "verify m.vdag",
                              "token --role read --name me", "build --help"}) {
    SCOPED_TRACE(command);
    const std::string line =
        "cd " + folder_.path() + " && " VOXDAG_BINARY " " + command + " > /dev/full 2> errors";
    const int status = std::system(line.c_str());
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 7) << status;
    EXPECT_NE(contents("errors").find("standard output"), std::string::npos);
  }
}

// By default, a scene that requires an unknown extension is refused. With an option, each command
// that reads scenes ignores the extension.
TEST_F(UnusualInput, RequiredExtensionsAreIgnoredOnRequest) {
  std::ofstream(folder_.file("t.gltf"))
      << R"({"asset":{"version":"2.0"},"extensionsRequired":["ACME_bent","ACME_twisted"],)"
         R"("buffers":[{"byteLength":36,"uri":"data:;base64,)"
         R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],)"
         R"("bufferViews":[{"buffer":0,"byteLength":36}],)"
         R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],)"
         R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}]})";
  expect_error(2, "ACME_bent", {"build", "t.gltf", "-r", "64", "-o", "t.vdag"});
  const auto ignoring = [](std::vector<std::string> args, const std::string& scene) {
    args.insert(args.end(), {"--ignore-extension", "ACME_bent", "--ignore-extension",
                             "ACME_twisted", scene, "-r", "64"});
    return args;
  };
  EXPECT_EQ(run_json(ignoring({"plan"}, "t.gltf")).at("triangles"), 1);
  const Json report = run_json(ignoring({"build", "-o", "t.vdag"}, "t.gltf"));
  EXPECT_EQ(report.at("triangles"), 1);
  EXPECT_EQ(report.at("warnings").size(), 2u);
  expect_error(2, "ACME_bent", {"verify", "t.vdag", "--against", "t.gltf"});
  run_json({"verify", "t.vdag", "--ignore-extension", "ACME_bent", "--ignore-extension",
            "ACME_twisted", "--against", "t.gltf"});
}

}  // namespace
}  // namespace command_line
