// SPDX-License-Identifier: Apache-2.0
#include "idl/clock.h"

#include <dds/dds.h>

#include <unistd.h>

#include <array>
#include <cmath>
#include <mutex>
#include <random>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "idl/client_reports.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

/// A reader and a writer of a stream's exchange, and who is called when something came.
struct Ends {
  Entity read_group, write_group, reader, writer;

  Status open(std::int32_t participant, Role role, const std::string& stream) {
    const bool is_server = role == Role::kServer;
    auto readers = create_group(participant, role, false, stream);
    if (!readers) return readers.error();
    read_group = *std::move(readers);
    auto writers = create_group(participant, role, true, stream);
    if (!writers) return writers.error();
    write_group = *std::move(writers);
    auto made_reader = create_reader(participant, read_group.get(),
                                     is_server ? SideTopic::kClockQuestion : SideTopic::kClockAnswer);
    if (!made_reader) return made_reader.error();
    reader = *std::move(made_reader);
    auto made_writer = create_writer(participant, write_group.get(),
                                     is_server ? SideTopic::kClockAnswer : SideTopic::kClockQuestion);
    if (!made_writer) return made_writer.error();
    writer = *std::move(made_writer);
    return {};
  }

  template <typename Self>
  void listen(Self* self) const {
    const Listener listener(dds_create_listener(self));
    dds_lset_data_available(listener.get(),
                            [](const dds_entity_t, void* owner) { static_cast<Self*>(owner)->take(); });
    dds_set_listener(reader.get(), listener.get());
  }
  /// Waits for a call in progress.
  void end() const {
    if (reader.get() != 0) dds_set_listener(reader.get(), nullptr);
  }
};

std::optional<Histogram> histogram_of(const dds_sequence_unsigned_long_long& counts, double sum_s) {
  Histogram out;
  if (counts._length != out.counts.size() || !std::isfinite(sum_s) || sum_s < 0) return {};
  std::copy_n(counts._buffer, out.counts.size(), out.counts.begin());
  out.sum_s = sum_s;
  return out;
}

/// Nothing where the asker decodes nothing, is of a version that does not tell, or tells nonsense.
std::optional<ClientReport> report_of(const relievo_ClockQuestion& question) {
  const auto decode = histogram_of(question.decode_counts, question.decode_s);
  const auto decoded_after = histogram_of(question.decoded_after_counts, question.decoded_after_s);
  if (!decode || !decoded_after) return {};
  return ClientReport{.client = question.client == nullptr ? "" : question.client,
                      .id = question.asker,
                      .decode = *decode,
                      .decoded_after = *decoded_after,
                      .lost = question.lost,
                      .skipped = question.skipped};
}

std::string this_process() {
  std::array<char, 64> host{};
  gethostname(host.data(), host.size() - 1);
  return host.data() + (":" + std::to_string(getpid()));
}

class DdsClockService final : public ClockService {
 public:
  DdsClockService(std::string stream, Clock clock) : stream_(std::move(stream)), clock_(std::move(clock)) {}
  DdsClockService(const DdsClockService&) = delete;
  DdsClockService& operator=(const DdsClockService&) = delete;
  ~DdsClockService() override { ends_.end(); }

  Status open(const Domain& domain) {
    if (const Status opened = ends_.open(domain.participant(), Role::kServer, stream_); !opened)
      return opened;
    ends_.listen(this);
    return {};
  }

  void take() {
    const std::int64_t heard_ns = clock_();
    take_all(ends_.reader.get(), [&](const void* sample) {
      const auto& question = *static_cast<const relievo_ClockQuestion*>(sample);
      if (question.stream != stream_) return;
      relievo_ClockAnswer answer{};
      answer.stream = question.stream;
      answer.asker = question.asker;
      answer.asked_ns = question.asked_ns;
      answer.heard_ns = heard_ns;
      answer.answered_ns = clock_();
      dds_write(ends_.writer.get(), &answer);
      if (auto report = report_of(question)) {
        const std::lock_guard lock(mutex_);
        book_.add(*std::move(report), steady_now_ns());
      }
    });
  }

  ClientReports client_reports() const override {
    const std::lock_guard lock(mutex_);
    return book_.reports(steady_now_ns());
  }

 private:
  const std::string stream_;
  const Clock clock_;
  mutable std::mutex mutex_;
  ClientReportBook book_;  // by mutex_
  Ends ends_;
};

class DdsClockProbe final : public ClockProbe {
 public:
  DdsClockProbe(std::shared_ptr<Domain> domain, std::string stream)
      : domain_(std::move(domain)), stream_(std::move(stream)) {
    std::random_device random;
    asker_ = static_cast<std::uint64_t>(random()) << 32 | random();
  }
  DdsClockProbe(const DdsClockProbe&) = delete;
  DdsClockProbe& operator=(const DdsClockProbe&) = delete;
  ~DdsClockProbe() override { ends_.end(); }

  Status open() {
    if (const Status opened = ends_.open(domain_->participant(), Role::kWatcher, stream_); !opened)
      return opened;
    ends_.listen(this);
    return {};
  }

  void ask() override {
    relievo_ClockQuestion question{};
    question.client = const_cast<char*>("");
    write(question);
  }

  void ask(const ClientReport& report) override {
    relievo_ClockQuestion question{};
    question.client = const_cast<char*>(name_.c_str());
    const auto lend = [](const Histogram& histogram) {
      const auto size = static_cast<std::uint32_t>(histogram.counts.size());
      return dds_sequence_unsigned_long_long{size, size, const_cast<std::uint64_t*>(histogram.counts.data()),
                                             false};
    };
    question.decode_counts = lend(report.decode);
    question.decode_s = report.decode.sum_s;
    question.decoded_after_counts = lend(report.decoded_after);
    question.decoded_after_s = report.decoded_after.sum_s;
    question.lost = report.lost;
    question.skipped = report.skipped;
    write(question);
  }

  std::optional<ClockOffset> offset() const override {
    const std::lock_guard lock(mutex_);
    return estimate_.best();
  }

  void take() {
    const std::int64_t returned_ns = utc_now_ns();
    take_all(ends_.reader.get(), [&](const void* sample) {
      const auto& answer = *static_cast<const relievo_ClockAnswer*>(sample);
      if (answer.asker != asker_ || answer.stream != stream_) return;
      const std::lock_guard lock(mutex_);
      estimate_.add({answer.asked_ns, answer.heard_ns, answer.answered_ns, returned_ns});
    });
  }

 private:
  void write(relievo_ClockQuestion& question) {
    question.stream = const_cast<char*>(stream_.c_str());  // only read
    question.asker = asker_;
    question.asked_ns = utc_now_ns();
    dds_write(ends_.writer.get(), &question);
  }

  const std::shared_ptr<Domain> domain_;
  const std::string stream_;
  const std::string name_ = this_process();
  std::uint64_t asker_ = 0;
  Ends ends_;
  mutable std::mutex mutex_;
  ClockEstimate estimate_;
};

}  // namespace

Result<std::unique_ptr<ClockService>> ClockService::create(const Domain& domain, const std::string& stream,
                                                           Clock clock) {
  auto self = std::make_unique<DdsClockService>(stream, clock ? std::move(clock) : Clock(utc_now_ns));
  if (const Status opened = self->open(domain); !opened) return opened.error();
  return std::unique_ptr<ClockService>(std::move(self));
}

std::unique_ptr<ClockService> create_clock_service(const Domain& domain, const std::string& stream,
                                                   Clock clock) {
  auto service = ClockService::create(domain, stream, std::move(clock));
  if (service) return *std::move(service);
  log_warning("clients cannot compare their clocks with this one (" + service.error().message +
              "): keys made by relievo keys of this version allow it");
  return nullptr;
}

Result<std::unique_ptr<ClockProbe>> ClockProbe::create(const DomainOptions& options,
                                                       const std::string& stream) {
  if (!valid_stream_name(stream)) return Error{"'" + stream + "' cannot name a stream"};
  auto domain = Domain::open(options);
  if (!domain) return domain.error();
  auto self = std::make_unique<DdsClockProbe>(*std::move(domain), stream);
  if (const Status opened = self->open(); !opened) return opened.error();
  return std::unique_ptr<ClockProbe>(std::move(self));
}

}  // namespace relievo
