// SPDX-License-Identifier: Apache-2.0
#include "idl/security.h"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/stream.h"
#include "idl/dds_log.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

constexpr std::size_t kMaxSaid = 256;      // what a hostile peer can make us say,
constexpr std::size_t kMaxCounted = 4096;  // and remember

std::atomic<std::uint64_t> g_plain_readers{0};

bool is_in(const dds_qos_t* qos, const std::string& stream) {
  std::uint32_t count = 0;
  char** names = nullptr;
  if (!dds_qget_partition(qos, &count, &names)) return false;
  bool found = count == 0;  // the same as one without a name: all streams
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string name = names[i];
    found = found || name.empty() || name == stream || name.find_first_of("*?[") != std::string::npos;
    dds_free(names[i]);
  }
  dds_free(names);
  return found;
}

}  // namespace

Result<Entity> create_secured_participant(int domain, const Keys& keys) {
  const Qos qos(dds_create_qos());
  const auto set = [&](const char* name, const std::string& value) {
    dds_qset_prop(qos.get(), name, value.c_str());
  };
  const auto set_file = [&](const char* name, const char* file) {
    set(name, "file:" + (keys.folder / file).string());
  };
  for (const auto& [service, library, function] :
       {std::tuple{"dds.sec.auth.library.", "dds_security_auth", "authentication"},
        {"dds.sec.crypto.library.", "dds_security_crypto", "crypto"},
        {"dds.sec.access.library.", "dds_security_ac", "access_control"}}) {
    set((std::string(service) + "path").c_str(), library);
    set((std::string(service) + "init").c_str(), std::string("init_") + function);
    set((std::string(service) + "finalize").c_str(), std::string("finalize_") + function);
  }
  set_file("dds.sec.auth.identity_ca", key_files::kAuthority);
  set_file("dds.sec.auth.identity_certificate", key_files::kIdentity);
  set_file("dds.sec.auth.private_key", key_files::kPrivate);
  set_file("org.eclipse.cyclonedds.sec.auth.crl", key_files::kRevoked);
  set_file("dds.sec.access.permissions_ca", key_files::kAuthority);
  set_file("dds.sec.access.governance", key_files::kGovernance);
  set_file("dds.sec.access.permissions", key_files::kPermissions);
  auto participant = take_entity(
      dds_create_participant(static_cast<dds_domainid_t>(domain), qos.get(), nullptr), "secured participant");
  if (!participant)
    return Error{participant.error().message + "; the keys in " + keys.folder.string() +
                 " were refused, or Cyclone DDS's security libraries are missing"};
  return participant;
}

Status check_may_publish(const Domain& domain) {
  const Keys* keys = domain.keys();
  if (keys == nullptr || keys->may_publish) return {};
  return Error{"the keys in " + keys->folder.string() +
               " let their holder watch streams, not publish them: ask for others (relievo keys add-client "
               "NAME --publish)"};
}

/// Readers of a stream's frames in the plain domain, each counted when it is first seen.
class SecuredNotice::PlainReaders {
 public:
  explicit PlainReaders(std::string stream) : stream_(std::move(stream)) {}
  PlainReaders(const PlainReaders&) = delete;
  PlainReaders& operator=(const PlainReaders&) = delete;
  ~PlainReaders() {
    if (reader_.get() != 0) dds_set_listener(reader_.get(), nullptr);  // waits for a call in progress
  }

  Status listen(std::int32_t participant) {
    auto reader =
        take_entity(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, nullptr, nullptr),
                    "reader of discovered readers");
    if (!reader) return reader.error();
    reader_ = std::move(reader).value();
    const Listener listener(dds_create_listener(this));
    dds_lset_data_available(listener.get(),
                            [](dds_entity_t, void* self) { static_cast<PlainReaders*>(self)->take(); });
    dds_set_listener(reader_.get(), listener.get());
    take();  // who was there before
    return {};
  }

 private:
  void take() {
    const std::lock_guard lock(mutex_);
    take_all(reader_.get(), [this](const void* sample) {
      const auto& endpoint = *static_cast<const dds_builtintopic_endpoint_t*>(sample);
      if (endpoint.topic_name != topic_type(Topic::kFrame).topic_name || !is_in(endpoint.qos, stream_))
        return;
      std::array<std::uint8_t, sizeof endpoint.key.v> key{};
      std::copy(std::begin(endpoint.key.v), std::end(endpoint.key.v), key.begin());
      if (seen_.size() < kMaxCounted && seen_.insert(key).second) ++g_plain_readers;
    });
  }

  const std::string stream_;
  std::mutex mutex_;
  std::set<std::array<std::uint8_t, sizeof(dds_guid_t::v)>> seen_;
  Entity reader_;
};

RefusedPeers refused_peers() {
  return {.handshakes = refused_handshakes(), .plain = g_plain_readers};
}

Result<SecuredNotice> SecuredNotice::create(const Domain& domain, const std::string& stream) {
  SecuredNotice notice;
  const Keys* keys = domain.keys();
  const std::int32_t participant = domain.plain_participant();
  if (keys == nullptr || participant == 0) return notice;
  auto group = create_group(participant, Role::kServer, true, stream);
  if (!group) return group.error();
  notice.group_ = std::move(group).value();
  auto writer = create_writer(participant, notice.group_.get(), SideTopic::kSecuredNotice);
  if (!writer) return writer.error();
  notice.writer_ = std::move(writer).value();
  std::vector<char*> revoked;  // dds_write only reads them
  for (const std::string& serial : keys->revoked) revoked.push_back(const_cast<char*>(serial.c_str()));
  relievo_SecuredNotice sample{};
  sample.stream = const_cast<char*>(stream.c_str());
  sample.authority = const_cast<char*>(keys->authority.c_str());
  sample.revoked._length = sample.revoked._maximum = static_cast<std::uint32_t>(revoked.size());
  sample.revoked._buffer = revoked.data();
  if (const auto code = dds_write(notice.writer_.get(), &sample); code < 0)
    return dds_error(code, "cannot say that the stream is secured");
  notice.plain_readers_ = std::make_shared<PlainReaders>(stream);
  if (const Status listens = notice.plain_readers_->listen(participant); !listens) return listens.error();
  return notice;
}

Result<std::unique_ptr<SecuredNoticeListener>> SecuredNoticeListener::create(const Domain& domain,
                                                                             const std::string& stream) {
  std::unique_ptr<SecuredNoticeListener> self(new SecuredNoticeListener(domain));
  const std::int32_t participant = domain.plain_participant();
  if (participant == 0) return self;
  auto group = create_group(participant, Role::kWatcher, false, stream);
  if (!group) return group.error();
  self->group_ = std::move(group).value();
  auto notices = create_reader(participant, self->group_.get(), SideTopic::kSecuredNotice);
  if (!notices) return notices.error();
  self->notices_ = std::move(notices).value();
  if (domain.keys() != nullptr) {
    auto streams = create_reader(participant, self->group_.get(), Topic::kInfo);
    if (!streams) return streams.error();
    self->plain_streams_ = std::move(streams).value();
  }
  const Listener listener(dds_create_listener(self.get()));
  const auto listen = [&](const Entity& reader, dds_on_data_available_fn call) {
    if (reader.get() == 0) return;
    dds_lset_data_available(listener.get(), call);
    dds_set_listener(reader.get(), listener.get());
  };
  listen(self->notices_,
         [](dds_entity_t, void* to) { static_cast<SecuredNoticeListener*>(to)->take_notices(); });
  listen(self->plain_streams_,
         [](dds_entity_t, void* to) { static_cast<SecuredNoticeListener*>(to)->take_plain_streams(); });
  return self;
}

SecuredNoticeListener::~SecuredNoticeListener() {
  for (const Entity* reader : {&notices_, &plain_streams_})
    if (reader->get() != 0) dds_set_listener(reader->get(), nullptr);  // waits for a call in progress
}

void SecuredNoticeListener::take_notices() {
  take_all(notices_.get(), [this](const void* sample) {
    const auto& notice = *static_cast<const relievo_SecuredNotice*>(sample);
    const Keys* keys = domain_.keys();
    const auto is_ours = [&](const char* serial) { return keys->serial == serial; };
    if (keys == nullptr) {
      say(notice.stream,
          "is secured and this machine has no keys: ask whoever runs its server for keys (relievo keys "
          "add-client "
          "NAME makes a folder of them), then give that folder with --keys or as " +
              user_keys_folder().string());
    } else if (keys->authority != notice.authority) {
      say(notice.stream, "is secured by another authority than the one of the keys in " +
                             keys->folder.string() + ": ask whoever runs its server for keys");
    } else if (std::any_of(notice.revoked._buffer, notice.revoked._buffer + notice.revoked._length,
                           is_ours)) {
      say(notice.stream,
          "does not take the keys in " + keys->folder.string() + " any more: they were revoked");
    }
  });
}

void SecuredNoticeListener::take_plain_streams() {
  take_all(plain_streams_.get(), [this](const void* sample) {
    const auto& info = *static_cast<const relievo_StreamInfo*>(sample);
    say(info.stream, "is not secured, and with keys only secured streams are read: --keys none reads it");
  });
}

void SecuredNoticeListener::say(const std::string& stream, const std::string& why) {
  if (!valid_stream_name(stream) || said_.size() >= kMaxSaid || !said_.insert(stream).second) return;
  log_warning("stream '" + stream + "' " + why);
}

}  // namespace relievo
