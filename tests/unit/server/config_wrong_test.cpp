// SPDX-License-Identifier: Apache-2.0
// Configurations that are refused: the message names file, line and why.
#include <gtest/gtest.h>

#include <string>

#include "server/config.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/server/read_config.h"

namespace relievo {
namespace {

using test::Read;
using test::read;

struct Wrong {
  const char* name;
  const char* line;  // the third of the file
  const char* says;
};

class WrongConfig : public ::testing::TestWithParam<Wrong> {};

TEST_P(WrongConfig, NamesFileLineAndWhy) {
  const Read r = read(std::string("# one\n\n") + GetParam().line + "\n");
  ASSERT_FALSE(r.status);
  const std::string& message = r.status.error().message;
  EXPECT_EQ(message.find(r.file + ":3: "), 0U) << message;
  EXPECT_NE(message.find(GetParam().says), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    Values, WrongConfig,
    ::testing::Values(
        Wrong{"source_number", "source = 7", "source must be a string"},
        Wrong{"stream_flag", "stream = true", "stream must be a string"},
        Wrong{"web_number", "web = 8080", "web must be a string"},
        Wrong{"web_wrong", "web = \"8080\"", "web is wrong: '8080' is no HOST:PORT"},
        Wrong{"stream_wrong", "stream = \"two words\"", "stream is wrong: 'two words' cannot name a stream"},
        Wrong{"record_zero", "record = \"a\\u0000.mcap\"", "record must have no control characters"},
        Wrong{"origin_line", "gateway = {allow_origins = [\"https://a\\n\"]}",
              "must have no control characters"},
        Wrong{"camera_field", "camera = {field = \"both\"}",
              "field is wrong: 'both' is none of progressive, "},
        Wrong{"camera_order", "camera = {field_order = \"left\"}", "'left' is none of top, bottom"},
        Wrong{"record_list", "record = [\"a\"]", "record must be a string"},
        Wrong{"domain_text", "domain = \"0\"", "domain must be a whole number from 0 to 230"},
        Wrong{"domain_negative", "domain = -1", "domain must be a whole number from 0 to 230"},
        Wrong{"domain_large", "domain = 231", "domain must be a whole number from 0 to 230"},
        Wrong{"domain_fraction", "domain = 1.0", "domain must be a whole number"},
        Wrong{"frames_none", "frames = 0", "frames must be a whole number from 1"},
        Wrong{"frames_negative", "frames = -5", "frames must be a whole number from 1"},
        Wrong{"loop_number", "loop = 1", "loop must be true or false"},
        Wrong{"loop_text", "loop = \"yes\"", "loop must be true or false"},
        Wrong{"fast_number", "fast = 0", "fast must be true or false"},
        Wrong{"scheme_unknown", "scheme = \"striped\"",
              "scheme must be complementary, white-field, white-frame or one-slide in quotes"},
        Wrong{"decoder_unknown", "decoder = \"best\"",
              "decoder must be \"ordered\", \"quick\", \"auto\" or \"paper\""},
        Wrong{"threads_none", "threads = 0", "threads must be a whole number from 1 to 64"},
        Wrong{"threads_many", "threads = 65", "threads must be a whole number from 1 to 64"},
        Wrong{"encoder", "texture_encoder = \"quicksync\"",
              "texture_encoder must be auto, x264, nvenc, vaapi or v4l2m2m in quotes"},
        Wrong{"quality_none", "texture_quality = 0", "texture_quality must be a whole number from 1 to 100"},
        Wrong{"quality_over", "texture_quality = 101", "texture_quality must be a whole number"},
        Wrong{"holes_over", "fill_holes = 17", "fill_holes must be a whole number from 0 to 16"},
        Wrong{"speed_over", "draco_speed = 10", "draco_speed must be a whole number from 0 to 9"},
        Wrong{"speed_huge", "draco_speed = 4294967297", "draco_speed must be a whole number"},
        Wrong{"geometry_unknown", "geometry = \"mesh\"",
              "geometry must be grid, metric, visual, draco-grid or draco-mesh in quotes"},
        Wrong{"steps_over", "step_bits = 9", "step_bits must be a whole number from 0 to 8"},
        Wrong{"bound_over", "bound = 9", "bound must be a number of pixels from 0.01 to 8"},
        Wrong{"keys_none", "key_interval = 0", "key_interval must be a whole number from 1 to 1000"},
        Wrong{"unknown", "quality = 80", "quality is no setting; there are: source scheme"},
        Wrong{"deadline_none", "deadline = 0", "deadline must be a number of milliseconds from 0.5 to 1000"},
        Wrong{"deadline_text", "deadline = \"12ms\"", "deadline must be a number of milliseconds"},
        Wrong{"deadline_not", "deadline = nan", "deadline must be a number of milliseconds"},
        Wrong{"psnr_fine", "psnr = 61", "psnr must be a number of decibels from 20 to 60"},
        Wrong{"bitrate_low", "bitrate = 4", "bitrate must be a whole number from 100000"},
        Wrong{"texture_unknown", "texture = \"gif\"", "texture must be jpeg, webp, png or h264"},
        Wrong{"part_of_a_name", "quality = 80", "quality is no setting"},
        Wrong{"two_names", "\"loop fast\" = true", "loop fast is no setting"},
        Wrong{"names_and_gap", "\"loop  fast\" = true", "loop  fast is no setting"},
        Wrong{"no_name", "\"\" = true", "is no setting"},
        Wrong{"table", "[source]", "source must be a string"},
        Wrong{"gateway_text", "gateway = \"open\"", "gateway must be a table: write [gateway]"},
        Wrong{"gateway_open", "gateway = {open = 1}", "open must be true or false"},
        Wrong{"gateway_origin", "gateway = {allow_origins = [\"example.org\"]}",
              "'example.org' is no origin"},
        Wrong{"gateway_origins", "gateway = {allow_origins = \"https://a\"}", "must be a list of strings"},
        Wrong{"gateway_clients", "gateway = {max_clients = 0}", "max_clients must be a whole number from 1"},
        Wrong{"camera_text", "camera = \"v4l2\"", "camera must be a table: write [camera]"},
        Wrong{"camera_unknown", "camera = {zoom = 3}", "zoom is no setting; there are: rig pattern input"},
        Wrong{"camera_size", "camera = {size = \"big\"}", "size must be a size such as \"640x480\""},
        Wrong{"camera_rate", "camera = {rate = -1}", "rate must be a number of pictures a second from 0.1"},
        Wrong{"camera_buffers", "camera = {buffers = 1}", "buffers must be a whole number from 2 to 32"},
        Wrong{"camera_control", "camera = {controls = {gain = 1.5}}",
              "gain must be a whole number, true, false"},
        Wrong{"camera_controls", "camera = {controls = 7}", "controls must be a table of controls"},
        Wrong{"recording_split", "recording = {split_size = \"big\"}",
              "split_size is wrong: 'big' is no size"},
        Wrong{"recording_sync", "recording = {sync = \"often\"}", "sync is wrong: 'often' is neither chunk"},
        Wrong{"recording_number", "recording = {keep_for = 7}", "keep_for must be a string in quotes"},
        Wrong{"recording_pre_roll", "recording = {pre_roll = \"long\"}", "pre_roll is wrong: 'long' is no"},
        Wrong{"stream_unknown", "stream = [{sorce = \"sim:face\"}]",
              "sorce is no setting; there are: name source"},
        Wrong{"stream_name", "stream = [7]", "stream must be a string"},
        Wrong{"unknown_table", "[server]", "server is no setting"}),
    [](const auto& wrong) { return wrong.param.name; });

TEST(Config, WhatIsNoTomlNamesTheLine) {
  for (const char* text : {"\n\nsource = sim:face\n", "\n\nloop = true fast = true\n", "\n\nthreads\n"}) {
    const Read r = read(text);
    ASSERT_FALSE(r.status) << text;
    EXPECT_EQ(r.status.error().message.find(r.file + ":3: "), 0U) << r.status.error().message;
    EXPECT_EQ(r.status.error().message.find('\n'), std::string::npos) << r.status.error().message;
  }
  const Read twice = read("loop = true\nloop = false\n");
  ASSERT_FALSE(twice.status);
  EXPECT_EQ(twice.status.error().message.find(twice.file + ":2: "), 0U) << twice.status.error().message;
}

TEST(Config, MissingFileAndFolder) {
  const test::TempFolder folder;
  ServeConfig config;
  Status status = read_config(folder / "none.toml", config);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find((folder / "none.toml").string()), std::string::npos);
  status = read_config(folder.path(), config);  // a folder is no configuration
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find(folder.path().string()), std::string::npos);
}

TEST(Config, WhatHasNoEndIsRefused) {
  ServeConfig config;
  const Status status = read_config("/dev/zero", config);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("/dev/zero"), std::string::npos) << status.error().message;
}

}  // namespace
}  // namespace relievo
