// SPDX-License-Identifier: Apache-2.0
#include "capture/source/take_writer.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include "capture/source/npy.h"
#include "capture/source/take_files.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// A folder that is gone with everything in it unless it was renamed away.
class PartialFolder {
 public:
  explicit PartialFolder(fs::path path) : path_(std::move(path)) {}
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;
  ~PartialFolder() {
    std::error_code code;
    if (!path_.empty()) fs::remove_all(path_, code);
  }
  const fs::path& path() const { return path_; }

  Status rename_to(const fs::path& to) {
    std::error_code code;
    fs::remove(to, code);  // an empty folder may stand there
    fs::rename(path_, to, code);
    if (code) return Error{to.string() + " cannot be created: " + code.message()};
    path_.clear();
    return {};
  }

 private:
  fs::path path_;
};

Status write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) return Error{file.string() + " cannot be written: is the disk full?"};
  return {};
}

Status write_frame(const fs::path& take, std::uint64_t number, const CapturedFrame& frame,
                   const ImageF& truth) {
  const bool progressive = frame.scan == Scan::kProgressive;
  const std::uint64_t picture = progressive ? 2 * number : number;
  if (Status s = write_picture(take_picture(take, picture), frame.picture); !s) return s;
  if (progressive) {
    if (Status s = write_picture(take_picture(take, picture + 1), frame.complement); !s) return s;
  }
  return truth.empty() ? Status{} : write_npy(take_truth(take, number), truth);
}

/// `truth()`: of the frame that the source gave last.
Status write(const fs::path& take, FieldSource& source, const std::function<const ImageF&()>& truth,
             const TakeOptions& options) {
  std::error_code code;
  const fs::path target = fs::weakly_canonical(fs::absolute(take, code), code);  // where links lead
  const fs::path whole = target.has_filename() ? target : target.parent_path();  // "take/"
  if (fs::exists(whole, code) && !(fs::is_directory(whole, code) && fs::is_empty(whole, code))) {
    return Error{take.string() + " exists already: give a new folder or remove it"};
  }
  PartialFolder partial(whole.parent_path() /
                        ("." + whole.filename().string() + ".partial-" + std::to_string(getpid())));
  for (const char* folder : {"frames", "truth"}) {
    if (!fs::create_directories(partial.path() / folder, code) && code) {
      return Error{partial.path().string() + " cannot be created: " + code.message()};
    }
  }

  std::string stamps = "frame,time_s\n";
  std::uint64_t written = 0;
  bool with_truth = false;
  std::int64_t first_ns = 0;
  while (options.frames == 0 || written < options.frames) {
    if (options.stop && *options.stop) return Error{"stopped: nothing was written to " + take.string()};
    Result<std::optional<CapturedFrame>> frame = source.next();
    if (!frame) return frame.error();
    if (!*frame) break;
    if (written == 0 && source.info().live) first_ns = (*frame)->time_ns;
    if (Status s = write_frame(partial.path(), written, **frame, truth()); !s) return s;
    with_truth = with_truth || !truth().empty();
    char line[64];
    std::snprintf(line, sizeof line, "%llu,%.9f\n", static_cast<unsigned long long>(written),
                  static_cast<double>((*frame)->time_ns - first_ns) * 1e-9);
    stamps += line;
    ++written;
    if (options.progress) options.progress(written);
  }
  if (options.stop && *options.stop) return Error{"stopped: nothing was written to " + take.string()};
  if (written == 0)
    return Error{source.info().name + " gave no frame: nothing was written to " + take.string()};
  if (!with_truth) fs::remove(partial.path() / "truth", code);
  const std::pair<const char*, std::string> texts[] = {{"rig.yaml", to_yaml(source.info().rig)},
                                                       {"pattern.yaml", to_yaml(source.info().pattern)},
                                                       {"timestamps.csv", stamps}};
  for (const auto& [name, text] : texts) {
    if (Status s = write_text(partial.path() / name, text); !s) return s;
  }
  return partial.rename_to(whole);
}

}  // namespace

Status write_take(const fs::path& take, FieldSource& source, const TakeOptions& options) {
  const ImageF none;
  return write(
      take, source, [&]() -> const ImageF& { return none; }, options);
}

Status write_take(const fs::path& take, SimSource& source, const TakeOptions& options) {
  return write(
      take, source, [&]() -> const ImageF& { return source.truth(); }, options);
}

}  // namespace relievo
