// SPDX-License-Identifier: Apache-2.0
#include "idl/client_reports.h"

#include <utility>

namespace relievo {
namespace {

std::string printable(std::string name) {
  if (name.size() > ClientReportBook::kMaxName) name.resize(ClientReportBook::kMaxName);
  for (char& c : name)
    if (c < ' ' || c > '~') c = '?';
  return name;
}

void add_since(Histogram& sum, const Histogram& now, const Histogram& before) {
  if (const auto more = now.since(before)) sum += *more;
}

}  // namespace

void ClientReportBook::add(ClientReport report, std::int64_t now_ns) {
  std::erase_if(clients_, [&](const auto& entry) { return now_ns - entry.second.heard_ns > kForget_ns; });
  const auto known = clients_.find(report.id);
  if (known == clients_.end()) {
    if (clients_.size() >= kMaxClients) return;
  } else {
    add_since(decode_, report.decode, known->second.report.decode);
    add_since(decoded_after_, report.decoded_after, known->second.report.decoded_after);
  }
  report.client = printable(std::move(report.client));
  const std::uint64_t id = report.id;
  clients_[id] = {std::move(report), now_ns};
}

ClientReports ClientReportBook::reports(std::int64_t now_ns) const {
  ClientReports out{.clients = {}, .decode = decode_, .decoded_after = decoded_after_};
  for (const auto& [id, entry] : clients_)
    if (now_ns - entry.heard_ns <= kForget_ns) out.clients.push_back(entry.report);
  return out;
}

}  // namespace relievo
