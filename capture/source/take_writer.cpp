// SPDX-License-Identifier: Apache-2.0
#include "capture/source/take_writer.h"

#include <unistd.h>

#include <cstdio>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/counted.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
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

/// Where links lead, and without the slash of "take/".
fs::path target_of(const fs::path& take) {
  std::error_code code;
  const fs::path named = fs::absolute(take, code);
  fs::path target = fs::weakly_canonical(named, code);
  if (code) target = named;  // links in a circle: check_free() says it
  return target.has_filename() ? target : target.parent_path();
}

/// In `folder`, of what becomes `target`.
fs::path partial_name(const fs::path& folder, const fs::path& target) {
  return folder / ("." + target.filename().string() + ".partial-" + std::to_string(getpid()));
}

Status check_free(const fs::path& take, const fs::path& target) {
  std::error_code code;
  const bool there = fs::exists(target, code);
  if (code) return Error{take.string() + " cannot be created: " + code.message()};
  if (!there || (fs::is_directory(target, code) && fs::is_empty(target, code))) return {};
  return Error{take.string() + " exists already: give a new folder or remove it"};
}

/// What fails is told by the name that was asked for, not by that of the folder until it is whole.
Status named(Status status, const fs::path& partial, const fs::path& take) {
  return status ? status : told_of(take, status.error(), partial);
}

/// `target`, or NAME-2 and so on beside it where something is there by now.
fs::path free_like(const fs::path& target) {
  fs::path out = target;
  for (int i = 2; !check_free(out, out); ++i)
    out = target.parent_path() / (target.filename().string() + "-" + std::to_string(i));
  return out;
}

/// A line of timestamps.csv.
std::string stamp_of(std::uint64_t number, std::int64_t time_ns) {
  char line[64];
  std::snprintf(line, sizeof line, "%llu,%.9f\n", static_cast<unsigned long long>(number),
                static_cast<double>(time_ns) * 1e-9);
  return line;
}

/// The pictures of the last frame, or what there is of them.
void remove_last(const fs::path& take, Scan scan, std::vector<std::string>& stamps) {
  stamps.pop_back();
  std::error_code ignored;
  const std::uint64_t pictures = scan == Scan::kProgressive ? 2 : 1;
  for (std::uint64_t i = 0; i < pictures; ++i)
    fs::remove(take_picture(take, pictures * stamps.size() + i), ignored);
  fs::remove(take_truth(take, stamps.size()), ignored);
}

Status write_texts(const fs::path& take, const SourceInfo& info, const std::vector<std::string>& stamps) {
  std::string times = "frame,time_s\n";
  for (const std::string& line : stamps) times += line;
  const std::pair<const char*, std::string> texts[] = {
      {"rig.yaml", to_yaml(info.rig)}, {"pattern.yaml", to_yaml(info.pattern)}, {"timestamps.csv", times}};
  for (const auto& [name, text] : texts) {
    if (Status s = write_whole_file(take / name, text); !s) return s;
  }
  return {};
}

/// `truth()`: of the frame that the source gave last.
Status write(const fs::path& take, FieldSource& source, const std::function<const ImageF&()>& truth,
             const TakeOptions& options) {
  std::error_code code;
  const fs::path whole = target_of(take);
  if (const Status free = check_free(take, whole); !free && !options.keep_written) return free;
  const auto above = NewFolder::create(whole.parent_path());
  if (!above) return above.error().in(take.string() + " cannot be created");
  PartialFolder partial(partial_name(whole.parent_path(), whole));
  for (const char* folder : {"frames", "truth"}) {
    if (!fs::create_directories(partial.path() / folder, code) && code) {
      return Error{take.string() + " cannot be created: " + code.message()};
    }
  }

  std::vector<std::string> stamps;
  bool with_truth = false;
  std::int64_t first_ns = 0;
  Status failed;  // of a frame, whose frames before are to be kept
  while (options.frames == 0 || stamps.size() < options.frames) {
    if (options.stop && *options.stop) return Error{"stopped: nothing was written to " + take.string()};
    Result<std::optional<CapturedFrame>> frame = source.next();
    if (!frame) return frame.error();
    if (!*frame) break;
    if (stamps.empty() && source.info().live) first_ns = (*frame)->time_ns;
    failed = named(write_frame(partial.path(), stamps.size(), **frame, truth()), partial.path(), take);
    if (!failed && !options.keep_written) return failed;
    stamps.push_back(stamp_of(stamps.size(), (*frame)->time_ns - first_ns));
    if (!failed) break;
    with_truth = with_truth || !truth().empty();
    if (options.progress) options.progress(stamps.size());
  }
  if (options.stop && *options.stop) return Error{"stopped: nothing was written to " + take.string()};
  if (stamps.empty())
    return Error{source.info().name + " gave no frame: nothing was written to " + take.string()};
  if (!with_truth) fs::remove(partial.path() / "truth", code);
  if (!failed) remove_last(partial.path(), source.info().rig.scan, stamps);
  if (stamps.empty()) return failed;
  const auto finish = [&] {
    return named(write_texts(partial.path(), source.info(), stamps), partial.path(), take);
  };
  Status finished = finish();
  while (!finished && options.keep_written && stamps.size() > 1) {
    if (failed) failed = finished;
    remove_last(partial.path(), source.info().rig.scan, stamps);  // makes room
    finished = finish();
  }
  if (!finished) return finished;
  const fs::path there = options.keep_written ? free_like(whole) : whole;
  if (finished = partial.rename_to(there); !finished) return finished;
  if (!failed)
    return Error{failed.error().message + " " + there.string() + " has the first " +
                 counted(stamps.size(), "frame")};
  if (there != whole) return Error{take.string() + " exists by now: the frames are in " + there.string()};
  return {};
}

}  // namespace

Status check_take_target(const fs::path& take) {
  const fs::path target = target_of(take);
  if (const Status free = check_free(take, target); !free) return free;
  std::error_code code;
  fs::path above = target.parent_path();
  while (above != above.parent_path() && !fs::exists(above, code)) above = above.parent_path();
  // Tried, not asked for: what rights say does not hold for root, nor on every disk.
  const fs::path trial = partial_name(above, target);
  if (fs::create_directory(trial, code)) {
    fs::remove(trial, code);
    return {};
  }
  if (!code) return {};  // one of that name is there, of a process that is gone
  return Error{take.string() + " cannot be created in " + above.string() + ": " + code.message()};
}

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
