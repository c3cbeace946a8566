// SPDX-License-Identifier: Apache-2.0
#include "server/calibration_desk.h"

#include <utility>

#include "capture/calibrate/board.h"
#include "server/keep_rig.h"

namespace relievo {
namespace {

/// Why the stream's rig cannot be calibrated here.
Status may_calibrate(const StreamConfig& config, const ProjectorConfig& projector,
                     const CalibrationOrder& order) {
  const bool simulated = config.source.starts_with("sim:");
  if (!simulated && !config.source.starts_with("v4l2:"))
    return Error{config.source + " has no camera of its own: calibrate with relievo-server calibrate"};
  if (config.camera.rig.empty())
    return Error{"the server does not say where the result goes: start it with --rig FILE"};
  if (const Status may = can_keep_rig(config.camera.rig); !may) return may;
  if (!simulated && projector.output.empty())
    return Error{"this server drives no projector: start it with --projector NAME"};
  if (order.kind != "geometry") return {};
  const auto board = parse_board(order.board);
  return board ? Status() : Status(board.error());
}

}  // namespace

void CalibrationDesk::open(StreamPauses& streams) {
  const std::lock_guard lock(mutex_);
  streams_ = &streams;
}

void CalibrationDesk::close() {
  std::unique_ptr<CalibrationSession> last;
  {
    const std::lock_guard lock(mutex_);
    streams_ = nullptr;
    last = std::move(session_);
  }
}

void CalibrationDesk::give_up() {
  const std::lock_guard lock(mutex_);
  if (session_ != nullptr) (void)session_->order("cancel");
}

std::string CalibrationDesk::report() {
  const std::lock_guard lock(mutex_);
  return to_json(session_ == nullptr ? CalibrationState{} : session_->state());
}

std::shared_ptr<const Bytes> CalibrationDesk::picture(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return session_ == nullptr ? nullptr : session_->picture(name);
}

Status CalibrationDesk::order(const CalibrationOrder& order) {
  const std::lock_guard lock(mutex_);
  if (order.action == "start") return start(order);
  return session_ == nullptr ? Status(Error{"no calibration is under way"}) : session_->order(order.action);
}

/// With the lock held.
Status CalibrationDesk::start(const CalibrationOrder& order) {
  if (session_ != nullptr && !session_->ended()) return Error{"a calibration is under way already"};
  const auto config = streams_ == nullptr ? std::nullopt : streams_->config_of(order.stream);
  if (!config) return Error{"there is no stream '" + order.stream.substr(0, 64) + "' here"};
  if (const Status may = may_calibrate(*config, config_, order); !may) return may;
  session_.reset();  // it has ended: at once
  session_ = std::make_unique<CalibrationSession>(
      CalibrationPlace{.streams = *streams_, .projector = projector_, .config = config_}, *config, order);
  return {};
}

}  // namespace relievo
