// SPDX-License-Identifier: Apache-2.0
#include "server/keep_rig.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "base/time.h"
#include "base/whole_file.h"
#include "capture/field_order_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// "rig.before-20260131T120000.yaml", or with a number where that is there already.
fs::path name_of_old(const fs::path& file, std::int64_t utc_ns) {
  const std::string begin = file.stem().string() + ".before-" + utc_text(utc_ns, "%Y%m%dT%H%M%S");
  fs::path out = fs::path(file).replace_filename(begin + file.extension().string());
  std::error_code ignored;
  for (int n = 2; fs::exists(out, ignored); ++n)
    out.replace_filename(begin + "-" + std::to_string(n) + file.extension().string());
  return out;
}

}  // namespace

Status can_keep_rig(const fs::path& file) {
  std::error_code ignored;
  const auto cannot = [&](const std::string& why) {
    return Error{"the result could not be written to " + file.string() + ": " + why +
                 ", or start the server with another --rig FILE"};
  };
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored))
    return cannot("it is no file: take it away");
  const fs::path folder =
      fs::weakly_canonical(fs::absolute(file), ignored).parent_path();  // where a link leads
  if (!fs::is_directory(folder, ignored)) return cannot("make the folder " + folder.string());
  if (::faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) != 0)
    return cannot("let the server write in the folder " + folder.string() + " (" + write_failure(errno) +
                  ")");
  return {};
}

Result<std::string> keep_rig(const fs::path& file, std::string_view text, const Pattern& pattern,
                             std::int64_t utc_ns) {
  std::error_code failed;
  fs::path old;
  if (fs::exists(file, failed)) {
    old = name_of_old(file, utc_ns);
    fs::copy_file(file, old, failed);
    if (failed) {
      std::error_code ignored;
      fs::remove(old, ignored);
      return Error{"the rig so far cannot be kept as " + old.string() + ": " + failed.message()};
    }
  }
  const fs::path beside = fs::path(file).replace_filename("pattern.yaml");
  if (!fs::exists(beside, failed)) {
    if (const Status written = write_whole_file(beside, to_yaml(pattern)); !written) return written.error();
  }
  const std::string kept = keeping_field_order(std::string(text), file);
  if (const Status written = write_whole_file(file, kept); !written) return written.error();
  return old.filename().string();
}

}  // namespace relievo
