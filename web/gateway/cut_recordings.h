// SPDX-License-Identifier: Apache-2.0
// Recordings that a crash cut short, with an index in memory: pages open them as if they were whole, and the
// files stay as they are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <mutex>

#include "base/growing_recording.h"
#include "web/gateway/access.h"

namespace relievo {

/// Any thread.
class CutRecordings {
 public:
  /// Of a file without an end, which is `status` now. Null where it may still be written (it was so in the
  /// last 5 s), or an index would leave out what is in it. Of the last few files they are kept, so that one
  /// is made once, and said in the log; that may wait for the disk, as long as reading the file does.
  std::shared_ptr<const GrowingRecording> index_of(const std::filesystem::path& file,
                                                   const struct stat& status);

  /// How the file grew, as somebody may have read it then. Never null; may read the heads of all its records.
  std::shared_ptr<const GrowingRecording> growth_of(const std::filesystem::path& file,
                                                    const struct stat& status);

 private:
  struct Entry {
    FileMark mark;
    std::mutex making;
    bool made = false, walked = false;
    std::shared_ptr<const GrowingRecording> index, growth;
  };
  std::shared_ptr<Entry> entry_of(const FileMark& mark);

  std::mutex mutex_;
  std::list<std::shared_ptr<Entry>> entries_;  // the one asked for last is the first
};

}  // namespace relievo
