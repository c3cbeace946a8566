// SPDX-License-Identifier: Apache-2.0
// A gateway with a synthetic moving surface, for the browser test: what it serves is encoded by the real
// codec. Prints "listening PORT" and obeys lines on stdin: announce NAME (without a frame), start NAME, also
// NAME (a second stream of the same frames), apart N (its frames are N ahead of the first one's), stop, frame
// NUMBER (that one, then stop), corrupt (one frame), status STATE TEXT, gone, texture NAME (of a codec; h264
// with a key frame every 8th), rig RMS SCALE (how good the first one's is found to be, which it says from
// then on), place NAME ANGLE X Y Z (where that stream's camera stands in a frame of all: turned about y by
// radians, metres), sigmas METRES... (of the depths, in as many bands from left to right; the lower half is
// interpolated). Ends when stdin does, so that no test leaves it behind.
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "codec/texture_codec.h"
#include "web/gateway/gateway.h"

namespace relievo {
namespace {

constexpr int kColumns = 90;
constexpr int kRows = 120;
constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr float kFocal = 800;
constexpr double kBaseline_m = 0.2;

/// A plane at 1.2 m with a ball's worth of relief that moves and breathes.
float depth_m(float u, float v, float t) {
  const float cx = 0.5f + 0.12f * std::sin(t);
  const float dx = (u - cx) * 1.33f, dy = v - 0.5f;
  const float r2 = dx * dx + dy * dy;
  const float bump = r2 < 0.09f ? std::sqrt(0.09f - r2) : 0.0f;
  return 1.2f - 0.6f * bump - 0.012f * std::sin(14.0f * u + 3.0f * t) * std::cos(11.0f * v);
}

void paint(Image8& texture, float t) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float u = static_cast<float>(x) / kWidth, v = static_cast<float>(y) / kHeight;
      const bool odd = (static_cast<int>(u * 16 + t) + static_cast<int>(v * 12)) % 2 != 0;
      const float light = 0.75f + 0.25f * std::sin(6.0f * u - 2.0f * v);
      std::uint8_t* pixel = texture.row(y) + x * 3;
      pixel[0] = static_cast<std::uint8_t>(light * (odd ? 214 : 60));
      pixel[1] = static_cast<std::uint8_t>(light * (odd ? 170 : 92));
      pixel[2] = static_cast<std::uint8_t>(light * (odd ? 140 : 130));
    }
  }
  // A red upper left and a green upper right corner show whether the texture is on the right way round.
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x) {
      std::uint8_t* left = texture.row(y) + x * 3;
      std::uint8_t* right = texture.row(y) + (kWidth - 1 - x) * 3;
      left[0] = 230, left[1] = 20, left[2] = 20;
      right[0] = 20, right[1] = 200, right[2] = 20;
    }
  }
}

/// `sigmas`: of bands of columns, metres; empty: nothing is said of them.
Frame3D make_frame(std::uint64_t number, float t, const std::vector<float>& sigmas) {
  Frame3D frame;
  frame.number = number;
  frame.time_ns = utc_now_ns();
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      const float u = static_cast<float>(c) / (kColumns - 1), v = static_cast<float>(r) / (kRows - 1);
      const float z = depth_m(u, v, t);
      frame.surface.positions.push_back(
          {(u - 0.5f) * kWidth / kFocal * z, (v - 0.5f) * kHeight / kFocal * z, z});
      frame.surface.texture_coordinates.push_back({u, v});
      if (!sigmas.empty()) {
        frame.surface.sigmas_m.push_back(sigmas[static_cast<std::size_t>(c) * sigmas.size() / kColumns]);
        frame.surface.interpolated.push_back(v > 0.5f);
      }
      if (r == 0 || c == 0) continue;
      const auto at = [](int row, int column) { return static_cast<std::uint32_t>(row * kColumns + column); };
      frame.surface.triangles.push_back({at(r - 1, c - 1), at(r, c - 1), at(r, c)});
      frame.surface.triangles.push_back({at(r - 1, c - 1), at(r, c), at(r - 1, c)});
    }
  }
  frame.texture = Image8(kWidth, kHeight, 3);
  paint(frame.texture, t);
  return frame;
}

StreamInfo make_info(const std::string& name) {
  StreamInfo info;
  info.stream = name;
  info.source = "feeder:ball";
  info.rig.frame_rate = 30;
  info.rig.camera.width = kWidth;
  info.rig.camera.height = kHeight;
  info.rig.camera.matrix = {kFocal, 0, 319.5, 0, kFocal, 239.5, 0, 0, 1};
  info.pattern.sequence.assign(90, 0);
  return info;
}

/// What a rig may say of itself.
struct RigQuality {
  double stereo_rms_px = 0, scale_error = 0;
};

/// With a projector to the camera's right, and how good that rig is.
StreamInfo make_info(const std::string& name, const RigQuality& quality) {
  StreamInfo info = make_info(name);
  info.rig.projector = info.rig.camera;
  info.rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.rig.projector_from_camera_translation = {-kBaseline_m, 0, 0};
  info.rig.stereo_rms_px = quality.stereo_rms_px;
  info.rig.scale_error = quality.scale_error;
  return info;
}

/// What stdin asked for; the feeding loop looks once a frame.
struct Orders {
  std::mutex mutex;
  std::string stream;       // feeding this one; empty: none
  std::string also;         // and this one; empty: none
  std::uint64_t apart = 0;  // how many frames it is ahead
  bool announce = false, withdraw = false, feeding = false, corrupt = false, quit = false;
  std::string state, text;
  std::optional<std::uint64_t> only;  // this frame, then none
  std::optional<RigQuality> quality;
  std::map<std::string, CameraPose> places;  // of streams' cameras
  std::vector<float> sigmas;
  TextureCodec texture = TextureCodec::kJpeg;
};

void read_orders(Orders& orders) {
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string verb, name;
    words >> verb;
    const std::lock_guard lock(orders.mutex);
    if (verb == "announce" || verb == "start") {
      words >> name;
      orders.stream = name;
      orders.announce = true;
      orders.feeding = verb == "start";
    } else if (verb == "also") {
      words >> orders.also;
      orders.announce = true;
    } else if (verb == "apart") {
      words >> orders.apart;
    } else if (verb == "stop") {
      orders.feeding = false;
    } else if (verb == "frame") {
      if (std::uint64_t number = 0; words >> number) orders.only = number;
      orders.feeding = false;
    } else if (verb == "corrupt") {
      orders.corrupt = true;
    } else if (verb == "gone") {
      orders.withdraw = true;
      orders.feeding = false;
    } else if (verb == "rig") {
      RigQuality quality;
      if (words >> quality.stereo_rms_px >> quality.scale_error) orders.quality = quality;
      orders.announce = true;
    } else if (verb == "place") {  // a stream, its camera's turn about y in radians, and where it stands
      double angle = 0;
      words >> name >> angle;
      CameraPose& pose = orders.places[name];
      for (double& t : pose.translation) words >> t;
      pose.rotation = {std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle)};
      orders.announce = true;
    } else if (verb == "sigmas") {
      orders.sigmas.clear();
      for (float sigma = 0; words >> sigma;) orders.sigmas.push_back(sigma);
    } else if (verb == "texture") {
      words >> name;
      orders.texture = texture_codec_named(name).value_or(TextureCodec::kJpeg);
    } else if (verb == "status") {
      words >> orders.state >> std::ws;
      std::getline(words, orders.text);
    }
  }
  const std::lock_guard lock(orders.mutex);
  orders.quit = true;
}

StreamState state_named(const std::string& name) {
  if (name == "stalled") return StreamState::kStalled;
  if (name == "ended") return StreamState::kEnded;
  return StreamState::kRunning;
}

int feed(std::uint16_t port, double rate) {
  const auto started = Gateway::start({.port = port, .empty_hint = "relievo-server serve --source sim:face"});
  if (!started.ok()) {
    std::fprintf(stderr, "%s\n", started.error().message.c_str());
    return 1;
  }
  Gateway& gateway = **started;
  std::printf("listening %d\n", gateway.port());
  std::fflush(stdout);

  static Orders orders;  // outlives the thread that reads into it
  std::thread reader([&] { read_orders(orders); });
  reader.detach();  // blocked in stdin; the program ends with it
  EncodeOptions options;
  options.volume = {{-1, -1, 0}, 2};
  options.key_interval = 8;
  FrameEncoder encoder(make_info("").rig, make_info("").pattern);
  FrameEncoder also_encoder(make_info("").rig, make_info("").pattern);
  std::uint64_t sequence = 0;
  std::int64_t started_ns = utc_now_ns();
  auto next = std::chrono::steady_clock::now();
  for (;;) {
    next += std::chrono::microseconds(static_cast<int>(1e6 / rate));
    std::this_thread::sleep_until(next);
    const std::lock_guard lock(orders.mutex);
    if (orders.quit) return 0;
    if (std::exchange(orders.announce, false)) {
      const auto announce = [&](StreamInfo info) {
        info.started_ns = started_ns;  // another one is another server's
        if (const auto at = orders.places.find(info.stream); at != orders.places.end())
          info.rig.world_from_camera = at->second;
        gateway.announce(info);
      };
      announce(orders.quality ? make_info(orders.stream, *orders.quality) : make_info(orders.stream));
      if (!orders.also.empty()) announce(make_info(orders.also));
    }
    if (std::exchange(orders.withdraw, false)) {
      gateway.withdraw(orders.stream);
      started_ns = utc_now_ns();
    }
    if (!orders.state.empty()) {
      ServerStatus status;
      status.stream = orders.stream;
      status.state = state_named(std::exchange(orders.state, {}));
      status.message = orders.text;
      gateway.publish(status);
    }
    if (!orders.feeding && !orders.only) continue;
    FrameMessage message;
    message.capture_time_ns = utc_now_ns();
    message.sequence = sequence++;
    message.number = std::exchange(orders.only, {}).value_or(message.sequence);
    options.texture = orders.texture;
    const auto fill = [&](FrameEncoder& with) {
      const auto bytes = with.encode(
          make_frame(message.number, static_cast<float>(message.number + 1) * 0.05f, orders.sigmas), options);
      if (!bytes.ok()) {
        std::fprintf(stderr, "%s\n", bytes.error().message.c_str());
        return false;
      }
      Bytes data = *bytes;
      if (std::exchange(orders.corrupt, false)) data.resize(data.size() / 2);
      message.data = std::make_shared<const Bytes>(std::move(data));
      message.publish_time_ns = utc_now_ns();
      return true;
    };
    if (!fill(encoder)) return 1;
    gateway.publish(orders.stream, message);
    if (orders.also.empty()) continue;
    if (orders.apart != 0) {
      message.number += orders.apart;
      if (!fill(also_encoder)) return 1;
    }
    gateway.publish(orders.also, message);
  }
}

}  // namespace
}  // namespace relievo

int main(int argc, char** argv) {
  const int port = argc > 1 ? std::atoi(argv[1]) : 0;
  const double rate = argc > 2 ? std::atof(argv[2]) : 15;
  return relievo::feed(static_cast<std::uint16_t>(port), rate);
}
