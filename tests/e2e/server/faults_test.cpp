// SPDX-License-Identifier: Apache-2.0
// What goes wrong with a rig, a take or a port: one clear line, the right exit status, nothing left behind.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/e2e/server/server_process.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;

using ServerFault = TakeTest;

/// A TCP port of this machine that somebody else holds.
class TakenPort {
 public:
  TakenPort() : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    if (bind(socket_, generic, size) == 0 && listen(socket_, 1) == 0 &&
        getsockname(socket_, generic, &size) == 0)
      port_ = ntohs(address.sin_port);
  }
  TakenPort(const TakenPort&) = delete;
  TakenPort& operator=(const TakenPort&) = delete;
  ~TakenPort() { close(socket_); }
  int port() const { return port_; }

 private:
  int socket_;
  int port_ = 0;
};

TEST_F(ServerFault, PortInUse) {
  const TakenPort taken;
  ASSERT_GT(taken.port(), 0);
  const std::string address = "127.0.0.1:" + std::to_string(taken.port());
  const Finished done = run(serve(source_, {"--web", address}));
  expect_one_error(done, std::to_string(taken.port()));
  EXPECT_EQ(done.out, "");
}

TEST_F(ServerFault, UnknownSources) {
  expect_one_error(run(serve("webcam:0", {})), "webcam:0");
  expect_one_error(run(serve("take:" + (folder_.path() / "none").string(), {})), "none");
  expect_one_error(run(serve("sim:nowhere", {})), "nowhere");
  expect_one_error(run(serve("v4l2:/dev/null", {"--rig", "/dev/zero"})), "/dev/zero");
  expect_one_error(run(server({"reconstruct", (folder_.path() / "none").string(), "--out", out_.string()})),
                   "none");
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(ServerFault, ARigWithoutAKey) {
  for (const std::string key : {"camera_width", "projector_from_camera_rotation"}) {
    remove_key("rig.yaml", key);
    for (const auto& command :
         {serve(source_, {}), server({"reconstruct", take_.string(), "--out", out_.string()}),
          server({"evaluate", take_.string()})}) {
      const Finished done = run(command);
      expect_one_error(done, key);
      EXPECT_NE(done.err.find("rig.yaml"), std::string::npos) << done.err;
      EXPECT_EQ(done.out, "");
    }
    EXPECT_FALSE(fs::exists(out_));
    ASSERT_TRUE(write_striped_take(striped_scene(), take_, 12));
  }
}

TEST_F(ServerFault, ARigThatGivesNoDepth) {
  StripedScene scene = striped_scene();
  scene.rig.projector_from_camera_rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1};  // on its side
  ASSERT_TRUE(write_striped_take(scene, take_, 2));
  const std::string rig = (take_ / "rig.yaml").string();
  for (const auto& command :
       {serve(source_, {}), server({"reconstruct", take_.string(), "--out", out_.string()}),
        server({"plan", "--rig", rig, "--distance", "1"})})
    expect_one_error(run(command), "turn the camera or the projector by 90 degrees");
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(ServerFault, APatternThatRepeatsACode) {
  StripedScene scene = striped_scene();
  scene.pattern.sequence = {0, 7, 14, 0, 7};
  ASSERT_TRUE(write_striped_take(scene, take_, 2));
  const Finished done = run(serve(source_, {}));
  expect_one_error(done, "pattern.yaml");
  EXPECT_NE(done.err.find("repeats"), std::string::npos) << done.err;
}

TEST_F(ServerFault, SettingsThatAreWrong) {
  const fs::path file = folder_.path() / "serve.toml";
  std::ofstream(file) << "# settings\nthreads = 99\n";
  const Finished done = run(serve(source_, {"--config", file.string()}));
  expect_one_error(done, file.string() + ":2: threads");
}

TEST_F(ServerFault, ACorruptPictureIsNamedAndTheOthersAreServed) {
  fs::resize_file(take_ / "frames" / "000003.png", 200);
  const Finished done = run(serve(source_, {"--fast"}));
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_TRUE(errors(done.err).empty()) << done.err;
  int named = 0;
  for (const std::string& line : lines(done.err)) named += line.find("000003.png") != std::string::npos;
  EXPECT_EQ(named, 1) << done.err;
  EXPECT_NE(done.err.find("11 frames captured"), std::string::npos) << done.err;
}

TEST_F(ServerFault, ACorruptPictureIsNamedAndTheOthersAreReconstructed) {
  fs::resize_file(take_ / "frames" / "000003.png", 200);
  const Finished done = run(server({"reconstruct", take_.string(), "--out", out_.string()}));
  EXPECT_EQ(done.status, 1);
  ASSERT_EQ(errors(done.err).size(), 1U) << done.err;
  EXPECT_NE(errors(done.err)[0].find("1 of 12 frames could not be read"), std::string::npos) << done.err;
  EXPECT_NE(errors(done.err)[0].find("000003.png"), std::string::npos) << done.err;
  EXPECT_NE(errors(done.err)[0].find("the others are reconstructed"), std::string::npos) << done.err;
  EXPECT_EQ(names_in(out_).size(), 10U);  // not the first, not the torn one
  EXPECT_FALSE(names_in(out_).contains("000003.ply"));
  // A score over part of a take would not be comparable.
  expect_one_error(run(server({"evaluate", take_.string()})), "000003.png");
}

TEST_F(ServerFault, WhereNoPictureCanBeReadThereAreNoOthers) {
  for (const std::string& name : names_in(take_ / "frames")) fs::resize_file(take_ / "frames" / name, 200);
  const Finished done = run(server({"reconstruct", take_.string(), "--out", out_.string()}));
  EXPECT_EQ(done.status, 1);
  ASSERT_EQ(errors(done.err).size(), 1U) << done.err;
  EXPECT_NE(errors(done.err)[0].find("frames could not be read"), std::string::npos) << done.err;
  EXPECT_EQ(errors(done.err)[0].find("the others"), std::string::npos) << done.err;
  EXPECT_EQ(done.out, "0 of 12 frames reconstructed\n") << "into no folder: there is none";
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(ServerFault, PicturesOfAnotherSizeThanTheRigsAreSaidBeforeAnythingIsComputed) {
  Rig rig = striped_scene().rig;
  rig.camera.width = rig.camera.height = 16384;
  std::ofstream(take_ / "rig.yaml", std::ios::binary) << to_yaml(rig);
  std::string script = "ulimit -t 3; exec";  // seconds of the processor; it took ten and more
  for (const std::string& word : server({"evaluate", take_.string()})) script += " '" + word + "'";
  expect_one_error(run({"/bin/bash", "-c", script}), "is 160 x 120, but rig.yaml says 16384 x 16384");
}

TEST_F(ServerFault, ATakeRemovedMidRun) {
  Process process(serve(source_, {"--loop"}));
  ASSERT_TRUE(process.wait_for_text("stream take")) << process.err();
  ASSERT_EQ(process.wait(500ms), std::nullopt) << process.err();
  fs::remove_all(take_);
  ASSERT_EQ(process.wait(), 1) << process.err();
  ASSERT_EQ(errors(process.err()).size(), 1U) << process.err();
  EXPECT_NE(errors(process.err())[0].find("was removed"), std::string::npos) << process.err();
  int said = 0;
  for (const std::string& line : lines(process.err())) said += line.find("was removed") != std::string::npos;
  EXPECT_EQ(said, 1) << process.err();
  EXPECT_EQ(names_in(folder_.path()), std::set<std::string>{});
}

TEST_F(ServerFault, ATakeOfOneFrameInALoop) {
  fs::remove_all(take_);
  ASSERT_TRUE(write_striped_take(striped_scene(), take_, 1));
  const Finished done = run(serve(source_, {"--loop"}));
  EXPECT_EQ(done.status, 1) << done.err;
  ASSERT_EQ(errors(done.err).size(), 1U) << done.err;
  EXPECT_NE(errors(done.err)[0].find("a surface needs two frames"), std::string::npos) << done.err;
}

TEST_F(ServerFault, NoTruthToScoreAgainst) {
  fs::remove_all(take_ / "truth");
  expect_one_error(run(server({"evaluate", take_.string()})), "truth");
}

TEST_F(ServerFault, TruthThatCannotBeLookedAt) {
  const fs::path truth = take_ / "truth" / "000002.npy";
  fs::remove(truth);
  fs::create_symlink("000002.npy", truth);
  expect_one_error(run(server({"evaluate", take_.string()})), "cannot read " + truth.string());
}

TEST_F(ServerFault, FramesAtTheStartAreSkippedWhateverTheirNumbers) {
  std::string stamps = "frame,time_s\n";
  for (int i = 4; i < 12; ++i) stamps += std::to_string(i) + "," + std::to_string((i - 4) / 29.97) + "\n";
  std::ofstream(take_ / "timestamps.csv", std::ios::binary) << stamps;
  const Finished done = run(server({"evaluate", take_.string(), "--skip", "3", "--json"}));
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_NE(done.out.find("\"of\": 5"), std::string::npos) << done.out;
}

TEST_F(ServerFault, ATakeOfWhichAllIsSkipped) {
  expect_one_error(run(server({"evaluate", take_.string(), "--skip", "100"})), "--skip 100 leaves out all");
}

TEST_F(ServerFault, ATakeOfWhichNothingDecodes) {
  // So bright that slides and white look the same: neither scored nor crashed.
  const std::string bright = (folder_.path() / "bright").string();
  ASSERT_EQ(run(server({"simulate", "--scene", "plane,width=192,height=144,stripes=30,ambient=0.8,exposure=3",
                        "--scheme", "white-field", "--frames", "6", "--out", bright}))
                .status,
            0);
  for (const std::string decoder : {"ordered", "quick"}) {
    expect_one_error(run(server({"evaluate", bright, "--decoder", decoder})), "could be scored");
    const Finished done = run(server({"reconstruct", bright, "--out", out_.string(), "--decoder", decoder}));
    EXPECT_EQ(done.status, 1);
    EXPECT_NE(done.err.find("over-exposed"), std::string::npos) << done.err;
  }
}

// What a camera saw does not come again: it was filmed to the end, and lost then.
TEST_F(ServerFault, CaptureSaysBeforehandThatItsTakeCannotBeWritten) {
  const fs::path none = folder_ / "none";
  for (const auto& [out, words] : {std::pair<fs::path, std::string>{take_, "exists already"},
                                   {"/proc/take", "cannot be created in /proc"}})
    expect_one_error(
        run(server({"capture", "--source", "take:" + none.string(), "--frames", "2", "--out", out.string()})),
        words);  // it has not even looked at the source
}

// As a camera that is unplugged, and stays away.
TEST_F(ServerFault, CaptureKeepsWhatItHasSeenOfASourceThatGivesNoMore) {
  const fs::path film = folder_ / "film";
  ASSERT_TRUE(write_striped_take(striped_scene(), film, 36));
  for (const std::string& name : names_in(film / "frames")) {
    if (name > "000005.png") fs::resize_file(film / "frames" / name, 200);
  }
  const Finished done = run(server(
      {"capture", "--source", "take:" + film.string(), "--frames", "36", "--out", out_.string(), "--json"}));
  EXPECT_EQ(done.status, 1);
  EXPECT_NE(done.err.find("has the 6 frames before"), std::string::npos) << done.err;
  EXPECT_NE(done.out.find("\"frames\": 6"), std::string::npos) << done.out;
  EXPECT_EQ(names_in(out_ / "frames").size(), 6U);
}

TEST_F(ServerFault, CaptureSaysBeforehandHowManyFramesMemoryHolds) {
  Process process(server({"capture", "--source", "sim:plane,width=4096,height=4096,scan=progressive",
                          "--frames", "50", "--out", out_.string()}));
  ASSERT_TRUE(process.wait_for_text("4 GiB of memory hold 42 of the 50 frames")) << process.err();
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_EQ(names_in(folder_.path()), (std::set<std::string>{"take"})) << process.err();
}

TEST_F(ServerFault, AFileWhereAFolderShouldBe) {
  std::ofstream(out_) << "mine\n";
  expect_one_error(run(server({"reconstruct", take_.string(), "--out", out_.string()})), out_.string());
  EXPECT_EQ(read_text(out_), "mine\n");
}

TEST_F(ServerFault, ResultsAreNotPutAmongTheTakesOwnFiles) {
  const fs::path link = folder_ / "link";
  fs::create_directory_symlink(take_, link);
  const std::set<std::string> before = names_in(take_);
  for (const std::string& out : {take_.string(), take_.string() + "/.", link.string(),
                                 (take_ / "frames").string() + "/", (take_ / "truth").string()}) {
    for (const std::string& take : {take_.string(), "take:" + take_.string()})
      expect_one_error(run(server({"reconstruct", take, "--out", out})), out + " holds the take's own files");
    expect_one_error(run(server({"evaluate", take_.string(), "--pictures", out})), "the take's own files");
  }
  EXPECT_EQ(names_in(take_), before);
  EXPECT_EQ(names_in(take_ / "frames").size(), 12U);
  EXPECT_EQ(run(server({"reconstruct", take_.string(), "--out", (take_ / "surfaces").string()})).status, 0);
}

TEST_F(ServerFault, SurfacesOfAnEarlierRunAreReplacedOrSpokenOf) {
  const auto reconstruct = [&] {
    return run(server({"reconstruct", take_.string(), "--out", out_.string()}));
  };
  ASSERT_EQ(reconstruct().status, 0);
  std::ofstream(out_ / "notes.txt") << "mine\n";
  // Of the same frames, one of which gives no surface now.
  fs::resize_file(take_ / "frames" / "000003.png", 200);
  EXPECT_EQ(reconstruct().status, 1);
  EXPECT_FALSE(names_in(out_).contains("000003.ply"));
  EXPECT_EQ(names_in(out_).size(), 10U + 1U);
  // Of frames that the take does not have.
  ASSERT_TRUE(write_striped_take(striped_scene(), take_, 6));
  std::set<std::string> before = names_in(out_);
  const Finished shorter = reconstruct();
  EXPECT_EQ(shorter.status, 0);
  EXPECT_THAT(shorter.err, testing::HasSubstr("has surfaces of frames that are none of this take's"));
  before.insert("000003.ply");
  EXPECT_EQ(names_in(out_), before);
  const fs::path sim = folder_ / "sim";
  const std::vector<std::string> simulated =
      server({"reconstruct", "sim:plane,width=96,height=64,stripes=20", "--out", sim.string()});
  fs::create_directory(sim);
  std::ofstream(sim / "000080_between.ply");  // a period has 80 frames
  EXPECT_THAT(run(simulated).err, testing::HasSubstr("000080_between.ply"));
}

TEST_F(ServerFault, SlidesOfAnEarlierPatternAreNotProjectedWithTheNewOnes) {
  const auto pattern = [&](const std::vector<std::string>& more) {
    std::vector<std::string> command{"pattern", "--size", "128x96",     "--stripes",
                                     "32",      "--out",  out_.string()};
    command.insert(command.end(), more.begin(), more.end());
    return run(server(command));
  };
  ASSERT_EQ(pattern({"--scheme", "white-frame"}).status, 0);
  EXPECT_EQ(pattern({"--scheme", "white-frame"}).status, 0);
  const std::set<std::string> before = names_in(out_);
  for (const std::vector<std::string>& other :
       {std::vector<std::string>{}, {"--interlaced"}, {"--both-axes"}, {"--gray"}})
    expect_one_error(pattern(other), "has other pictures");
  EXPECT_EQ(names_in(out_), before);
}

// Without the pattern that they were taken under, captures are lost.
TEST_F(ServerFault, ThePatternOfCapturesIsNotReplacedByAnother) {
  const auto pattern = [](const fs::path& out, const std::vector<std::string>& more) {
    std::vector<std::string> command{"pattern", "--size", "128x96", "--out", out.string()};
    command.insert(command.end(), more.begin(), more.end());
    return run(server(command));
  };
  const std::vector<std::string> first{"--stripes", "32"}, other{"--stripes", "16"};
  const std::string of_take = read_text(take_ / "pattern.yaml");
  expect_one_error(pattern(take_, first), "pattern.yaml is another pattern, which the captures");
  expect_one_error(pattern(take_, {"--stripes", "32", "--both-axes"}), "give a new folder");
  EXPECT_EQ(read_text(take_ / "pattern.yaml"), of_take);
  EXPECT_FALSE(names_in(take_).contains("slide1.png"));

  ASSERT_EQ(pattern(out_, first).status, 0);
  EXPECT_EQ(pattern(out_, other).status, 0) << "of slides alone";
  fs::create_directory(out_ / "pose 1");
  fs::copy_file(take_ / "frames" / "000000.png", out_ / "pose 1" / "1.png");
  EXPECT_EQ(pattern(out_, other).status, 0) << "the same again";
  expect_one_error(pattern(out_, first), "pattern.yaml is another pattern");

  const fs::path video = folder_ / "slides.mkv", yaml = folder_ / "slides.pattern.yaml";
  const auto play = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--seconds", "0.1"});
    return pattern(video, more);
  };
  ASSERT_EQ(play(first).status, 0);
  EXPECT_EQ(play(other).status, 0) << "both are replaced";
  fs::remove(video);
  expect_one_error(play(first), "slides.pattern.yaml is another pattern");
  EXPECT_FALSE(fs::exists(video));
  EXPECT_EQ(play(other).status, 0);
}

TEST_F(ServerFault, NoRoomForTheReconstruction) {
  // A limit on the size of files stands for a full disk: writing fails in the middle of one.
  std::string script = "trap '' XFSZ; ulimit -f 8; exec";
  for (const std::string& word : server({"reconstruct", take_.string(), "--out", out_.string()}))
    script += " '" + word + "'";
  const Finished done = run({"/bin/bash", "-c", script});
  expect_one_error(done, out_.string());
  EXPECT_FALSE(fs::exists(out_)) << "a half-written file was left, or a folder for none";
}

class ServerSignal : public TakeTest, public ::testing::WithParamInterface<int> {};

TEST_P(ServerSignal, EndsServeCleanly) {
  Process process(serve(source_, {"--loop"}));
  ASSERT_TRUE(process.wait_for_text("stream take")) << process.err();
  EXPECT_EQ(process.wait(200ms), std::nullopt) << process.err();
  process.signal(GetParam());
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_TRUE(errors(process.err()).empty()) << process.err();
}

TEST_P(ServerSignal, EndsSimulateWithNothingHalfWritten) {
  Process process(server({"simulate", "--scene", "walk", "--frames", "2000", "--out", out_.string()}));
  ASSERT_TRUE(eventually([&] { return names_in(folder_.path()).size() == 2; }))
      << process.err();  // with the take
  process.signal(GetParam());
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_TRUE(errors(process.err()).empty()) << process.err();
  EXPECT_NE(process.err().find("stopped: nothing was written to " + out_.string()), std::string::npos)
      << process.err();
  EXPECT_EQ(names_in(folder_.path()), std::set<std::string>{"take"});
}

TEST_P(ServerSignal, EndsReconstructSayingOfHowManyFrames) {
  Process process(server({"reconstruct", "sim:walk,width=1280,height=960", "--out", out_.string()}));
  ASSERT_TRUE(eventually([&] { return names_in(out_).size() > 1; })) << process.err();
  process.signal(GetParam());
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_THAT(process.out(), testing::HasSubstr(" of 80 frames reconstructed into " + out_.string()));
  EXPECT_THAT(process.err(), testing::HasSubstr("stopped: a part of the frames is reconstructed"));
}

INSTANTIATE_TEST_SUITE_P(Signals, ServerSignal, ::testing::Values(SIGINT, SIGTERM, SIGHUP),
                         [](const auto& number) { return std::string(sigabbrev_np(number.param)); });

}  // namespace
}  // namespace relievo::test
