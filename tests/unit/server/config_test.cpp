// SPDX-License-Identifier: Apache-2.0
#include "server/config.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "cli/web_flags.h"
#include "server/camera_flags.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/server/read_config.h"

namespace relievo {
namespace {

using test::Read;
using test::read;

TEST(Config, ATableOfAStreamWithOneBracketIsToldSo) {
  const Read one = read("source = \"sim:face\"\n[stream]\nname = \"left\"\n");
  ASSERT_FALSE(one.status);
  EXPECT_NE(one.status.error().message.find(":2: stream is a table with one bracket: write [[stream]]"),
            std::string::npos)
      << one.status.error().message;
}

// The file that is installed is the manual: each setting is in it, and each line of it is one.
TEST(Config, TheInstalledFileNamesEverySettingAndAllOfItIsTaken) {
  const std::regex setting(R"(#?((\w+) = .*|\[\w+\]))");
  const std::regex example(R"(#   ((\w+) = .*|\[\[stream\]\]))");  // what stands in place of other lines
  std::ifstream in(std::string(RELIEVO_SOURCE_DIR) + "/packaging/server.toml");
  std::string all, several;
  std::set<std::string> named;
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (std::regex_match(line, match, example)) {
      several += match[1].str() + "\n";
      named.insert(match[2]);
    }
    if (!std::regex_match(line, match, setting)) continue;
    all += match[1].str() + "\n";
    named.insert(match[2]);
  }
  const Read whole = read(all);
  ASSERT_TRUE(whole.status) << whole.status.error().message;
  EXPECT_EQ(whole.config.camera.controls.size(), 3U);
  const Read rigs = read(several);
  ASSERT_TRUE(rigs.status) << rigs.status.error().message;
  EXPECT_EQ(rigs.config.streams.size(), 2U);

  for (const std::string table :
       {"", "[recording]\n", "[projector]\n", "[gateway]\n", "[camera]\n", "[[stream]]\n"}) {
    const Read wrong = read(table + "nonsense = 1\n");
    ASSERT_FALSE(wrong.status);
    std::istringstream known(wrong.status.error().message);
    std::string word;
    while (known >> word && word != "are:") continue;
    int count = 0;
    for (; known >> word; ++count)
      EXPECT_TRUE(named.contains(word) || all.find("[" + word + "]") != std::string::npos) << word;
    EXPECT_GT(count, 0);
  }
}

TEST(Config, TheLadderIsAListOfLowerQualities) {
  EXPECT_EQ(read("").config.ladder, (std::vector{Rung::kReduced, Rung::kTexture, Rung::kSlow}));
  EXPECT_EQ(read("ladder = []\n").config.ladder, std::vector<Rung>{});
  EXPECT_EQ(read("ladder = [\"texture\"]\n").config.ladder, std::vector{Rung::kTexture});
  EXPECT_EQ(read("ladder = [\"texture\", \"reduced\", \"texture\"]\n").config.ladder,
            (std::vector{Rung::kReduced, Rung::kTexture}));
  for (const char* wrong :
       {"[\"full\"]", "[\"none\"]", "[\"reduced,texture\"]", "[\"\"]", "\"reduced\"", "[1]"}) {
    const Read r = read(std::string("loop = true\nladder = ") + wrong + "\n");
    ASSERT_FALSE(r.status) << wrong;
    EXPECT_TRUE(r.status.error().message.starts_with(r.file + ":2: ladder")) << r.status.error().message;
  }
  EXPECT_TRUE(parse_ladder("none").value().empty());
  EXPECT_FALSE(parse_ladder(""));
  EXPECT_FALSE(parse_ladder("reduced,full"));
  EXPECT_FALSE(parse_ladder("reduced,reduced-jpeg")) << "those come by themselves";
}

TEST(Config, ADecoderOrHowItIsChosen) {
  const Read chosen = read("decoder = \"auto\"\n");
  ASSERT_TRUE(chosen.status) << chosen.status.error().message;
  EXPECT_TRUE(served_decoder(chosen.config).auto_pace);
  EXPECT_EQ(served_decoder(chosen.config).decoder, Decoder::kOrdered);
  ServeConfig config = chosen.config;
  EXPECT_FALSE(find_mistake(config));
  config.half_lines = true;
  const auto both = find_mistake(config);
  ASSERT_TRUE(both);
  EXPECT_EQ(both->setting, "half_lines");
  EXPECT_NE(both->error.message.find("name a decoder"), std::string::npos) << both->error.message;
  EXPECT_TRUE(set_decoder("quick", config));  // as a flag behind the file
  EXPECT_FALSE(served_decoder(config).auto_pace);
  EXPECT_EQ(served_decoder(config).decoder, Decoder::kQuick);
  EXPECT_FALSE(set_decoder("best", config));
}

TEST(Config, EverySetting) {
  const Read r = read(R"(# a comment
source = "take:shared/bunny"
scheme = "white-frame"
stream = "bunny"
domain = 7
web = "[::1]:9000"
record = "out.mcap"
frames = 900
loop = true
fast = true
threads = 3
decoder = "quick"
texture = "webp"
texture_quality = 91
texture_encoder = "x264"
bitrate = 4_000_000
deadline = 12.5
psnr = 38
draco_speed = 4
geometry = "draco-mesh"
step_bits = 5
key_interval = 15
bound = 0.25
half_lines = true
dense = true
fill_holes = 3
)");
  ASSERT_TRUE(r.status) << r.status.error().message;
  EXPECT_EQ(r.config.source, "take:shared/bunny");
  EXPECT_EQ(r.config.scheme, "white-frame");
  EXPECT_EQ(r.config.stream, "bunny");
  EXPECT_EQ(r.config.domain, 7);
  EXPECT_EQ(r.config.web, "[::1]:9000");
  EXPECT_EQ(r.config.record, "out.mcap");
  EXPECT_EQ(r.config.frames, 900U);
  EXPECT_TRUE(r.config.loop);
  EXPECT_TRUE(r.config.fast);
  EXPECT_EQ(r.config.threads, 3);
  EXPECT_EQ(served_decoder(r.config).decoder, Decoder::kQuick);
  EXPECT_EQ(r.config.texture, TextureCodec::kWebp);
  EXPECT_EQ(r.config.texture_quality, 91);
  EXPECT_EQ(r.config.texture_encoder, VideoEncoderKind::kX264);
  EXPECT_EQ(r.config.rate.bit_rate, 4e6);
  EXPECT_EQ(r.config.rate.deadline_ms, 12.5);
  EXPECT_EQ(r.config.rate.texture_db, 38);
  EXPECT_EQ(r.config.draco_speed, 4);
  EXPECT_EQ(r.config.geometry, "draco-mesh");
  EXPECT_EQ(r.config.step_bits, 5);
  EXPECT_EQ(r.config.key_interval, 15);
  EXPECT_EQ(r.config.bound_px, 0.25);
  EXPECT_TRUE(r.config.half_lines);
  EXPECT_TRUE(r.config.surface.dense);
  EXPECT_EQ(r.config.surface.fill_holes, 3);
}

TEST(Config, ADecoderThatIsNotSaidIsChosenWhereTheCameraSetsThePace) {
  StreamConfig config;
  EXPECT_EQ(served_decoder(config), (ServedDecoder{Decoder::kOrdered, true}));
  config.half_lines = true;
  EXPECT_EQ(served_decoder(config), (ServedDecoder{Decoder::kOrdered, false}));
  EXPECT_TRUE(check_lines(config));
  config = {.fast = true};
  EXPECT_EQ(served_decoder(config), (ServedDecoder{Decoder::kOrdered, false}));
  ASSERT_TRUE(set_decoder("auto", config));
  EXPECT_TRUE(served_decoder(config).auto_pace);
}

TEST(Config, ARecordingsTable) {
  const Read r = read(R"(record = "a.mcap"
[recording]
split_size = "2GB"
split_every = "10min"
keep_size = "100GB"
keep_for = "7d"
sync = "5s"
)");
  ASSERT_TRUE(r.status) << r.status.error().message;
  const auto options = recording_options(r.config.recording);
  ASSERT_TRUE(options) << options.error().message;
  EXPECT_EQ(options->segments.split_bytes, 2'000'000'000u);
  EXPECT_EQ(options->segments.split_s, 600);
  EXPECT_EQ(options->segments.keep_bytes, 100'000'000'000u);
  EXPECT_EQ(options->segments.keep_s, 7 * 86400);
  EXPECT_EQ(options->sync_s, 5);
  const auto flags_win = recording_options(merged({.keep_for = "1h", .sync = "none"}, r.config.recording));
  EXPECT_EQ(flags_win->segments.keep_s, 3600);
  EXPECT_EQ(flags_win->segments.split_s, 600);
  EXPECT_LT(flags_win->sync_s, 0);
  EXPECT_FALSE(recording_options({.keep_size = "1GB"}).ok()) << "nothing ends that could be removed";
  EXPECT_EQ(recording_options({.sync = "chunk"})->sync_s, 0);
}

TEST(Config, AFlagThatClosesTheGatewayWins) {
  const WebOptions open{.open = true};
  EXPECT_EQ(merged(WebOptions{.open = false}, open).open, false);
  EXPECT_EQ(merged(WebOptions{}, open).open, true);
  EXPECT_EQ(merged(open, WebOptions{}).open, true);
}

TEST(Config, RecordingsOnRequest) {
  const Read r = read("[recording]\nfolder = \"takes\"\npre_roll = \"10s\"\n");
  ASSERT_TRUE(r.status) << r.status.error().message;
  EXPECT_EQ(r.config.record_folder, "takes");
  EXPECT_EQ(parse_pre_roll_s(r.config.pre_roll).value(), 10);
  EXPECT_EQ(parse_pre_roll_s(ServeConfig().pre_roll).value(), 0);
  EXPECT_FALSE(parse_pre_roll_s("-1").ok());
  EXPECT_FALSE(parse_pre_roll_s("soon").ok());
}

TEST(Config, SeveralStreamsHaveInCommonWhatIsSaidOutsideThem) {
  const Read r = read(R"(texture = "webp"
threads = 2
[camera]
format = "YUYV"
[[stream]]
name = "left"
source = "v4l2:/dev/video0"
[stream.camera]
rig = "left.yaml"
[[stream]]
source = "sim:walk"
threads = 3
)");
  ASSERT_TRUE(r.status) << r.status.error().message;
  const std::vector<StreamConfig> streams = r.config.all_streams();
  ASSERT_EQ(streams.size(), 2U);
  EXPECT_EQ(name_of(streams[0]), "left");
  EXPECT_EQ(streams[0].camera.rig, "left.yaml");
  EXPECT_EQ(streams[0].camera.format, "YUYV");
  EXPECT_EQ(streams[0].texture, TextureCodec::kWebp);
  EXPECT_EQ(streams[0].threads, 2);
  EXPECT_EQ(name_of(streams[1]), "walk");
  EXPECT_EQ(streams[1].texture, TextureCodec::kWebp);
  EXPECT_EQ(streams[1].threads, 3);
  EXPECT_EQ(read("source = \"sim:walk\"\n").config.all_streams().size(), 1U);
}

TEST(Config, SeveralStreamsMustNotBeMixedUp) {
  const Read names = read("[[stream]]\nname = \"a\"\n[[stream]]\nname = \"a\"\n");
  ASSERT_FALSE(names.status);
  EXPECT_EQ(names.status.error().message.find(names.file + ":3: two streams are called 'a'"), 0U)
      << names.status.error().message;
  const Read files = read("record = \"a.mcap\"\n[[stream]]\n[[stream]]\nname = \"b\"\n");
  ASSERT_FALSE(files.status);
  EXPECT_NE(files.status.error().message.find(":3: two streams are recorded to a.mcap"), std::string::npos)
      << files.status.error().message;
  const std::string here = std::filesystem::current_path() / "rec" / "a.mcap";
  for (const std::string& same : {std::string("rec/../rec/a.mcap"), std::string("./rec//a.mcap"), here}) {
    const Read twice =
        read("[[stream]]\nname = \"a\"\nrecord = \"rec/a.mcap\"\n[[stream]]\nname = \"b\"\nrecord = \"" +
             same + "\"\n");
    ASSERT_FALSE(twice.status) << same;
    EXPECT_NE(twice.status.error().message.find(":4: two streams are recorded to " + same), std::string::npos)
        << twice.status.error().message;
  }
  EXPECT_TRUE(read("[[stream]]\nname = \"a\"\nrecord = \"rec/a.mcap\"\n"
                   "[[stream]]\nname = \"b\"\nrecord = \"rec/b.mcap\"\n[[stream]]\nname = \"c\"\n")
                  .status);
}

TEST(Config, ACamerasTable) {
  const Read r = read(R"(source = "v4l2:/dev/video0"
[camera]
rig = "rig.yaml"
pattern = "stripes.yaml"
input = "S-Video"
standard = "NTSC-M"
format = "UYVY"
size = "720x480"
rate = 29.97
field = "alternate"
field_order = "top"
odd_pairs = true
dmabuf = true
buffers = 4
[camera.controls]
white_balance_automatic = false
exposure_auto = "manual_mode"
exposure = 100
)");
  ASSERT_TRUE(r.status) << r.status.error().message;
  const CameraOptions& c = r.config.camera;
  EXPECT_EQ(c.rig, "rig.yaml");
  EXPECT_EQ(c.pattern, "stripes.yaml");
  EXPECT_EQ(c.input, "S-Video");
  EXPECT_EQ(c.standard, "NTSC-M");
  EXPECT_EQ(c.format, "UYVY");
  EXPECT_EQ(c.width, 720);
  EXPECT_EQ(c.height, 480);
  EXPECT_EQ(c.rate, 29.97);
  EXPECT_EQ(c.field, "alternate");
  EXPECT_EQ(c.field_order, "top");
  EXPECT_TRUE(c.odd_pairs);
  EXPECT_TRUE(c.dmabuf);
  EXPECT_EQ(c.buffers, 4);
  ASSERT_EQ(c.controls.size(), 3u);  // in the order of the lines
  EXPECT_EQ(c.controls[0].name + "=" + c.controls[0].value, "white_balance_automatic=0");
  EXPECT_EQ(c.controls[1].name + "=" + c.controls[1].value, "exposure_auto=manual_mode");
  EXPECT_EQ(c.controls[2].name + "=" + c.controls[2].value, "exposure=100");
}

TEST(Config, FlagsOfACameraWin) {
  CameraOptions file{.format = "YUYV", .rate = 30, .controls = {{"gain", "1"}}};
  const CameraOptions flags{.rate = 60, .dmabuf = true, .controls = {{"gain", "2"}}};
  const CameraOptions both = merged(file, flags);
  EXPECT_EQ(both.format, "YUYV");
  EXPECT_EQ(both.rate, 60);
  EXPECT_TRUE(both.dmabuf);
  ASSERT_EQ(both.controls.size(), 2u);
  EXPECT_EQ(both.controls[1].value, "2");  // set last
}

TEST(Config, WhatIsNotNamedStays) {
  const test::TempFolder folder;
  const auto file = folder / "serve.toml";
  std::ofstream(file) << "threads = 2\n";
  ServeConfig config;
  config.source = "sim:torso";
  config.domain = 3;
  ASSERT_TRUE(read_config(file, config));
  EXPECT_EQ(config.threads, 2);
  EXPECT_EQ(config.source, "sim:torso");
  EXPECT_EQ(config.domain, 3);
  EXPECT_EQ(config.web, ServeConfig().web);
  EXPECT_FALSE(config.frames);
  EXPECT_FALSE(config.loop);
  EXPECT_TRUE(read("").status);
}

TEST(Config, Gateway) {
  const Read r = read(R"([gateway]
tls_cert = "rig.pem"
tls_key = "rig.key"
token_file = "tokens"
open = false
allow_origins = ["https://a.example", "http://b:8080"]
max_clients = 200
max_per_address = 4
max_rate = 50
)");
  ASSERT_TRUE(r.status) << r.status.error().message;
  const WebOptions& gateway = r.config.gateway;
  EXPECT_EQ(gateway.tls_cert, "rig.pem");
  EXPECT_EQ(gateway.tls_key, "rig.key");
  EXPECT_EQ(gateway.token_file, "tokens");
  EXPECT_EQ(gateway.origins, (std::vector<std::string>{"https://a.example", "http://b:8080"}));
  EXPECT_EQ(gateway.max_clients, 200);
  EXPECT_EQ(gateway.max_per_address, 4);
  EXPECT_EQ(gateway.max_rate, 50);
}

/// What a file is refused for whose settings are sound one by one.
std::string mistake_of(const std::string& text) {
  const test::TempFolder folder;
  const auto file = folder / "serve.toml";
  std::ofstream(file) << text;
  ServeConfig config;
  SettingLines lines;
  const Status read = read_config(file, config, &lines);
  EXPECT_TRUE(read) << read.error().message;
  const auto mistake = find_mistake(config);
  return mistake ? mistake_in("serve.toml", lines, *mistake).message : "";
}

TEST(Config, AMistakenSourceIsToldWithoutOpeningIt) {
  for (const char* sound : {"sim:face", "sim:walk,stripes=70,drop=50", "sim:mesh:none.ply",
                            "sim:board:chessboard:9x7:25mm,seed=2", "sim:sheet", "take:none",
                            "sim:face,period=10000,width=4096,height=4096"})
    EXPECT_EQ(mistake_of(std::string("source = \"") + sound + "\"\n"), "") << sound;
  for (const auto& [source, says] :
       {std::pair("bogus:x", "no known kind"), std::pair("face", "no known kind"),
        std::pair("sim:nope", "unknown scene \"nope\": give one of plane"),
        std::pair("sim:face,stripe=70", "unknown key \"stripe\""),
        std::pair("sim:face,stripes=many", "stripes=many"),
        std::pair("sim:face,stripes=8192,base=3,slides=2", "sim:face"),
        std::pair("sim:board:nope", "sim:board:nope"), std::pair("sim:sheets", "there is sheet")}) {
    const std::string message = mistake_of(std::string("\nsource = \"") + source + "\"\n");
    EXPECT_TRUE(message.starts_with("serve.toml:2: source: ")) << message;
    EXPECT_NE(message.find(says), std::string::npos) << message;
  }
}

TEST(Config, WhatDoesNotGoTogetherIsToldInTheFilesWords) {
  struct Case {
    const char *text, *says;
  };
  for (const auto& [text, says] : {
           Case{"[gateway]\ntls_cert = \"a.pem\"\n",
                "serve.toml:2: gateway.tls_cert: a certificate needs its key: give tls_cert and tls_key "
                "together"},
           Case{"[gateway]\ntoken_file = \"a\"\nopen = true\n",
                "serve.toml:3: gateway.open: open lets everybody watch, token_file only who has a token"},
           Case{"decoder = \"auto\"\nhalf_lines = true\n", "serve.toml:2: half_lines: decoder auto"},
           Case{"psnr = 38\ntexture = \"png\"\n", "serve.toml:1: psnr: psnr is kept"},
           Case{"[recording]\nkeep_size = \"1GB\"\n",
                "serve.toml:2: recording.keep_size: keep_size and keep_for remove whole files: give "
                "split_size"},
           Case{"scheme = \"one-slide\"\nsource = \"take:a\"\n",
                "serve.toml:2: source: scheme is for simulated sources"},
           Case{"source = \"v4l2:a\"\n",
                "serve.toml: camera.rig: a camera needs its calibrated rig: give rig, "},
           Case{"half_lines = true\n[[stream]]\nname = \"a\"\n[[stream]]\nname = \"b\"\ndecoder = \"auto\"\n",
                "serve.toml:1: half_lines: stream b: decoder auto"},
           Case{"[[stream]]\nname = \"a\"\n[[stream]]\nname = \"b\"\nsource = \"sim:nope\"\n",
                "serve.toml:5: source: stream b: sim:nope: unknown scene"},
       }) {
    const std::string message = mistake_of(text);
    EXPECT_TRUE(message.starts_with(says)) << message;
    EXPECT_EQ(message.find(" --"), std::string::npos) << message;
  }
}

TEST(Config, AGeometryProfileSaysWhatIsNotSaidOtherwise) {
  ServeConfig config;
  EXPECT_EQ(encode_options(config).key_interval, 1);
  config.geometry = "metric";
  EXPECT_TRUE(encode_options(config).estimate);
  EXPECT_EQ(encode_options(config).key_interval, 30);
  EXPECT_EQ(encode_options(config).bound_px, 0);
  config.geometry = "visual";
  EXPECT_EQ(encode_options(config).bound_px, 0.5F);
  config.bound_px = 0.25;
  config.key_interval = 7;
  EXPECT_EQ(encode_options(config).bound_px, 0.25F);
  EXPECT_EQ(encode_options(config).key_interval, 7);
}

}  // namespace
}  // namespace relievo
