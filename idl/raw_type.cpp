// SPDX-License-Identifier: Apache-2.0
#include "idl/raw_type.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

namespace relievo {

Result<RawType> RawType::find(std::int32_t participant, const Create& create_reader,
                              const Create& create_writer, const void* sample) {
  static std::atomic<unsigned> count = 0;
  const std::string partition =
      ".relievo-probe-" + std::to_string(getpid()) + '-' + std::to_string(count.fetch_add(1));
  const char* partitions[] = {partition.c_str()};
  const Qos qos(dds_create_qos());
  dds_qset_partition(qos.get(), 1, partitions);
  auto publisher = take_entity(dds_create_publisher(participant, qos.get(), nullptr), "publisher");
  if (!publisher) return publisher.error();
  auto subscriber = take_entity(dds_create_subscriber(participant, qos.get(), nullptr), "subscriber");
  if (!subscriber) return subscriber.error();
  auto reader = create_reader(subscriber->get());
  if (!reader) return reader.error();
  auto writer = create_writer(publisher->get());
  if (!writer) return writer.error();

  const auto code = dds_write(writer->get(), sample);
  if (code < 0) return dds_error(code, "cannot prepare raw publishing");
  for (int attempt = 0; attempt < 100; ++attempt) {
    ddsi_serdata* data = nullptr;
    dds_sample_info_t sample_info;
    if (dds_takecdr(reader->get(), &data, 1, &sample_info, DDS_ANY_STATE) == 1) {
      ddsi_sertype* type = sample_info.valid_data ? ddsi_sertype_ref(data->type) : nullptr;
      ddsi_serdata_unref(data);
      if (type != nullptr) return RawType(type);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return Error{"cannot prepare raw publishing: no sample came back within a second"};
}

RawType::~RawType() {
  if (type_ != nullptr) ddsi_sertype_unref(type_);
}

ddsi_serdata* RawType::make(std::span<const std::uint8_t> cdr) const {
  ddsrt_iovec_t bytes{};
  bytes.iov_base = const_cast<std::uint8_t*>(cdr.data());  // only read
  bytes.iov_len = cdr.size();
  return ddsi_serdata_from_ser_iov(type_, SDK_DATA, 1, &bytes, cdr.size());
}

}  // namespace relievo
