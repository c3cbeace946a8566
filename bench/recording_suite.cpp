// SPDX-License-Identifier: Apache-2.0
// How soon a long recording shows any of its moments: a file of real frames, repeated.
#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <random>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "codec/frame3d_codec.h"
#include "codec/recording.h"
#include "idl/cdr.h"
#include "idl/transport.h"

namespace relievo::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kStart_ns = 1'700'000'000 * kNanosecondsPerSecond;
constexpr int kFramesPerSecond = 30;

struct Options {
  std::string source = "sim:object,width=1920,height=1080,stripes=300";
  int frames = 10;  // that are different
  double minutes = 10;
  int key_interval = 15;
  int seeks = 200;
  std::string folder;
  bool json = false;
};

std::int64_t time_of(std::uint64_t frame) {
  return kStart_ns + static_cast<std::int64_t>(frame) * kNanosecondsPerSecond / kFramesPerSecond;
}

/// A file that goes with the run.
class ScratchFile {
 public:
  explicit ScratchFile(const std::string& folder)
      : path_((folder.empty() ? fs::temp_directory_path() : fs::path(folder)) /
              ("relievo-bench-" + std::to_string(::getpid()) + ".mcap")) {}
  ~ScratchFile() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const fs::path& path() const { return path_; }

  /// Takes its bytes out of the system's cache: the next reads go to the disk.
  void forget_cached() const {
    const int file = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return;
    static_cast<void>(::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED));
    ::close(file);
  }

 private:
  const fs::path path_;
};

/// One group of a key frame and those that build on it, which repeats.
Result<std::vector<Bytes>> encode_group(const Options& options, const FrameLoop& loop,
                                        const std::vector<Frame3D>& frames) {
  FrameEncoder encoder(loop.info().rig, loop.info().pattern);
  const EncodeOptions encode{.geometry = GeometryCodec::kGrid, .key_interval = options.key_interval};
  std::vector<Bytes> group;
  for (int i = 0; i < options.key_interval; ++i) {
    auto bytes = encoder.encode(frames[static_cast<std::size_t>(i) % frames.size()], encode);
    if (!bytes) return bytes.error();
    group.push_back(std::move(*bytes));
  }
  return group;
}

Status write_recording(const Options& options, const std::vector<Bytes>& group, const fs::path& file,
                       StopSignal& stop) {
  auto writer = RecordingWriter::create(file, {.sync_ns = -1});
  if (!writer) return writer.error();
  const TopicType& type = topic_type(Topic::kFrame);
  const auto channel = (*writer)->add_channel(
      {type.type_name, "omgidl", type.idl}, {type.topic_name, "cdr", type.type_name, {{"stream", "bench"}}});
  if (!channel) return channel.error();
  const auto count = static_cast<std::uint64_t>(options.minutes * 60 * kFramesPerSecond);
  Progress progress("write", "frames", count);
  for (std::uint64_t i = 0; i < count && !stop.stopped(); ++i) {
    const std::int64_t time_ns = time_of(i);
    const Bytes cdr =
        write_frame_cdr({"bench", i, i, time_ns, time_ns, group[static_cast<std::size_t>(i % group.size())]});
    const auto sequence = static_cast<std::uint32_t>(i);
    if (auto status = (*writer)->write({*channel, sequence, time_ns, time_ns, cdr}); !status) return status;
    progress.update(i);
  }
  return (*writer)->finish();
}

/// To the frame at a time, with all that is needed to decode it.
Status show(RecordingReader& reader, std::int64_t time_ns) {
  const auto key_ns = reader.find_last(
      time_ns, [](std::uint16_t, std::span<const std::uint8_t> head) { return holds_key_frame(head); });
  if (!key_ns) return Error{"no key frame before a time"};
  if (auto status = reader.seek(*key_ns); !status) return status;
  for (;;) {
    const auto message = reader.next();
    if (!message) return message.error();
    if (!*message) return Error{"no frame at a time"};
    if ((**message).log_time_ns >= time_ns) return {};
  }
}

/// Of this thread: what others on the machine take is not in it.
std::int64_t thread_cpu_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
}

struct Measured {
  std::vector<double> open_ms, warm_ms, cold_ms, read_mb, cpu_ms;
};

Result<Measured> measure(const Options& options, const ScratchFile& file, StopSignal& stop) {
  Measured out;
  std::unique_ptr<RecordingReader> reader;
  for (int i = 0; i < 9; ++i) {
    const std::int64_t begin_ns = steady_now_ns();
    auto opened = RecordingReader::open(file.path());
    out.open_ms.push_back(milliseconds(steady_now_ns() - begin_ns));
    if (!opened) return opened.error();
    reader = *std::move(opened);
  }
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::int64_t> moment(reader->summary().start_ns, reader->summary().end_ns);
  for (int i = 0; i < 2 * options.seeks && !stop.stopped(); ++i) {
    const bool cold = i % 2 == 1;
    const std::int64_t time_ns = moment(random);
    if (cold) file.forget_cached();
    const std::uint64_t read = reader->bytes_read();
    const std::int64_t cpu_ns = thread_cpu_ns();
    const std::int64_t begin_ns = steady_now_ns();
    if (auto shown = show(*reader, time_ns); !shown) return shown.error();
    (cold ? out.cold_ms : out.warm_ms).push_back(milliseconds(steady_now_ns() - begin_ns));
    out.cpu_ms.push_back(milliseconds(thread_cpu_ns() - cpu_ns));
    out.read_mb.push_back(static_cast<double>(reader->bytes_read() - read) * 1e-6);
  }
  return out;
}

Status run(const Options& options, StopSignal& stop) {
  const auto loaded = load_reconstructed(options.source, options.frames + 1, stop);
  if (!loaded) return loaded.error();
  if (!*loaded) return {};
  const auto& [loop, frames] = **loaded;
  const auto group = encode_group(options, loop, frames);
  if (!group) return group.error();
  const ScratchFile file(options.folder);
  if (auto written = write_recording(options, *group, file.path(), stop); !written) return written;
  if (stop.stopped()) return {};
  const auto measured = measure(options, file, stop);
  if (!measured) return measured.error();
  std::error_code ignored;
  print(
      {.suite = "recording",
       .settings = {{"source", options.source},
                    {"minutes", options.minutes},
                    {"key_interval", static_cast<double>(options.key_interval)}},
       .figures = {{"file_mb", static_cast<double>(fs::file_size(file.path(), ignored)) * 1e-6},
                   {"open_ms", spread_of(measured->open_ms)},
                   {"seek_mb", spread_of(measured->read_mb)},
                   {"seek_cpu_ms", spread_of(measured->cpu_ms)}},
       .rows = {{"cached", {{"seek_ms", spread_of(measured->warm_ms)}}},
                {"from disk", {{"seek_ms", spread_of(measured->cold_ms)}}}},
       .notes =
           {"A seek: from the index to the key frame before a random time, and on to the frame at that time, "
            "all read (seek_mb) and their CRCs checked, which takes seek_cpu_ms of the processor. From disk: "
            "after the file was taken out of the "
            "system's "
            "cache."}},
      options.json);
  return {};
}

}  // namespace

Command recording_suite() {
  return {"recording", "Seeking in a long recording", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            app.add_option("--minutes", options->minutes, "Length of the recording at 30 frames a second")
                ->check(number(0.1, 600))
                ->capture_default_str();
            app.add_option("--key-interval", options->key_interval, "Every Nth frame decodes alone")
                ->check(whole_number(1, 1000))
                ->capture_default_str();
            app.add_option("--seeks", options->seeks, "Of each kind")
                ->check(whole_number(1, 100000))
                ->capture_default_str();
            app.add_option("--dir", options->folder,
                           "Where the file is written (default: the temporary folder)")
                ->type_name("DIR");
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
