// SPDX-License-Identifier: Apache-2.0
// Calibrations of a server's rigs from the page /rig, one at a time: a server has one projector.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/calibration_session.h"

namespace relievo {

/// Every function may be called from any thread, but open() and close() by one.
class CalibrationDesk final : public CalibrationControl {
 public:
  /// Both must outlive it.
  CalibrationDesk(ProjectorDriver& projector, const ProjectorConfig& config)
      : projector_(projector), config_(config) {}

  /// From now on there are streams to calibrate.
  void open(StreamPauses& streams);
  /// Gives up what is under way, and waits for it; nothing can be calibrated any more.
  void close();
  /// Gives up what is under way; returns at once.
  void give_up();

  std::string report() override;
  std::shared_ptr<const Bytes> picture(const std::string& name) override;
  Status order(const CalibrationOrder& order) override;

 private:
  Status start(const CalibrationOrder& order);

  ProjectorDriver& projector_;
  const ProjectorConfig& config_;
  std::mutex mutex_;  // of what follows
  StreamPauses* streams_ = nullptr;
  std::unique_ptr<CalibrationSession> session_;
};

}  // namespace relievo
