// SPDX-License-Identifier: Apache-2.0
// A recording that is played as a stream of the gateway, and that pages read themselves.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/result.h"
#include "cli/stop_signal.h"
#include "client/recorded_stream.h"
#include "web/gateway/access.h"
#include "web/gateway/gateway.h"

namespace relievo {

/// A file as it was found. Both are of the same file, or the mark is of one that was replaced meanwhile.
struct FoundRecording {
  std::string file;
  FileMark mark;
  RecordedStream recorded;

  /// Fails as RecordedStream::open() does, of the file's only stream; and where no frame is in it, nor will
  /// be.
  static Result<FoundRecording> open(const std::string& file);
};

/// Played in a loop on a thread of its own, straight into the gateway. One that is being written is gone on
/// with at its end. Where another file takes its place, that one is played from then on; while it is empty,
/// or no recording, its stream is gone. Made, looked at and destroyed by one thread.
class LoopedFile {
 public:
  /// `streams`: all names that are taken, this one's among them, which it changes where the file does; it,
  /// `gateway` and `stop` must outlive it.
  LoopedFile(FoundRecording found, std::set<std::string>& streams, Gateway& gateway, StopSignal& stop);
  LoopedFile(const LoopedFile&) = delete;
  LoopedFile& operator=(const LoopedFile&) = delete;
  /// The stop signal must be given before.
  ~LoopedFile();

  /// To be called every few tenths of a second: offers what there is to read, and takes up what is new.
  void look();

 private:
  struct Playing;
  void start(FoundRecording found);
  void leave();
  void take_up(const FileMark& mark, bool was_cut);
  void offer();
  bool is_another(const FileMark& mark) const;
  bool was_left_unread(const FileMark& mark) const;
  void tell_of(const std::string& missing);
  void run(Playing& playing);
  Status publish(const Playing& playing, const RawSample& sample);

  const std::string file_;
  std::set<std::string>& streams_;
  Gateway& gateway_;
  StopSignal& stop_;
  std::string missing_;  // why it cannot be read, as it was told
  FileMark refused_;     // what was no recording, or not this program's to play
  std::string why_;      // it was not
  FileMark seen_;        // when it was last looked at
  std::unique_ptr<Playing> playing_;
  std::vector<std::unique_ptr<Playing>> left_;  // that end at their next frame

  std::mutex mutex_;  // so that nothing of what is left is published any more; and of what follows
  std::uint64_t sequence_ = 0;
};

}  // namespace relievo
