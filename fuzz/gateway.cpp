// SPDX-License-Identifier: Apache-2.0
// What clients of the web gateway send: the first byte says whether the rest are messages of one of its two
// protocols, a line each, or a request, its parts a line each in the order of kParts and behind them its
// body.
#include <array>
#include <utility>

#include "base/log.h"
#include "fuzz/fuzz.h"
#include "web/gateway/byte_range.h"
#include "web/gateway/cut_recordings.h"
#include "web/gateway/foxglove_feed.h"
#include "web/gateway/sign_in.h"
#include "web/gateway/stream_feed.h"

namespace relievo {
namespace {

constexpr int kMostMessages = 200;
constexpr std::array kParts{
    &HttpRequest::method,       &HttpRequest::target,      &HttpRequest::host,
    &HttpRequest::origin,       &HttpRequest::cookie,      &HttpRequest::authorization,
    &HttpRequest::range,        &HttpRequest::if_range,    &HttpRequest::if_none_match,
    &HttpRequest::content_type, &HttpRequest::subprotocols};

/// There is one stream, face, of which anything may be asked.
struct Recordings final : RecordingControl {
  std::optional<RecordingState> state(const std::string& stream) const override {
    return stream == "face" ? std::optional(RecordingState{}) : std::nullopt;
  }
  Status start(const std::string& stream) override {
    FUZZ_CHECK(stream == "face");
    return {};
  }
  Status stop(const std::string& stream) override { return start(stream); }
  std::filesystem::path folder() const override { return "/nonexistent"; }
  bool is_open(const std::string& file) const override {
    FUZZ_CHECK(file.find('/') == std::string::npos && !file.starts_with('.'));
    return false;
  }
  std::shared_ptr<const GrowingRecording> growing(const std::string& file) const override {
    static_cast<void>(is_open(file));
    return nullptr;
  }
};
struct Rigs final : RigControl {
  bool has(const std::string& stream) const override { return stream == "face"; }
  std::optional<std::shared_ptr<const RigView>> look(const std::string& stream,
                                                     const std::vector<std::string>& pictures) override {
    for (const std::string& name : pictures) FUZZ_CHECK(!name.empty());
    if (!has(stream)) return std::nullopt;
    return std::make_shared<const RigView>(RigView{"{}", {{"camera", {1}}}});
  }
  ProjectorState projector() const override { return {}; }
  Status project(const std::string& stream, const std::string&) override {
    return has(stream) ? Status() : Error{"no such stream"};
  }
  Status stop_projecting() override { return Error{"nothing is shown"}; }
};
struct Calibrations final : CalibrationControl {
  std::string report() override { return "{}"; }
  std::shared_ptr<const Bytes> picture(const std::string& name) override {
    return name == "camera" ? std::make_shared<const Bytes>(1) : nullptr;
  }
  Status order(const CalibrationOrder&) override { return {}; }
};

std::string_view take_line(std::string_view& rest) {
  const std::string_view line = rest.substr(0, rest.find('\n'));
  rest.remove_prefix(std::min(rest.size(), line.size() + 1));
  return line;
}

std::unique_ptr<Hub> hub_with_a_frame() {
  auto hub = std::make_unique<Hub>("nothing here");
  StreamInfo info;
  info.stream = "face";
  hub->announce(info);
  FrameMessage frame;
  frame.data = std::make_shared<const Bytes>(100);
  hub->publish("face", frame);
  return hub;
}

void messages(std::string_view rest, bool foxglove) {
  static const SampleFormat format{"relievo::Frame", "struct Frame {};",
                                   [](const std::string&, const FrameMessage&) { return Bytes(4); }};
  const auto hub = hub_with_a_frame();
  const auto feed = foxglove ? make_foxglove_feed(*hub, format, "1") : make_stream_feed(*hub, "face");
  feed->start([] {});
  for (int i = 0; i < kMostMessages && !rest.empty(); ++i) {
    const std::string_view line = take_line(rest);
    const auto closed =
        line.starts_with('#')
            ? feed->on_binary({reinterpret_cast<const std::uint8_t*>(line.data()), line.size()})
            : feed->on_text(line);
    if (closed) {
      FUZZ_CHECK(closed->code >= 1000 && closed->code < 5000 && closed->why.size() <= 120);
      return;
    }
    for (int sent = 0; sent < 3; ++sent)
      if (const auto out = feed->next()) feed->on_sent(*out);
  }
}

void check_range(std::string_view header) {
  for (const std::uint64_t size : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1} << 40}) {
    ByteRange range;
    const RangeKind kind = parse_range(header, size, range);
    if (kind == RangeKind::kPart)
      FUZZ_CHECK(range.length > 0 && range.at < size && range.length <= size - range.at);
  }
}

void request(std::string_view rest, bool with_tokens) {
  static const auto hub = hub_with_a_frame();
  static const Tokens made = [] {
    auto tokens = Tokens::make();
    FUZZ_CHECK(tokens.ok());
    return *std::move(tokens);
  }();
  static const Tokens none = Tokens::none();
  static Recordings recordings;
  static Rigs rigs;
  static Calibrations calibrations;
  static CutRecordings cuts;
  const GatewayCounts counts;
  const WebOptions options{.origins = {"https://viewer.example"}};
  HttpRequest request;
  for (const auto part : kParts) request.*part = take_line(rest);
  for (const auto part : kParts)
    if ((request.*part).find('\r') != std::string_view::npos) return;  // the HTTP parser gives none
  request.body = rest;
  request.upgrade = !request.subprotocols.empty();
  check_range(request.range);
  const RouteContext context{.hub = *hub,
                             .counts = counts,
                             .tokens = with_tokens ? made : none,
                             .options = options,
                             .cuts = cuts,
                             .recordings = &recordings,
                             .rigs = &rigs,
                             .calibrations = &calibrations,
                             .foxglove = true,
                             .port = 8080};
  HttpReply reply = answer(request, context);
  while (reply.from_disk) {
    FUZZ_CHECK(!with_tokens);
    reply = std::exchange(reply.from_disk, {})();
  }
  FUZZ_CHECK(reply.status >= 100 && reply.status < 600);
  for (const auto& [name, value] : reply.headers)
    FUZZ_CHECK(name.find_first_of("\r\n") == std::string::npos &&
               value.find_first_of("\r\n") == std::string::npos);
  if (with_tokens)  // nothing is to be had without one but the form that asks for it
    FUZZ_CHECK(!reply.websocket && !reply.file && reply.status != 206);
}

}  // namespace
}  // namespace relievo

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  set_log_level(LogLevel::kError);
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(data + 1), size - 1);
  switch (data[0]) {
    case 0:
    case 1:
      messages(rest, data[0] == 1);
      break;
    case 2:
    case 3:
      request(rest, data[0] == 3);
      break;
    default:
      break;
  }
  return 0;
}
