// SPDX-License-Identifier: Apache-2.0
// serve --record where the file is there already, the disk is full, or the run ends early.
#include <signal.h>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kSomeFrames = 50'000;  // bytes

class ServerRecording : public TakeTest {
 protected:
  /// `relievo info` opens it and finds frames.
  void expect_readable() {
    const Finished info = run({program("relievo").string(), "info", file_.string()});
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_EQ(info.err, "");
    EXPECT_NE(info.out.find("frame"), std::string::npos) << info.out;
  }

  const fs::path file_ = folder_.path() / "out.mcap";
};

TEST_F(ServerRecording, OntoAnExistingFile) {
  std::ofstream(file_) << "precious\n";
  expect_one_error(run(serve(source_, {"--record", file_.string(), "--fast"})), file_.string());
  EXPECT_EQ(read_text(file_), "precious\n");
}

TEST_F(ServerRecording, IntoAFolderThatIsNotThere) {
  const fs::path file = folder_.path() / "none" / "out.mcap";
  expect_one_error(run(serve(source_, {"--record", file.string()})), file.string());
  EXPECT_FALSE(fs::exists(file.parent_path()));
}

TEST_F(ServerRecording, OntoAFullDisk) {
  // A limit on the size of files stands for a full disk: 64 KiB hold a few frames.
  std::string script = "trap '' XFSZ; ulimit -f 64; exec";
  for (const std::string& word : serve(source_, {"--loop", "--record", file_.string()}))
    script += " '" + word + "'";
  Process process({"/bin/bash", "-c", script});
  ASSERT_TRUE(process.wait_for_text("the stream goes on without a recording")) << process.err();
  EXPECT_EQ(process.wait(100ms), std::nullopt) << process.err();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(), 1) << process.err();
  ASSERT_EQ(errors(process.err()).size(), 1U) << process.err();
  EXPECT_NE(errors(process.err())[0].find(file_.string()), std::string::npos) << process.err();
  EXPECT_NE(errors(process.err())[0].find("after them are not in it"), std::string::npos) << process.err();
  if (fs::exists(file_)) expect_readable();
  for (const std::string& name : names_in(folder_.path()))
    EXPECT_TRUE(name == "take" || name == "out.mcap") << name;
}

TEST_F(ServerRecording, InFilesThatAreReadAlone) {
  const Finished done = run(serve(source_, {"--loop", "--fast", "--frames", "60", "--record", file_.string(),
                                            "--split-size", "40kB", "--sync", "1s"}));
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_NE(done.err.find(" files"), std::string::npos) << done.err;
  const std::set<std::string> names = names_in(folder_.path());
  ASSERT_TRUE(names.contains("out_000000.mcap") && names.contains("out_000001.mcap")) << done.err;
  EXPECT_FALSE(names.contains("out.mcap"));
  for (const char* name : {"out_000000.mcap", "out_000001.mcap"}) {
    const Finished info = run({program("relievo").string(), "info", (folder_.path() / name).string()});
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_NE(info.out.find("16 stripes"), std::string::npos) << "described in each: " << info.out;
  }
}

TEST_F(ServerRecording, EndsWholeOnASignal) {
  Process process(serve(source_, {"--loop", "--record", file_.string()}));
  ASSERT_TRUE(process.wait_for_text("stream take")) << process.err();
  ASSERT_TRUE(wait_for_size(file_, kSomeFrames)) << process.err();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_TRUE(errors(process.err()).empty()) << process.err();
  expect_readable();
}

TEST_F(ServerRecording, IsWholeWhereTheTakeIsRemovedMidRun) {
  Process process(serve(source_, {"--loop", "--record", file_.string()}));
  ASSERT_TRUE(process.wait_for_text("stream take")) << process.err();
  ASSERT_TRUE(wait_for_size(file_, kSomeFrames)) << process.err();
  fs::remove_all(take_);
  EXPECT_EQ(process.wait(), 1) << process.err();
  EXPECT_EQ(errors(process.err()).size(), 1U) << process.err();
  expect_readable();
}

}  // namespace
}  // namespace relievo::test
