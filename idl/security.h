// SPDX-License-Identifier: Apache-2.0
// Secured participants, and what those are told who cannot read a secured stream. Internal to idl/.
#pragma once

#include <memory>
#include <set>
#include <string>

#include "base/result.h"
#include "idl/domain.h"
#include "idl/entity.h"
#include "idl/keys.h"

namespace relievo {

/// The domain must exist.
Result<Entity> create_secured_participant(int domain, const Keys& keys);

/// Fails with keys that let their holder watch only.
Status check_may_publish(const Domain& domain);

/// Says in plain, while it lives, that `stream` is secured and by whom, and counts who would read its frames
/// in plain nevertheless. Does nothing in a plain domain.
class SecuredNotice {
 public:
  static Result<SecuredNotice> create(const Domain& domain, const std::string& stream);

 private:
  class PlainReaders;

  Entity group_, writer_;
  std::shared_ptr<PlainReaders> plain_readers_;
};

/// Listens in plain, and logs once a stream why this process cannot read it: no keys, those of another
/// authority, revoked ones, or keys where the stream is plain.
class SecuredNoticeListener {
 public:
  /// `stream` empty: all. `domain` must outlive it.
  static Result<std::unique_ptr<SecuredNoticeListener>> create(const Domain& domain,
                                                               const std::string& stream);
  ~SecuredNoticeListener();
  SecuredNoticeListener(const SecuredNoticeListener&) = delete;
  SecuredNoticeListener& operator=(const SecuredNoticeListener&) = delete;

 private:
  explicit SecuredNoticeListener(const Domain& domain) : domain_(domain) {}
  void take_notices();
  void take_plain_streams();
  void say(const std::string& stream, const std::string& why);

  const Domain& domain_;
  Entity group_, notices_, plain_streams_;
  std::set<std::string> said_;  // of the listener's thread
};

}  // namespace relievo
