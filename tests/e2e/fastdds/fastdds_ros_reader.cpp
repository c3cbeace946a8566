// SPDX-License-Identifier: Apache-2.0
// A node of ROS 2 as its Fast DDS middleware is one on the network: fastdds_ros_reader DOMAIN FOLDER TOPIC
// TYPE ... reads one message of each topic ("/face/points") by ROS's names of topic and type
// ("sensor_msgs/msg/PointCloud2") and writes its bytes to FOLDER/N.cdr, N from 0.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fstream>
#include <string>
#include <vector>

#include "tests/e2e/fastdds/loopback.h"

namespace {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

/// Any type, as it is on the wire.
class BytesType : public TopicDataType {
 public:
  explicit BytesType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1 << 24;
  }
  bool serialize(void*, SerializedPayload_t*) override { return false; }  // reads only
  bool deserialize(SerializedPayload_t* payload, void* into) override {
    static_cast<std::string*>(into)->assign(reinterpret_cast<const char*>(payload->data), payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0u; };
  }
  void* createData() override { return new std::string; }
  void deleteData(void* data) override { delete static_cast<std::string*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

/// "sensor_msgs/msg/PointCloud2" as its type is called on the network.
std::string mangled(const std::string& type) {
  const std::size_t first = type.find('/'), last = type.rfind('/');
  return type.substr(0, first) + "::msg::dds_::" + type.substr(last + 1) + "_";
}

bool read_one(DataReader& reader, const std::string& file) {
  for (;;) {
    if (!reader.wait_for_unread_message({60, 0})) return false;
    std::string bytes;
    SampleInfo info;
    if (reader.take_next_sample(&bytes, &info) != ReturnCode_t::RETCODE_OK || !info.valid_data) continue;
    std::ofstream(file, std::ios::binary) << bytes;
    return true;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) return 2;
  alarm(600);  // whatever happens to the test, this process ends
  DomainParticipant* const participant = DomainParticipantFactory::get_instance()->create_participant(
      static_cast<std::uint32_t>(std::atoi(argv[1])), on_loopback());
  if (participant == nullptr) return 1;
  Subscriber* const subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  std::vector<DataReader*> readers;
  for (int i = 3; i + 1 < argc; i += 2) {
    TypeSupport type(new BytesType(mangled(argv[i + 1])));
    type.register_type(participant);
    Topic* const topic =
        participant->create_topic(std::string("rt") + argv[i], type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 5;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
    readers.push_back(subscriber->create_datareader(topic, qos));
    if (readers.back() == nullptr) return 1;
  }
  std::fprintf(stderr, "reading\n");
  int status = 0;
  for (std::size_t i = 0; i < readers.size(); ++i)
    if (!read_one(*readers[i], std::string(argv[2]) + "/" + std::to_string(i) + ".cdr")) status = 1;
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
  return status;
}
