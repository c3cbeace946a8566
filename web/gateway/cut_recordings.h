// SPDX-License-Identifier: Apache-2.0
// Recordings that a crash cut short, with an index in memory: pages open them as if they were whole, and the
// files stay as they are.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>

#include "base/growing_recording.h"
#include "web/gateway/access.h"

namespace relievo {

/// Whether all of a long file may be gone through, which others are to wait for; and whether that is what it
/// takes.
struct Walk {
  bool allowed = false, needed = false;
};

/// Any thread. What was found of the last few files is kept. Null, too, where a walk is needed and not
/// allowed.
class CutRecordings {
 public:
  /// Of a file without an end, which is `status` now. Null where it may still be written (it was so in the
  /// last 5 s), or an index would leave out what is in it. One is made once, and said in the log.
  std::shared_ptr<const GrowingRecording> index_of(const std::filesystem::path& file,
                                                   const struct stat& status, Walk& walk);

  /// How the file grew, as somebody may have read it then.
  std::shared_ptr<const GrowingRecording> growth_of(const std::filesystem::path& file,
                                                    const struct stat& status, Walk& walk);

  /// Ends what is being made, for a gateway that stops: nothing is found any more.
  void stop() { stopped_ = true; }

 private:
  /// Made by one, while who may not walk goes on.
  struct Found {
    std::mutex making;
    bool made = false;
    std::shared_ptr<const GrowingRecording> recording;
  };
  struct Entry {
    FileMark mark;
    Found index, growth;
  };
  using Make = std::function<std::shared_ptr<const GrowingRecording>()>;
  std::shared_ptr<Entry> entry_of(const FileMark& mark);
  static std::shared_ptr<const GrowingRecording> find(Found& found, Walk& walk, const Make& make);

  std::atomic<bool> stopped_ = false;
  std::mutex mutex_;
  std::list<std::shared_ptr<Entry>> entries_;  // the one asked for last is the first
};

}  // namespace relievo
