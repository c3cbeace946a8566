// SPDX-License-Identifier: Apache-2.0
// A program of before, over real DDS.
#pragma once

#include <dds/dds.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "idl/domain.h"
#include "idl/topics.h"

namespace relievo::test {

/// Reads or writes an old type under the name that it has on the network.
class OldPeer {
 public:
  struct Options {
    DomainOptions domain;
    std::string stream;
    Role role = Role::kWatcher;
    bool writes = false;
    const char* topic = nullptr;
  };
  /// `qos`: with all but the representation of the data, which is set.
  OldPeer(const Options& options, dds_topic_descriptor_t old, const dds_topic_descriptor_t& now, Qos qos)
      : domain_(Domain::open(options.domain).value()),
        participant_(
            dds_create_participant(static_cast<dds_domainid_t>(options.domain.domain), nullptr, nullptr)) {
    old.m_typename = now.m_typename;
    const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR2;
    dds_qset_data_representation(qos.get(), 1, &representation);
    const dds_entity_t topic = dds_create_topic(participant_.get(), &old, options.topic, qos.get(), nullptr);
    EXPECT_GT(topic, 0);
    group_ = create_group(participant_.get(), options.role, options.writes, options.stream).value();
    end_ = Entity(options.writes ? dds_create_writer(group_.get(), topic, qos.get(), nullptr)
                                 : dds_create_reader(group_.get(), topic, qos.get(), nullptr));
    EXPECT_GT(end_.get(), 0);
  }
  std::int32_t end() const { return end_.get(); }

 private:
  std::shared_ptr<Domain> domain_;  // with the network's settings
  Entity participant_, group_, end_;
};

}  // namespace relievo::test
