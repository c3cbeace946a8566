// SPDX-License-Identifier: Apache-2.0
// A recording made into something else: exported, coded anew, and read by others' MCAP readers and viewers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "codec/frame_layout.h"
#include "codec/texture_codec.h"
#include "tests/e2e/record_play.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

using testing::HasSubstr;

TEST(RecordingFormats, FramesAreDescribedAndExported) {
  const TempFolder folder;
  const auto file = folder / "real.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(file, 0, 12));
  const auto description = info(file);
  EXPECT_EQ(description["geometry_codecs"], nlohmann::json({"draco-mesh"}));
  EXPECT_EQ(description["texture_codecs"], nlohmann::json({"jpeg"}));
  EXPECT_EQ(description["texture_size"], nlohmann::json({64, 48}));
  EXPECT_GT(description["mean_vertices"], 200);
  EXPECT_EQ(description["unreadable"], 0);
  EXPECT_GT(description["bytes"]["geometry"], 0);
  EXPECT_GT(description["bytes"]["texture"], 0);

  std::vector<std::string> numbers;  // of the camera's frames, which files are named after
  const std::vector<Bytes> frames = recorded_frames(file);
  ASSERT_EQ(frames.size(), 12u);
  for (int i = 2; i <= 4; ++i) {
    const std::string number = std::to_string(read_frame_cdr(frames[static_cast<std::size_t>(i)])->number);
    numbers.push_back(std::string(6 - number.size(), '0') + number);
  }
  const std::vector<std::pair<std::string, std::string>> magic = {
      {"ply", "ply\n"}, {"glb", "glTF"}, {"obj", ""}, {"png", "\x89PNG"}};
  for (const auto& [format, start] : magic) {
    const auto out = folder / format;
    const auto done = run(
        {program("relievo"), "export", file, "--out", out, "--format", format, "--frames", "2:4", "--json"});
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_EQ(nlohmann::json::parse(done.out)["frames"], 3);
    for (const std::string& number : numbers) {
      std::ifstream exported(out / (number + "." + format), std::ios::binary);
      std::string head(start.size(), '\0');
      EXPECT_TRUE(exported.read(head.data(), static_cast<std::streamsize>(head.size()))) << format << number;
      EXPECT_EQ(head, start);
    }
  }
  const auto played = run(on_loopback({"play", file, "--frames", "2:4", "--speed", "10", "--json"}));
  ASSERT_EQ(played.status, 0) << played.err;
  EXPECT_EQ(nlohmann::json::parse(played.out)["frames"], 3);
  const auto later = run(on_loopback({"play", file, "--from", "2030-01-01T00:00:00Z"}));
  EXPECT_EQ(later.status, 1);
  EXPECT_THAT(later.err, HasSubstr("it holds 12 frames in"));
  const auto late = run({program("relievo"), "export", file, "--out", folder / "x", "--from", "99"});
  EXPECT_EQ(late.status, 1);
  EXPECT_THAT(late.err, HasSubstr("no frame in that range"));
}

TEST(RecordingFormats, EveryFrameHasAFileOfItsOwn) {
  const TempFolder folder;
  const std::string file = folder / "white.mcap";
  const auto served = run({program("relievo-server"), "serve", "--source", "sim:face,width=320,height=240",
                           "--scheme", "white-field", "--web", "none", "--domain", kDomain, "--interface",
                           "lo", "--fast", "--frames", "5", "--record", file});
  ASSERT_EQ(served.status, 0) << served.err;
  const auto count = recorded_frames(file).size();
  ASSERT_GT(count, 5u) << "two surfaces a frame";
  const auto files_of = [&](const std::string& verb, const std::string& out) {
    const auto done = run({program("relievo"), verb, file, "--out", folder / out, "--json"});
    EXPECT_EQ(done.status, 0) << done.err;
    std::size_t files = 0, between = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder / out)) {
      ++files;
      between += entry.path().stem().string().ends_with("_between");
    }
    EXPECT_GT(between, 1u);
    return files;
  };
  EXPECT_EQ(files_of("export", "ply"), count);
  EXPECT_EQ(files_of("shot", "png"), count);
}

TEST(RecordingFormats, ARecordingIsCodedAnew) {
  const TempFolder folder;
  const std::string original = folder / "fine.mcap";
  const auto served = run({program("relievo-server"), "serve", "--source",
                           "sim:plane,width=160,height=120,stripes=30", "--web", "none", "--domain", kDomain,
                           "--interface", "lo", "--fast", "--frames", "12", "--record", original});
  ASSERT_EQ(served.status, 0) << served.err;
  const auto frames = info(original)["frames"].get<int>();
  ASSERT_GT(frames, 8);
  const auto convert = [&](const std::string& from, const std::string& to, std::vector<std::string> more) {
    more.insert(more.begin(), {program("relievo"), "convert", from, "--out", folder / to, "--json"});
    return run(more);
  };
  const auto coarse =
      convert(original, "coarse.mcap", {"--step-bits", "2", "--key-interval", "4", "--from", "0"});
  ASSERT_EQ(coarse.status, 0) << coarse.err;
  const auto result = nlohmann::json::parse(coarse.out);
  EXPECT_EQ(result["frames"], frames);
  EXPECT_LT(result["bytes_after"], result["bytes_before"]);
  EXPECT_EQ(info(folder / "coarse.mcap")["geometry_codecs"], nlohmann::json({"grid"}));
  EXPECT_EQ(info(folder / "coarse.mcap")["mean_vertices"], info(original)["mean_vertices"]);
  const auto exported = run({program("relievo"), "export", folder / "coarse.mcap", "--out", folder / "ply",
                             "--frames", "6:7", "--json"});
  ASSERT_EQ(exported.status, 0) << exported.err;
  EXPECT_EQ(nlohmann::json::parse(exported.out)["frames"], 2);

  const auto in_draco = convert(original, "draco.mcap", {"--geometry", "draco-grid", "--step-bits", "4"});
  ASSERT_EQ(in_draco.status, 0) << in_draco.err;
  EXPECT_EQ(info(folder / "draco.mcap")["geometry_codecs"], nlohmann::json({"draco-grid"}));
  EXPECT_EQ(info(folder / "draco.mcap")["mean_vertices"], info(original)["mean_vertices"]);
  const auto grid = convert(folder / "draco.mcap", "grid.mcap", {"--geometry", "grid", "--step-bits", "4"});
  EXPECT_EQ(grid.status, 0) << "it has the places: " << grid.err;

  // Textures stay what they are, unless another codec is wanted.
  EXPECT_EQ(info(folder / "coarse.mcap")["texture_codecs"], nlohmann::json({"jpeg"}));
  const auto lossless = convert(original, "png.mcap", {"--texture", "png"});
  ASSERT_EQ(lossless.status, 0) << lossless.err;
  EXPECT_EQ(info(folder / "png.mcap")["texture_codecs"], nlohmann::json({"png"}));
  const auto again = convert(folder / "png.mcap", "bound.mcap", {"--geometry", "visual", "--bound", "2"});
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_EQ(info(folder / "bound.mcap")["texture_codecs"], nlohmann::json({"png"}));
  const auto exact = convert(folder / "png.mcap", "exact.mcap", {"--geometry", "visual", "--bound", "0.1"});
  ASSERT_EQ(exact.status, 0) << exact.err;
  const auto geometry_bytes = [&](const char* file) {
    return info(folder / file)["bytes"]["geometry"].get<int>();
  };
  EXPECT_LT(geometry_bytes("bound.mcap"), 0.8 * geometry_bytes("exact.mcap"));
  const auto unknown = convert(original, "gif.mcap", {"--texture", "gif"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("give jpeg, webp, png or h264"));

  const auto mesh = convert(original, "mesh.mcap", {"--geometry", "draco-mesh"});
  ASSERT_EQ(mesh.status, 0) << mesh.err;
  EXPECT_EQ(info(folder / "mesh.mcap")["geometry_codecs"], nlohmann::json({"draco-mesh"}));
  const auto back = convert(folder / "mesh.mcap", "back.mcap", {"--geometry", "grid"});
  EXPECT_EQ(back.status, 1);
  EXPECT_THAT(back.err, HasSubstr("can only be coded as draco-mesh"));
  EXPECT_FALSE(std::filesystem::exists(folder / "back.mcap"));
}

/// The texture's bytes of each frame.
std::vector<Bytes> textures_of(const std::filesystem::path& file) {
  std::vector<Bytes> out;
  for (const Bytes& cdr : recorded_frames(file)) {
    const auto view = read_frame_cdr(cdr);
    const auto layout = view ? read_frame_layout(view->data) : Result<FrameLayout>(view.error());
    EXPECT_TRUE(layout.ok()) << (layout ? "" : layout.error().message);
    if (layout) out.emplace_back(layout->sections.texture.begin(), layout->sections.texture.end());
  }
  return out;
}

TEST(RecordingFormats, TexturesStayAsTheyAreUnlessOthersAreAskedFor) {
  const TempFolder folder;
  const bool has_h264 = check_texture_codec(TextureCodec::kH264).ok();
  for (const std::string texture : {"jpeg", "h264"}) {
    SCOPED_TRACE(texture);
    const bool is_chain = texture == "h264";
    if (is_chain && !has_h264) continue;
    const std::string original = folder / (texture + ".mcap");
    const auto served =
        run({program("relievo-server"), "serve", "--source", "sim:plane,width=160,height=120,stripes=30",
             "--web", "none", "--domain", kDomain, "--interface", "lo", "--fast", "--frames", "16",
             "--key-interval", "5", "--texture", texture, "--record", original});
    ASSERT_EQ(served.status, 0) << served.err;
    const auto before = textures_of(original);
    ASSERT_GT(before.size(), 12u);
    int made = 0;
    const auto convert = [&](const std::vector<std::string>& more) {
      const std::string out = folder / (texture + std::to_string(made++) + ".mcap");
      std::vector<std::string> command{program("relievo"), "convert", original, "--out", out, "--json"};
      command.insert(command.end(), more.begin(), more.end());
      const auto done = run(command);
      EXPECT_EQ(done.status, 0) << done.err;
      const auto shown =
          run({program("relievo"), "export", out, "--out", out + "-png", "--format", "png", "--json"});
      EXPECT_EQ(shown.status, 0) << shown.err;
      EXPECT_EQ(nlohmann::json::parse(shown.out)["frames"], textures_of(out).size()) << "all decode";
      return textures_of(out);
    };
    EXPECT_EQ(convert({"--geometry", "draco-grid", "--step-bits", "4"}), before);
    EXPECT_EQ(convert({"--geometry", "metric"}), before);
    EXPECT_EQ(convert({"--geometry", "visual", "--bound", "1"}), before);
    EXPECT_NE(convert({"--texture-quality", "30"}), before);
    // From between two key frames on: what builds on a picture that is not there is coded anew.
    const auto part = convert({"--step-bits", "3", "--frames", "2:10"});
    ASSERT_EQ(part.size(), 9u);
    const std::size_t kept = is_chain ? 5 : 2;
    EXPECT_TRUE(std::equal(part.begin() + static_cast<std::ptrdiff_t>(kept - 2), part.end(),
                           before.begin() + static_cast<std::ptrdiff_t>(kept)));
    EXPECT_EQ(is_chain, part[0] != before[2]);
    const auto copied = run(
        {program("relievo"), "convert", original, "--out", folder / (texture + ".part"), "--frames", "2:10"});
    EXPECT_EQ(copied.out.find("11 frames, the first 2 from before the range: it builds on them") !=
                  std::string::npos,
              is_chain)
        << copied.out;
  }
}

/// A copy in which the geometry of one frame is nonsense; its CRCs are right.
void copy_damaged(const std::filesystem::path& from, const std::filesystem::path& to, int which) {
  auto reader = RecordingReader::open(from);
  auto writer = RecordingWriter::create(to, {});
  ASSERT_TRUE(reader.ok() && writer.ok());
  const RecordingSummary& summary = (*reader)->summary();
  for (const RecordingChannel& channel : summary.channels) {
    const auto schema = std::ranges::find(summary.schemas, channel.schema, &RecordingSchema::name);
    ASSERT_TRUE((*writer)->add_channel(*schema, channel).ok());
  }
  for (auto message = (*reader)->next(); message.ok() && *message; message = (*reader)->next()) {
    if (summary.channels[(*message)->channel].topic == "relievo/frame" && which-- == 0) {
      auto view = *read_frame_cdr((*message)->data);
      Bytes damaged(view.data.begin(), view.data.end());
      std::fill(damaged.begin() + 100, damaged.begin() + 400, std::uint8_t{0xff});
      view.data = damaged;
      (*message)->data = write_frame_cdr(view);
    }
    ASSERT_TRUE((*writer)->write(**message).ok());
  }
  ASSERT_TRUE((*writer)->finish().ok());
}

TEST(RecordingFormats, WhatCannotBeDecodedIsAFailureAndTheOthersAreThere) {
  const TempFolder folder;
  const std::string whole = folder / "whole.mcap", damaged = folder / "damaged.mcap";
  const auto served = run({program("relievo-server"), "serve", "--source",
                           "sim:plane,width=160,height=120,stripes=30", "--web", "none", "--domain", kDomain,
                           "--interface", "lo", "--fast", "--frames", "8", "--record", whole});
  ASSERT_EQ(served.status, 0) << served.err;
  ASSERT_NO_FATAL_FAILURE(copy_damaged(whole, damaged, 2));
  const auto count = recorded_frames(whole).size();
  const std::vector<std::pair<std::string, std::vector<std::string>>> hows = {
      {"export", {"--format", "ply"}},
      {"export", {"--format", "ros2"}},
      {"convert", {"--geometry", "grid"}},
      {"convert", {"--foxglove"}},
      {"shot", {}}};
  for (const auto& [verb, more] : hows) {
    SCOPED_TRACE(verb);
    const std::string out = folder / (more.empty() ? "pictures" : more.back() == "ply" ? "ply" : "out.mcap");
    std::vector<std::string> command{program("relievo"), verb, damaged, "--out", out, "--json"};
    command.insert(command.end(), more.begin(), more.end());
    const auto done = run(command);
    EXPECT_EQ(done.status, 1);
    EXPECT_THAT(done.err, HasSubstr("1 frame could not be decoded and was left out: "));
    EXPECT_THAT(done.err, HasSubstr("; the other " + std::to_string(count - 1)));
    EXPECT_EQ(nlohmann::json::parse(done.out)["unreadable"], 1) << done.out;
    EXPECT_TRUE(std::filesystem::exists(out));
    std::filesystem::remove_all(out);
    command.insert(command.end(), {"--frames", "2"});
    const auto none = run(command);
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("damaged.mcap: 1 frame could not be decoded and was left out: "));
    EXPECT_EQ(none.out, "");
    EXPECT_FALSE(std::filesystem::exists(out));
  }
  EXPECT_EQ(run({program("relievo"), "convert", damaged, "--out", folder / "copy.mcap"}).status, 0)
      << "copied as it is";
}

/// Some frames of an object in this quality.
void record_object(const std::filesystem::path& file, const std::string& quality) {
  Process server({program("relievo-server"), "serve", "--source", "sim:object,width=320,height=240",
                  "--domain", kDomain, "--interface", "lo", "--web", "none", "--stream", "face"});
  const auto done =
      run(on_loopback({"record", "face", "--quality", quality, "--frames", "4", "--out", file}));
  ASSERT_EQ(done.status, 0) << done.err;
}

/// From the live stream, and from a recording of it.
TEST(RecordingFormats, ChannelsForGenericViewersAreWhatTheirSchemasSay) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@foxglove/schemas")) {
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  }
  const TempFolder folder;
  ASSERT_NO_FATAL_FAILURE(record_face(folder / "live.mcap", 0, 9, {"--foxglove"}));
  const auto done = run({program("relievo"), "convert", folder / "live.mcap", "--out", folder / "part.mcap",
                         "--frames", "3:6", "--foxglove", "--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(nlohmann::json::parse(done.out)["frames"], 4);
  const auto live = recorded_frames(folder / "live.mcap");
  const auto part = recorded_frames(folder / "part.mcap");
  ASSERT_EQ(live.size(), 9u);
  EXPECT_EQ(part, (std::vector<Bytes>{live.begin() + 3, live.begin() + 7})) << "as they were";
  for (const auto& [file, count] : {std::pair{"live.mcap", 9}, std::pair{"part.mcap", 4}}) {
    const auto checked =
        run({"/usr/bin/env", "node", js / "check_foxglove.mjs", folder / file, folder.path().string()});
    ASSERT_EQ(checked.status, 0) << checked.err;
    const auto counts = nlohmann::json::parse(checked.out);
    EXPECT_EQ(counts["foxglove::CompressedImage"], count);
    EXPECT_EQ(counts["foxglove::CameraCalibration"], count) << "with each image, so that seeking finds it";
    EXPECT_EQ(counts["foxglove::FrameTransform"], count);
    EXPECT_EQ(counts["foxglove::SceneUpdate"], count);
    const auto glb = run({"/usr/bin/env", "node", js / "validate_glb.mjs", folder / "last.glb"});
    EXPECT_EQ(glb.status, 0) << glb.err;
    const auto whole = run({"/usr/bin/env", "node", js / "validate.mjs", folder / file});
    EXPECT_EQ(whole.status, 0) << whole.err;
  }
}

TEST(RecordingFormats, GenericViewersLayTheImageOverTheSurface) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@foxglove/schemas"))
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  const TempFolder folder;
  // Of pictures of the camera's size, and of half of that.
  for (const std::string quality : {"full", "reduced"}) {
    SCOPED_TRACE(quality);
    const std::string recorded = folder / (quality + ".mcap"), shown = folder / (quality + "-shown.mcap");
    ASSERT_NO_FATAL_FAILURE(record_object(recorded, quality));
    const auto done =
        run({program("relievo"), "convert", recorded, "--out", shown, "--frames", "1:2", "--foxglove"});
    ASSERT_EQ(done.status, 0) << done.err;
    const auto checked =
        run({"/usr/bin/env", "node", js / "check_foxglove.mjs", shown, folder.path().string()});
    ASSERT_EQ(checked.status, 0) << checked.err;
    const auto found = nlohmann::json::parse(checked.out);
    EXPECT_EQ(found["foxglove::CameraCalibration"], 2);
    ASSERT_TRUE(found["off_px"].is_number()) << checked.out;
    EXPECT_LT(found["off_px"], 0.2);
  }
}

TEST(RecordingFormats, OtherMcapReadersDecodeEverySample) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@mcap/core")) {
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  }
  const TempFolder folder;
  const auto file = folder / "a.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(file, 3000, 20));
  const auto done = run({"/usr/bin/env", "node", js / "validate.mjs", file});
  ASSERT_EQ(done.status, 0) << done.err;
  const auto json = nlohmann::json::parse(done.out);
  for (const auto& topic : json["topics"]) {
    const auto& first = topic["first"]["message"];
    EXPECT_EQ(first["stream"], "face");
    if (topic["topic"] == "relievo/frame") {
      EXPECT_EQ(topic["count"], 20);
      EXPECT_EQ(first["frame_number"],
                std::to_string(2 * std::stoull(first["sequence_number"].get<std::string>()) + 1));
      EXPECT_EQ(first["data"]["bytes"], 3000);
    }
    if (topic["topic"] == "relievo/info") {
      EXPECT_EQ(first["source"], "test");
      EXPECT_EQ(first["rig"]["camera"]["width"], 640);
      EXPECT_EQ(first["pattern"]["colours"], 6);
    }
  }
  EXPECT_EQ(json["topics"].size(), 3u);
}

TEST(RecordingFormats, WhatOtherMcapWritersMakeOfARecordingIsRead) {
  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@mcap/core"))
    GTEST_SKIP() << "npm packages are missing: run npm ci --prefix tests/e2e/mcap_js";
  const TempFolder folder;
  const auto file = folder / "a.mcap";
  ASSERT_NO_FATAL_FAILURE(record_face(file, 3000, 20));
  const auto made = run({"/usr/bin/env", "node", js / "rewrite.mjs", file, folder.path().string()});
  ASSERT_EQ(made.status, 0) << made.err;
  for (const std::string name : nlohmann::json::parse(made.out)) {
    SCOPED_TRACE(name);
    const auto other = folder / (name + ".mcap");
    if (name == "unchunked") {
      const auto done = run({program("relievo"), "info", other});
      EXPECT_EQ(done.status, 1);
      EXPECT_THAT(done.err, HasSubstr("unchunked.mcap: its messages lie outside of chunks"));
      continue;
    }
    const auto description = info(other);
    EXPECT_EQ(description["frames"], 20);
    EXPECT_EQ(description["attachments"].size(), 3u);
    EXPECT_EQ(recorded_frames(other), recorded_frames(file));
  }
}

TEST(RecordingFormats, RecordingsThatWereJoinedAreAllReadAndMadeOne) {
  const TempFolder folder;
  ASSERT_NO_FATAL_FAILURE(record_face(folder / "a.mcap", 3000, 12));
  ASSERT_NO_FATAL_FAILURE(record_face(folder / "b.mcap", 3000, 9));
  const auto joined = folder / "joined.mcap";
  {
    std::ofstream out(joined, std::ios::binary);
    for (const char* part : {"a.mcap", "b.mcap"})
      out << std::ifstream(folder / part, std::ios::binary).rdbuf();
  }
  std::vector<Bytes> frames = recorded_frames(folder / "a.mcap");
  for (Bytes& frame : recorded_frames(folder / "b.mcap")) frames.push_back(std::move(frame));
  ASSERT_EQ(frames.size(), 21u);

  const auto description = info(joined);
  EXPECT_EQ(description["recordings"], 2);
  EXPECT_EQ(description["frames"], 21);
  EXPECT_EQ(description["recovered"], false);
  const auto played = run(on_loopback({"play", joined, "--wait-readers", "0", "--speed", "20", "--json"}));
  ASSERT_EQ(played.status, 0) << played.err;
  EXPECT_EQ(nlohmann::json::parse(played.out)["frames"], 21);
  EXPECT_THAT(played.err, HasSubstr("is 2 recordings, one behind the other"));

  const auto one = folder / "one.mcap";
  const auto recovered = run({program("relievo"), "recover", joined, "--out", one, "--json"});
  ASSERT_EQ(recovered.status, 0) << recovered.err;
  EXPECT_EQ(nlohmann::json::parse(recovered.out)["recordings"], 2);
  EXPECT_EQ(recorded_frames(one), frames);
  EXPECT_EQ(info(one)["recordings"], 1);

  const std::filesystem::path js = RELIEVO_MCAP_JS;
  if (!std::filesystem::exists(js / "node_modules/@mcap/core")) return;
  const auto checked = run({"/usr/bin/env", "node", js / "validate.mjs", one});
  ASSERT_EQ(checked.status, 0) << checked.err;
  const auto read = nlohmann::json::parse(checked.out);
  for (const auto& topic : read["topics"]) {
    if (topic["topic"] == "relievo/frame") {
      EXPECT_EQ(topic["count"], 21);
    }
  }
}

}  // namespace
}  // namespace relievo::test
