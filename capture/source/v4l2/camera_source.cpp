// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/camera_source.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <utility>

#include "base/log.h"
#include "capture/field_order_file.h"
#include "capture/rig_file.h"
#include "capture/source/v4l2/buffer_stream.h"
#include "capture/source/v4l2/capture_format.h"
#include "capture/source/v4l2/driver_clock.h"
#include "capture/source/v4l2/frame_assembler.h"
#include "capture/source/v4l2/raw_picture.h"
#include "capture/source/v4l2/tv_standard.h"

namespace relievo::v4l2 {
namespace {

constexpr int kWait_ms = 50;  // at most until a stop is noticed
constexpr int kRetry_ms = 200;
constexpr std::int64_t kLookAtSignal_ns = 500'000'000;
constexpr int kMostRestarts = 3;  // without a picture between them
constexpr std::int64_t kSilent_ns = 5'000'000'000;
constexpr std::int64_t kSilentPictures = 10;  // at least, of slow cameras

/// A device that streams.
struct Session {
  Device device;
  CaptureFormat format;
  std::optional<BufferStream> stream;  // after the device, which it points to

  Status start(const CameraOptions& options) {
    stream.reset();
    auto started = BufferStream::start(device, {.buffers = options.buffers, .dmabuf = options.dmabuf});
    if (!started) return started.error();
    stream.emplace(*std::move(started));
    return {};
  }
};

/// As far as the driver can be asked, not streaming yet.
Result<std::unique_ptr<Session>> settle(Device device, const CameraOptions& options) {
  auto format = settle_format(device, options);
  if (!format) return format.error();
  return std::make_unique<Session>(Session{std::move(device), *format, std::nullopt});
}

class CameraSource final : public FieldSource {
 public:
  CameraSource(Io& io, SourceInfo info, CameraOptions options, std::unique_ptr<Session> session)
      : io_(io),
        info_(std::move(info)),
        options_(std::move(options)),
        path_(session->device.path()),
        format_(session->format),
        session_(std::move(session)),
        assembler_(format_, options_.odd_pairs),
        clock_(io.monotonic_ns(), io.utc_ns()) {}

  const SourceInfo& info() const override { return info_; }

  Result<std::optional<CapturedFrame>> next() override {
    while (!stopped_) {
      if (!session_) {
        if (const Status back = come_back(); !back) return back.error();
        continue;
      }
      if (const Status signal = look_at_signal(); !signal) return signal.error();
      const auto filled = session_->stream->take(kWait_ms);
      if (!filled && session_->stream->ended()) {
        if (const Status goes_on = after_the_end(); !goes_on) return goes_on.error();
        continue;
      }
      if (filled) {
        restarts_in_a_row_ = 0;
        if (auto frame = consume(*filled)) {
          silence_.reset();
          return frame;
        }
      }
      if (const Status heard = look_at_silence(filled.has_value()); !heard) return heard.error();
    }
    return std::optional<CapturedFrame>{};
  }

  void request_stop() override { stopped_ = true; }
  SourceCounts counts() const override { return counts_; }

 private:
  std::optional<CapturedFrame> consume(const Filled& filled) {
    std::optional<CapturedFrame> frame;
    if (no_signal_) {
      session_->stream->give_back(filled);
      return frame;
    }
    if (filled.damaged) {
      note_damage("the driver says");
    } else {
      const Place place = assembler_.place({filled.sequence, filled.field, start_of(filled)});
      if (place.picture != nullptr) {
        if (const Status written = write_picture(filled, format_, place); written) {
          frame = assembler_.finish();
        } else {
          note_damage(written.error().message);
        }
      }
    }
    session_->stream->give_back(filled);
    if (frame) {
      counts_.lost_frames += frame->lost_before;
      frame->time_ns = last_time_ns_ = std::max(frame->time_ns, last_time_ns_ + 1);
    }
    return frame;
  }

  /// Of the exposures in this buffer; drivers stamp when the last of them has come, unless they say
  /// otherwise.
  std::int64_t start_of(const Filled& filled) {
    const std::int64_t stamp = clock_.to_utc(filled.time_ns, filled.monotonic, io_.monotonic_ns());
    if (!filled.stamped_at_end) return stamp;
    return stamp - format_.picture_ns / (format_.layout == FieldLayout::kAlternate ? 2 : 1);
  }

  /// Fails once when the signal goes.
  Status look_at_signal() {
    const std::int64_t now = io_.monotonic_ns();
    if (now < look_again_ns_) return {};
    look_again_ns_ = now + kLookAtSignal_ns;
    const auto input = current_input(session_->device);
    const bool gone = input && !input->trouble.empty();
    if (!std::exchange(no_signal_, gone) && gone)
      return Error{path_ + ": " + input->trouble + " on input " + std::to_string(input->number) + " (" +
                   input->name + "): is the camera on, and the standard the right one?"};
    return {};
  }

  void note_damage(const std::string& what) {
    ++counts_.damaged_pictures;
    damage_ = what;
  }

  /// Fails once when there has been no frame for long, though nothing says that the camera does not work.
  Status look_at_silence(bool picture_came) {
    const std::int64_t now = io_.monotonic_ns();
    if (no_signal_) {
      silence_.reset();
      return {};
    }
    if (!silence_) silence_ = {.since_ns = now, .damaged_before = counts_.damaged_pictures};
    silence_->pictures += picture_came;
    const std::int64_t most = std::max(kSilent_ns, kSilentPictures * format_.picture_ns);
    if (silence_->told || now - silence_->since_ns < most) return {};
    silence_->told = true;
    const std::string lasted = std::to_string(most / 1'000'000'000) + " s";
    if (silence_->pictures == 0)
      return Error{path_ + ": no picture for " + lasted +
                   "; capture goes on when one comes: does it wait for a trigger, or hang?"};
    const std::uint64_t damaged = counts_.damaged_pictures - silence_->damaged_before;
    const std::string what =
        path_ + ": no frame for " + lasted + ": of " + std::to_string(silence_->pictures) + " pictures ";
    if (damaged == 0)
      return Error{what +
                   "none is followed by its other half: is every second one lost? Ask for a lower --rate"};
    return Error{what + std::to_string(damaged) + " are damaged (" + damage_ +
                 "): try another --format, --size or cable"};
  }

  /// Streaming ended by itself: starts it again where that can be, and fails where the camera is gone.
  Status after_the_end() {
    if (*session_->stream->ended() == StreamEnd::kUnplugged) {
      session_.reset();
      return Error{path_ + ": was unplugged; capture goes on when it is back"};
    }
    ++counts_.restarts;
    assembler_.restart();
    if (++restarts_in_a_row_ <= kMostRestarts && session_->start(options_)) return {};
    session_.reset();
    restarts_in_a_row_ = 0;
    return Error{path_ + ": the driver gave up streaming; it is opened anew until it works"};
  }

  /// One try after a while. Fails where the device is there but no longer takes its settings, once a reason.
  Status come_back() {
    io_.sleep_ms(kRetry_ms);
    auto device = Device::open(io_, path_);
    if (!device) return {};
    auto session = settle(*std::move(device), options_);
    Status streams = session ? (*session)->start(options_) : Status(session.error());
    if (streams && !same_frames((*session)->format))
      streams = Error{path_ + ": gives other pictures than before it was unplugged: start again"};
    if (!streams) {
      if (std::exchange(last_refusal_, streams.error().message) == streams.error().message) return {};
      return streams;
    }
    session_ = *std::move(session);
    format_.coding = session_->format.coding;
    format_.strides = session_->format.strides;
    last_refusal_.clear();
    assembler_.restart();
    look_again_ns_ = 0;
    no_signal_ = false;
    silence_.reset();
    ++counts_.reconnects;
    return {};
  }

  bool same_frames(const CaptureFormat& other) const {
    return other.pixels == format_.pixels && other.width == format_.width &&
           other.buffer_height == format_.buffer_height && other.layout == format_.layout &&
           other.order == format_.order && other.top_in_front == format_.top_in_front;
  }

  Io& io_;
  const SourceInfo info_;
  const CameraOptions options_;
  const std::string path_;
  CaptureFormat format_;
  std::unique_ptr<Session> session_;  // none while unplugged
  FrameAssembler assembler_;
  DriverClock clock_;
  std::atomic<bool> stopped_{false};
  SourceCounts counts_;
  std::string last_refusal_;
  std::int64_t last_time_ns_ = 0;
  std::int64_t look_again_ns_ = 0;  // at the signal
  bool no_signal_ = false;
  /// Since the last frame.
  struct Silence {
    std::int64_t since_ns = 0;
    std::uint64_t pictures = 0, damaged_before = 0;
    bool told = false;
  };
  std::optional<Silence> silence_;
  std::string damage_;  // of the last damaged picture
  int restarts_in_a_row_ = 0;
};

/// What the files say of rig and pattern.
Status read_files(const CameraOptions& options, SourceInfo& info) {
  std::filesystem::path pattern = options.pattern;
  if (!options.rig.empty()) {
    auto rig = read_rig(options.rig);
    if (!rig) return rig.error();
    info.rig = *std::move(rig);
    if (pattern.empty()) pattern = std::filesystem::path(options.rig).replace_filename("pattern.yaml");
  }
  if (pattern.empty()) return {};
  auto read = read_pattern(pattern);
  if (!read && options.pattern.empty() && !std::filesystem::exists(pattern))
    return Error{
        pattern.string() +
        " is missing, which says what is projected: copy the one that relievo-server pattern wrote, or "
        "name it with --pattern"};
  if (!read) return read.error();
  info.pattern = *std::move(read);
  return {};
}

/// A rig that says nothing but sizes: a camera and a projector of a usual field of view in one place.
Rig plain_rig(const CameraOptions& options) {
  Rig rig;
  rig.projector.width = options.projector_width;
  rig.projector.height = options.projector_height;
  rig.projector_from_camera_rotation = rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return rig;
}

void set_plain_matrix(PinholeModel& lens) {
  lens.matrix = {
      1.2 * lens.width, 0, 0.5 * (lens.width - 1), 0, 1.2 * lens.width, 0.5 * (lens.height - 1), 0, 0, 1};
}

/// Which field is exposed first is said by --field-order, else by rig.yaml, else by the driver, whose
/// statement is often none but a standard's.
void settle_field_order(const std::string& device, CameraOptions& options, CaptureFormat& format, Rig& rig) {
  const std::string driver(to_string(format.order)), file(to_string(rig.field_order));
  const bool overruled = format.scan() == Scan::kInterlaced && options.field_order.empty() &&
                         driver != file && !options.rig.empty() && states_field_order(options.rig);
  if (overruled) {
    log_warning(device + " says that the " + driver + " field is exposed first, and " + options.rig +
                " field_order: " + file + ", which holds; where the device is right, give --field-order " +
                driver + " (field_order of [camera])");
    options.field_order = file;  // also where the camera comes back
    format.order = rig.field_order;
  }
  rig.field_order = format.order;
}

}  // namespace

Result<std::unique_ptr<FieldSource>> open_camera(Io& io, const std::string& device,
                                                 const CameraOptions& wanted) {
  CameraOptions options = wanted;
  SourceInfo info;
  info.name = "v4l2:" + device;
  info.live = true;
  info.rig = plain_rig(options);
  if (const Status read = read_files(options, info); !read) return read.error();
  const bool calibrated = !options.rig.empty();
  if (calibrated && options.width == 0) {
    options.width = info.rig.camera.width;
    options.height = info.rig.camera.height;
  }
  if (calibrated && options.field.empty() && info.rig.scan == Scan::kProgressive)
    options.field = "progressive";
  auto opened = Device::open(io, device);
  if (!opened) return opened.error();
  auto session = settle(*std::move(opened), options);
  if (!session) return session.error();
  CaptureFormat& format = (*session)->format;
  PinholeModel& camera = info.rig.camera;
  if (calibrated && (camera.width != format.width || camera.height != format.frame_height()))
    return Error{options.rig + " is calibrated for pictures of " + std::to_string(camera.width) + "x" +
                 std::to_string(camera.height) + ", but " + device + " gives " +
                 std::to_string(format.width) + "x" + std::to_string(format.frame_height()) +
                 ": give --size, or calibrate anew"};
  if (calibrated && info.rig.scan != format.scan())
    return Error{options.rig + " is calibrated for an " + std::string(to_string(info.rig.scan)) +
                 " scan, but " + device + " gives " + std::string(to_string(format.scan())) +
                 " pictures: give --field"};
  camera.width = format.width;
  camera.height = format.frame_height();
  if (!calibrated) {
    set_plain_matrix(camera);
    set_plain_matrix(info.rig.projector);
  }
  settle_field_order(device, options, format, info.rig);
  info.rig.scan = format.scan();
  info.rig.frame_rate = format.frame_rate();
  if (const Status started = (*session)->start(options); !started) return started.error();
  // Coming back, the camera must give the same.
  options.format = format.pixels->name;
  options.width = camera.width;
  options.height = camera.height;
  return std::unique_ptr<FieldSource>(
      std::make_unique<CameraSource>(io, std::move(info), std::move(options), *std::move(session)));
}

Result<std::unique_ptr<FieldSource>> open_camera(const std::string& device, const SourceOptions& options) {
  return open_camera(kernel_io(), device, options.camera);
}

}  // namespace relievo::v4l2
