// SPDX-License-Identifier: Apache-2.0
// A reader of a stream that shares nothing with ours, not the DDS implementation either:
// fastdds_reader DOMAIN STREAM FRAMES reads so many frames with Fast DDS and prints a line each:
// SEQUENCE FRAME BYTES SUM, the sum of all bytes.
#include <unistd.h>

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <string>
#include <vector>

#include "tests/e2e/fastdds/loopback.h"

namespace {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

/// relievo::Frame of idl/relievo.idl.
struct Frame {
  std::string stream;
  std::uint64_t sequence_number = 0, frame_number = 0;
  std::int64_t capture_time_ns = 0, publish_time_ns = 0;
  std::vector<std::uint8_t> data;
};

class FrameType : public TopicDataType {
 public:
  FrameType() {
    setName("relievo::Frame");
    m_typeSize = 1 << 20;
    m_isGetKeyDefined = true;
  }
  bool serialize(void*, SerializedPayload_t*) override { return false; }  // reads only
  bool deserialize(SerializedPayload_t* payload, void* into) override {
    using namespace eprosima::fastcdr;
    auto& frame = *static_cast<Frame*>(into);
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    try {
      cdr.read_encapsulation();
      cdr >> frame.stream >> frame.sequence_number >> frame.frame_number >> frame.capture_time_ns >>
          frame.publish_time_ns >> frame.data;
    } catch (const std::exception& failure) {
      std::fprintf(stderr, "%s\n", failure.what());
      return false;
    }
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0u; };
  }
  void* createData() override { return new Frame; }
  void deleteData(void* data) override { delete static_cast<Frame*>(data); }
  bool getKey(void*, InstanceHandle_t* handle, bool) override {
    *handle = InstanceHandle_t();  // one stream: one instance
    handle->value[0] = 1;
    return true;
  }
};

int read_frames(DataReader& reader, int frames) {
  for (int n = 0; n < frames;) {
    if (!reader.wait_for_unread_message({60, 0})) return 1;
    Frame frame;
    SampleInfo info;
    while (n < frames && reader.take_next_sample(&frame, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      unsigned sum = 0;
      for (const std::uint8_t byte : frame.data) sum += byte;
      std::printf("%llu %llu %zu %u\n", static_cast<unsigned long long>(frame.sequence_number),
                  static_cast<unsigned long long>(frame.frame_number), frame.data.size(), sum);
      ++n;
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  alarm(600);  // whatever happens to the test, this process ends
  DomainParticipant* const participant = DomainParticipantFactory::get_instance()->create_participant(
      static_cast<std::uint32_t>(std::atoi(argv[1])), on_loopback());
  if (participant == nullptr) return 1;
  TypeSupport type(new FrameType);
  type.register_type(participant);
  Topic* const topic = participant->create_topic("relievo/frame", type.get_type_name(), TOPIC_QOS_DEFAULT);
  SubscriberQos group = SUBSCRIBER_QOS_DEFAULT;
  group.partition().push_back(argv[2]);
  Subscriber* const subscriber = participant->create_subscriber(group);
  DataReaderQos qos = DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 32;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  DataReader* const reader = subscriber->create_datareader(topic, qos);
  if (reader == nullptr) return 1;
  std::fprintf(stderr, "reading\n");
  const int status = read_frames(*reader, std::atoi(argv[3]));
  std::fflush(stdout);
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
  return status;
}
