// SPDX-License-Identifier: Apache-2.0
// Each suite of relievo-bench, as small as it goes: it runs, and what it prints holds what it promises. No
// figure of time is judged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/support/own_domain.h"
#include "tests/support/process.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;

const std::string kSource = "sim:object,width=160,height=120,stripes=30";

Finished bench(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program("relievo-bench").string());
  return run(arguments, kLongPatience);
}

/// What a suite prints with --json; null where it failed.
Json report_of(std::vector<std::string> arguments) {
  const std::string suite = arguments.front();
  arguments.push_back("--json");
  const Finished done = bench(arguments);
  EXPECT_EQ(done.status, 0) << done.err;
  Json report = Json::parse(done.out, nullptr, false);
  if (!report.is_object()) {
    ADD_FAILURE() << "no JSON object: " << done.out << done.err;
    return {};
  }
  EXPECT_EQ(report.value("suite", ""), suite);
  EXPECT_GT(report["machine"].value("cores", 0), 0);
  EXPECT_TRUE(report["machine"].contains("load_1min"));
  return report;
}

/// A spread of `n` values in order, all above zero.
void expect_spread(const Json& spread, int n, const std::string& what) {
  ASSERT_TRUE(spread.is_object()) << what << ": " << spread;
  for (const char* key : {"median", "p10", "p90", "p99", "min", "max", "n"})
    ASSERT_TRUE(spread.contains(key)) << what << " has no " << key;
  EXPECT_EQ(spread["n"], n) << what;
  EXPECT_GT(spread["min"], 0.0) << what;
  EXPECT_LE(spread["min"], spread["p10"]) << what;
  EXPECT_LE(spread["p10"], spread["median"]) << what;
  EXPECT_LE(spread["median"], spread["p90"]) << what;
  EXPECT_LE(spread["p90"], spread["p99"]) << what;
  EXPECT_LE(spread["p99"], spread["max"]) << what;
}

const Json& row(const Json& report, const std::string& name) {
  static const Json none;
  for (const Json& r : report["rows"])
    if (r["name"] == name) return r;
  ADD_FAILURE() << "no row " << name << " in " << report["rows"];
  return none;
}

TEST(Bench, Reconstruct) {
  for (const std::string decoder : {"paper", "quick", "ordered"}) {
    const Json report = report_of({"reconstruct", "--size", "160x120", "--stripes", "30", "--threads", "2",
                                   "--frames", "5", "--decoder", decoder});
    ASSERT_TRUE(report.is_object());
    EXPECT_EQ(report["settings"]["width"], 160);
    EXPECT_EQ(report["settings"]["height"], 120);
    EXPECT_EQ(report["settings"]["stripes"], 30);
    EXPECT_EQ(report["settings"]["threads"], 2);
    EXPECT_EQ(report["settings"]["decoder"], decoder);
    expect_spread(report["frame_ms"], 5, "frame_ms");
    expect_spread(report["points"], 5, "points");
    for (const char* stage : {"detect", "match", "triangulate", "surface", "texture"})
      expect_spread(report["stage_ms"][stage], 5, stage);
    // 160 x 120 x 3 bytes; 60 lines of 29 boundaries at most.
    EXPECT_EQ(report["frame_bytes"], 57600);
    EXPECT_LE(report["points"]["max"], 60 * 29);
    EXPECT_GT(report["points"]["median"], 60 * 29 / 4);
    EXPECT_NEAR(report["bound_ms"], 57600e3 / report["read_bytes_per_s"]["max"].get<double>(), 1e-9);
    EXPECT_GT(report["bound_ms"], 0.0);
  }
}

TEST(Bench, Codec) {
  const Json report = report_of({"codec", "--source", kSource, "--frames", "3", "--rounds", "2"});
  ASSERT_TRUE(report.is_object());
  expect_spread(report["vertices"], 3, "vertices");
  const Json& raw = row(report, "raw-float32");
  for (const char* name : {"grid-1/16px", "grid-1/16px-delta", "grid-1/16px-sigma", "grid-1/64px"}) {
    const Json& r = row(report, name);
    ASSERT_TRUE(r.is_object());
    for (const char* key : {"bytes", "bits_per_vertex", "encode_ms", "decode_ms", "rms_mm", "max_mm"})
      expect_spread(r[key], 6, std::string(name) + " " + key);
    // Standard deviations are more than Draco's rows hold.
    const double times = std::string(name) == "grid-1/16px-sigma" ? 1 : 3.5;
    EXPECT_LT(times * r["bytes"]["max"].get<double>(), row(report, "draco-mesh-s5-12bit")["bytes"]["min"])
        << name;
    EXPECT_GT(r["rms_mm"]["max"], 0) << name;
  }
  EXPECT_EQ(raw["max_mm"]["max"], 0);
  for (const char* stage : {"gather", "code", "decode", "surface"})
    expect_spread(report["ns_per_vertex"][stage], 6, stage);
  for (const char* name : {"raw-float32", "metric", "visual", "draco-mesh-s0-8bit"}) {
    expect_spread(row(report, name)["truth_um_per_m"], 3, name);  // once a frame
    EXPECT_LT(row(report, name)["truth_outliers"]["max"], 0.1) << name;
  }
  EXPECT_LT(row(report, "visual")["bytes"]["max"], row(report, "grid-1/16px")["bytes"]["min"]);
  for (const std::string bits : {"12bit", "pipeline"}) {
    for (const std::string speed : {"0", "4", "5", "7", "9"}) {
      const std::string name = "draco-mesh-s" + speed + "-" + bits;
      const Json& r = row(report, name);
      ASSERT_TRUE(r.is_object());
      for (const char* key : {"bytes", "bits_per_vertex", "encode_ms", "decode_ms", "rms_mm", "max_mm"})
        expect_spread(r[key], 6, name + " " + key);
      EXPECT_LT(r["bytes"]["max"], raw["bytes"]["min"]) << name;
      // A coordinate is off by half a step of the box at most.
      const double step_mm =
          1e3 * report["volume_m"].get<double>() / ((1 << r["bits"]["min"].get<int>()) - 1);
      EXPECT_LT(r["max_mm"]["max"], 0.5 * std::sqrt(3) * step_mm * 1.01) << name;
      EXPECT_GT(r["rms_mm"]["max"], 0.1 * step_mm) << name;
    }
  }
}

TEST(Bench, Recording) {
  const Json report = report_of(
      {"recording", "--source", kSource, "--minutes", "0.5", "--key-interval", "6", "--seeks", "7"});
  ASSERT_TRUE(report.is_object());
  expect_spread(report["open_ms"], 9, "open_ms");
  expect_spread(report["seek_mb"], 14, "seek_mb");
  expect_spread(report["seek_cpu_ms"], 14, "seek_cpu_ms");
  EXPECT_LT(report["seek_mb"]["max"], report["file_mb"]) << "not all of it";
  EXPECT_GT(report["file_mb"], 0.1);
  for (const char* from : {"cached", "from disk"}) expect_spread(row(report, from)["seek_ms"], 7, from);
}

TEST(Bench, Rate) {
  // The levels of one scene are all different sizes of it: coarser, smaller, worse.
  const Json report =
      report_of({"rate", "--source", "sim:object,width=320,height=240,stripes=40", "--geometry", "grid",
                 "--texture", "jpeg", "--frames", "3", "--rounds", "2"});
  ASSERT_TRUE(report.is_object());
  ASSERT_GT(report["rows"].size(), 5U);
  double bytes = 1e9, psnr = 100;
  for (const Json& level : report["rows"]) {
    expect_spread(level["encode_ms"], 4, level["name"]);
    EXPECT_GT(level["time"], 0.0);
    EXPECT_LT(level["mean_bytes"], bytes) << level["name"];
    EXPECT_LT(level["texture_db"], psnr) << level["name"];
    bytes = level["mean_bytes"];
    psnr = level["texture_db"];
  }
  EXPECT_EQ(report["rows"][0]["size"], 1.0);
  EXPECT_EQ(bench({"rate", "--texture", "gif"}).status, 2);
}

TEST(Bench, RateUnderDeadlines) {
  // What nothing can miss is kept at the finest level, what nothing can keep missed at the coarsest.
  const Json report =
      report_of({"rate", "--source", "sim:object,width=320,height=240,stripes=40", "--geometry", "grid",
                 "--texture", "jpeg", "--frames", "4", "--rounds", "5", "--deadline", "600000", "0.000001"});
  ASSERT_TRUE(report.is_object());
  ASSERT_EQ(report["rows"].size(), 2U);
  for (const Json& row : report["rows"]) {
    expect_spread(row["encode_ms"], 20, row["deadline_ms"].dump());
    EXPECT_GE(row["encode_ms_p95"], row["encode_ms"]["median"]);
    EXPECT_LE(row["encode_ms_p95"], row["encode_ms"]["max"]);
  }
  EXPECT_EQ(report["rows"][0]["deadline_ms"], 600000);
  EXPECT_EQ(report["rows"][0]["late_share"], 0);
  EXPECT_EQ(report["rows"][1]["late_share"], 1);
  EXPECT_LT(report["rows"][0]["level"]["median"], report["rows"][1]["level"]["median"]);
  EXPECT_EQ(bench({"rate", "--deadline", "0"}).status, 2);
}

TEST(Bench, Texture) {
  const Json report = report_of({"texture", "--source", kSource, "--frames", "3", "--rounds", "2"});
  ASSERT_TRUE(report.is_object());
  EXPECT_EQ(report["raw_bytes"], 160 * 120 * 3);
  const Json& png = row(report, "png");
  EXPECT_EQ(png["lossless"], true);
  EXPECT_TRUE(png["psnr_db"].is_null());
  double bytes = 0;
  double psnr = 0;
  for (const std::string quality : {"60", "75", "80", "90", "95"}) {
    const Json& r = row(report, "jpeg-q" + quality);
    ASSERT_TRUE(r.is_object());
    EXPECT_EQ(r["lossless"], false);
    for (const char* key : {"bytes", "bits_per_pixel", "encode_ms", "decode_ms", "psnr_db"})
      expect_spread(r[key], 6, quality + " " + key);
    EXPECT_GT(r["bytes"]["median"], bytes);
    EXPECT_GT(r["psnr_db"]["median"], psnr);
    bytes = r["bytes"]["median"];
    psnr = r["psnr_db"]["median"];
  }
  const Json& webp = row(report, "webp-q80");
  EXPECT_LT(webp["bytes"]["median"], row(report, "jpeg-q80")["bytes"]["median"]);
  const Json& video = row(report, "h264-q80");
  if (!video.is_object()) GTEST_SKIP() << "this build has no H.264";
  expect_spread(video["key_bytes"], 2, "key pictures, one a round");
  expect_spread(video["bytes"], 4, "the others");
  EXPECT_LT(video["bytes"]["median"], video["key_bytes"]["median"]);
  EXPECT_GT(video["psnr_db"]["min"], 30);
}

TEST(Bench, Chain) {
  const Json report = report_of({"chain", "--source", kSource, "--clients", "2", "--web-clients", "1",
                                 "--frames", "20", "--geometry", "metric", "--texture", "webp", "--domain",
                                 std::to_string(own_domain()), "--interface", "lo"});
  ASSERT_TRUE(report.is_object());
  EXPECT_EQ(report["settings"]["geometry"], "metric");
  EXPECT_EQ(report["settings"]["texture"], "webp");
  EXPECT_EQ(report["frames"]["captured"], 20);
  const int published = report["frames"]["published"];
  EXPECT_GT(published, 0);
  // Every frame is somewhere. The first has no partner yet; after drops, neither may the next ones of its
  // slide.
  const Json& drops = report["drops"];
  const int dropped =
      drops["reconstruct"].get<int>() + drops["encode"].get<int>() + drops["publish"].get<int>();
  EXPECT_LE(published + dropped, 19) << report;
  EXPECT_GE(published + dropped, 19 - drops["capture"].get<int>() - drops["reconstruct"].get<int>())
      << report;
  const int warm_up = report["settings"]["warm_up_frames"];
  const Json& latency = report["latency_ms"];
  expect_spread(latency["capture_to_publish"], published - warm_up, "capture_to_publish");
  const int decoded = latency["capture_to_decoded"]["n"];
  EXPECT_GE(decoded, 2 * (published - warm_up) - drops["dds"].get<int>());
  EXPECT_LE(decoded, 2 * (published - warm_up));
  EXPECT_GE(latency["capture_to_web"]["n"].get<int>(), published - warm_up - drops["web"].get<int>());
  if (drops["dds"] == 0) {  // else not of the same frames
    EXPECT_GT(latency["capture_to_decoded"]["median"], latency["capture_to_publish"]["median"]);
  }
  for (const char* part : {"total", "encode_geometry", "encode_texture"})
    expect_spread(report["serial_ms"][part], 20, part);
  for (const std::string key : {"publish", "decoded", "web"}) {
    if (latency["capture_to_" + key]["n"] < 4) continue;  // a starved client need not see two frames
    const Json& rate = report["frames_per_s"][key == "publish" ? "published" : key];
    EXPECT_GT(rate["median"], 0.0) << key;
  }
  for (const char* thread : {"capture", "reconstruct", "encode"})
    EXPECT_GE(report["cpu_ms"][thread], 0.0) << thread;
  for (const char* key : {"server", "clients", "total"})
    EXPECT_GT(report["cpu_cores"][key]["max"], 0.0) << key;
  EXPECT_GT(report["memory_mb"]["resident"]["median"], report["memory_mb"]["before"].get<double>() / 2);
}

TEST(Bench, TableForPeople) {
  const Finished done = bench({"codec", "--source", kSource, "--frames", "2", "--rounds", "1"});
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(done.err, "");
  for (const char* text : {"codec: median (p10..p90)", "vertices", "bits_per_vertex", "draco-mesh-s0-12bit"})
    EXPECT_THAT(done.out, testing::HasSubstr(text));
}

TEST(Bench, FailuresAreOneLine) {
  const Finished shaped = bench({"reconstruct", "--source", "take:nowhere", "--size", "640x480"});
  EXPECT_EQ(shaped.status, 1);
  EXPECT_THAT(shaped.err, testing::HasSubstr("leave them out"));
  const Finished missing = bench({"codec", "--source", "take:nowhere"});
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.err, testing::HasSubstr("nowhere"));
  const Finished unknown = bench({"everything"});
  EXPECT_EQ(unknown.status, 2);
  const Finished none = bench({"chain", "--frames", "0"});
  EXPECT_EQ(none.status, 2);
  EXPECT_THAT(none.err, testing::HasSubstr("no whole number from 1 to 1000000 "));
  for (const Finished& f : {shaped, missing, unknown, none}) {
    EXPECT_EQ(f.out, "");
    EXPECT_EQ(std::count(f.err.begin(), f.err.end(), '\n'), 1) << f.err;
  }
}

TEST(PeerSuite, AnInterruptEndsIt) {
  // Minutes for each decoder; after some seconds it is at the first.
  Process process(
      {program("relievo-bench").string(), "peer", "--scene", "plane,rays=1,noise=0", "--runs", "1000"});
  ASSERT_EQ(process.wait(4s), std::nullopt) << process.err();
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_EQ(process.out(), "");
}

TEST(PeerSuite, OursIsMoreExactAndMoreCompleteThanGetProjPixelOnOneScene) {
  const Json report = report_of(
      {"peer", "--scene", "object,width=160,height=120,projector_width=256,projector_height=192,stripes=24",
       "--runs", "2"});
  const Json &stripes = row(report, "relievo-stripes"), &gray = row(report, "relievo-gray"),
             &peer = row(report, "opencv-getProjPixel");
  for (const Json* r : {&gray, &peer}) expect_spread((*r)["decode_ms"], 2, "decode_ms");
  EXPECT_EQ(stripes["pictures_next"], 2);
  EXPECT_EQ(peer["pictures"], 34);  // 8 bits each way, inverses, white and black
  EXPECT_GT(peer["completeness"], 0.5);
  EXPECT_GT(gray["completeness"], peer["completeness"]);
  EXPECT_GT(stripes["completeness"], 0.8);
  EXPECT_LT(gray["median_um_per_m"], peer["median_um_per_m"]);
  EXPECT_LT(stripes["median_um_per_m"], peer["median_um_per_m"]);
}

}  // namespace
}  // namespace relievo::test
